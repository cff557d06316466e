"""Every example runs, and its numbers are those of a closed form or of an independent computation."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from skfem.models.elasticity import linear_elasticity

import hemivar as hv
from hemivar.gallery import survey_cube, survey_cube_logarithmic

EXAMPLES = Path(__file__).parents[1] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py") if not path.stem.startswith("_"))


def load(name: str) -> ModuleType:
    """Import an example by its path."""
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@dataclass(frozen=True)
class Independent:
    """Solution of a survey-like problem by other means: scikit-fem's assembly, Clarabel's interior point method."""

    energy: float
    penetration: float
    pressure: float
    normal_force: float


def independent(
    n: int,
    force: tuple[float, float],
    q_max: Callable[[np.ndarray], np.ndarray],
    p_const: float,
    bound: Callable[[np.ndarray], np.ndarray],
) -> Independent:
    """The unit square, Lame constants 4 and 4, clamped at x = 0, on the survey's foundation, as a quadratic program."""
    grid = np.linspace(0.0, 1.0, n + 1)
    corners = np.array([(x, y) for y in grid for x in grid])
    middles = np.array([(x, y) for y in grid[:-1] + 0.5 / n for x in grid[:-1] + 0.5 / n])
    cells = []
    for row in range(n):
        for column in range(n):
            a = row * (n + 1) + column
            ring = [a, a + 1, a + n + 2, a + n + 1]
            cells += [(ring[k], ring[(k + 1) % 4], len(corners) + row * n + column) for k in range(4)]
    mesh = skfem.MeshTri(np.vstack([corners, middles]).T, np.array(cells).T)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
    stiffness = sp.csr_array(linear_elasticity(4.0, 4.0).assemble(basis))
    load = skfem.LinearForm(lambda v, _: force[0] * v[0] + force[1] * v[1]).assemble(basis)
    free = np.setdiff1d(np.arange(stiffness.shape[0]), basis.get_dofs(lambda x: x[0] < 1e-12).all())
    K, f = sp.csc_array(stiffness[free][:, free]), load[free]

    nodes = np.arange(1, n + 1)  # of the bottom, from left to right; the first is clamped
    points, m = corners[nodes], n
    weights = np.full(m, 1.0 / n)
    weights[-1] *= 0.5
    place = np.full(stiffness.shape[0], -1)
    place[free] = np.arange(free.size)
    one = np.ones(m)
    normal = sp.csc_array((-one, (np.arange(m), place[basis.nodal_dofs[1, nodes]])), shape=(m, free.size))
    tangent = sp.csc_array((one, (np.arange(m), place[basis.nodal_dofs[0, nodes]])), shape=(m, free.size))
    q, h = q_max(points), bound(points)
    # Unknowns (u, s, t) with s >= u_nu, s >= 0, t >= |u_tau|: pressure on s, friction on t.
    eye, none = sp.identity(m, format="csc"), sp.csc_array((m, m))
    P = sp.block_diag([K, sp.diags_array(weights * p_const), none], format="csc")
    linear = np.concatenate([-f, weights * q, weights * h])
    A = sp.block_array(
        [
            [normal, -eye, none],
            [sp.csc_array((m, free.size)), -eye, none],
            [tangent, none, -eye],
            [-tangent, none, -eye],
        ],
        format="csc",
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    P_upper, A = sp.csc_matrix(sp.triu(P)), sp.csc_matrix(A)
    found = clarabel.DefaultSolver(
        P_upper, linear, A, np.zeros(4 * m), [clarabel.NonnegativeConeT(4 * m)], settings
    ).solve()
    u = np.array(found.x)[: free.size]
    pressure = np.array(found.z)[:m] / weights  # the multiplier of s >= u_nu is the force at the node
    return Independent(
        energy=float(found.obj_val),
        penetration=float((normal @ u).max()),
        pressure=float(pressure.max()),
        normal_force=float(weights @ pressure),
    )


def constant(value: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: np.full(len(x), value)


def test_there_are_at_least_eight_examples_and_each_is_tested() -> None:
    assert len(NAMES) >= 8
    here = Path(__file__).parent
    text = "".join(
        (here / file).read_text(encoding="utf-8") for file in ("test_examples.py", "test_gallery_nonmonotone.py")
    )
    for name in NAMES:
        assert re.search(rf"""["']{name}(\.py)?["']""", text), f"examples/{name}.py has no test of its numbers"


#: Those whose numbers test_gallery_nonmonotone.py computes anew, in its own process.
LONG = {"broken_foundation", "weakening_friction"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in NAMES]
)
def test_runs_as_a_script(name: str, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d", done.stdout)
    begins = {".png": b"\x89PNG\r", ".pdf": b"%PDF-", ".html": b"<!DOCTYPE html>", ".json": b"{", ".vtu": b"<"}
    written = list(out.iterdir())
    assert written
    for path in written:
        assert path.stat().st_size > 20, path
        assert path.read_bytes().startswith(begins.get(path.suffix, b"")), path


def test_first_solution() -> None:
    found = load("first_solution").main()
    known = independent(32, (-0.8, -0.8), constant(0.3), 2.0, constant(0.5))
    assert found["energy"] == pytest.approx(known.energy, rel=1e-8)
    assert found["penetration"] == pytest.approx(known.penetration, rel=1e-6)
    assert found["pressure"] == pytest.approx(known.pressure, rel=1e-5)
    assert found["normal_force"] == pytest.approx(known.normal_force, rel=1e-6)


def test_first_solution_writes_its_files(tmp_path: Path) -> None:
    load("first_solution").main(tmp_path)
    assert (tmp_path / "first_solution.png").stat().st_size > 1000
    assert (tmp_path / "first_solution.vtu").exists()


def test_bar_from_arrays() -> None:
    found = load("bar_from_arrays").main()
    # kappa = 4, r0 = 6 * 0.25 / 4 - 0.01 = 0.365
    assert found["survey"] == pytest.approx(((4 * 0.365 - 0.3) / 6, 4 * (0.365 - (4 * 0.365 - 0.3) / 6)), abs=1e-12)
    assert found["compliance"] == pytest.approx((4 * 0.365 / 9, 20 * 0.365 / 9), abs=1e-12)
    assert found["signorini"] == pytest.approx((0.0, 1.46), abs=1e-12)


def test_weighted_block() -> None:
    found = load("weighted_block").main()
    # M = kappa = 12, kappa r0 = g/2: penetration (g/2 - 0.3)/14 where positive, pressure g/2 - 12 s.
    known = {0.3: (0.0, 0.15), 0.6: (0.0, 0.3), 1.0: (0.2 / 14, 0.5 - 2.4 / 14), 3.0: (1.2 / 14, 1.5 - 14.4 / 14)}
    known[10.0] = (4.7 / 14, 5.0 - 56.4 / 14)
    assert found.keys() == known.keys()
    for weight, pair in known.items():
        assert found[weight] == pytest.approx(pair, abs=1e-10)


def test_all_methods() -> None:
    rows = load("all_methods").main()
    assert rows.keys() == hv.METHODS.keys()
    known = independent(16, (-0.8, -0.8), constant(0.3), 2.0, constant(0.5))
    for name, row in rows.items():
        if name == "direct-powell":  # known to stop short at the survey's tolerance
            assert row["status"] == "inaccurate"
            assert row["difference"] < 0.05
            continue
        assert row["status"] == "converged", name
        assert row["difference"] < 1e-8, name
        assert row["energy"] == pytest.approx(known.energy, rel=1e-8), name


def test_own_matrix_from_fem() -> None:
    found = load("own_matrix_from_fem").main()
    s = 0.9 / 14
    assert found["penetration"] == pytest.approx(s, abs=1e-12)
    assert found["spread"] < 1e-12
    assert found["normal_force"] == pytest.approx(12 * (0.1 - s), abs=1e-12)
    # 1/2 kappa (D - s)^2 in the block, q s + p s^2/2 in the foundation
    assert found["energy"] == pytest.approx(6 * (0.1 - s) ** 2 + 0.3 * s + s**2, abs=1e-12)


def test_curved_contact_is_hertz_within_one_per_cent() -> None:
    found = load("curved_contact").main()
    width = math.sqrt(4 * found["load"] * (1 - 0.3**2) / math.pi)
    assert found["hertz_half_width"] == pytest.approx(width, rel=1e-12)
    assert found["half_width"] == pytest.approx(width, rel=0.01)
    assert found["peak"] == pytest.approx(2 * found["load"] / (math.pi * width), rel=0.01)
    assert found["penetration"] <= 1e-15


def test_shipped_mesh_is_small() -> None:
    assert (EXAMPLES / "meshes" / "half_disc.msh").stat().st_size < 300_000


def test_law_in_space() -> None:
    example = load("law_in_space")
    found = example.main()
    assert found["uneven"] == pytest.approx(0.06, abs=1e-12)
    assert found["uneven_spread"] < 1e-12
    assert found["layered"] == pytest.approx((1.2 + 7 * 0.04) / 20, abs=1e-12)
    known = independent(32, (0.8, -0.8), example.hardness, 2.0, example.bound)
    assert found["energy"] == pytest.approx(known.energy, rel=1e-8)
    assert found["friction_excess"] < 1e-12
    assert found["slip_deficit"] < 1e-12
    assert found["slipping_smooth"] > 0


def test_warm_start() -> None:
    found = load("warm_start").main()
    assert max(found["same"]) < 1e-9
    assert sum(found["warm_steps"]) < sum(found["cold_steps"])
    assert all(0.8 <= order <= 0.95 for order in found["orders"][1:])  # the survey's Figure 5
    assert found["smooth_orders"][-1] == pytest.approx(1.0, abs=0.03)  # linear elements, smooth solution


def test_units() -> None:
    found = load("units").main()
    assert max(found["displacement"], found["pressure"], found["energy"]) < 1e-9
    assert found["steps"] == found["steps_mm"]
    assert 0 < found["touching"] < 40  # part of the bracket touches, part does not


def test_patch_test() -> None:
    found = load("patch_test").main()
    assert found["penetration"] < 1e-12
    assert found["stress"] < 1e-12
    assert found["cube"] < 1e-12
    assert found["beam"] < 1e-7


# ---- problem files -----------------------------------------------------------------------------------------


def solved(name: str) -> hv.Solution:
    return hv.solve(hv.discretize(hv.read_problem(EXAMPLES / "problems" / name))).raise_for_status()


def test_file_of_the_survey() -> None:
    known = independent(32, (-0.8, -0.8), constant(0.3), 2.0, constant(0.5))
    assert solved("survey_5_1.toml").energy == pytest.approx(known.energy, rel=1e-8)


def test_file_of_the_block() -> None:
    solution = solved("block.toml")
    np.testing.assert_allclose(solution.penetration, 0.2 / 14, rtol=0, atol=1e-12)
    np.testing.assert_allclose(solution.pressure, 0.5 - 2.4 / 14, rtol=0, atol=1e-12)


def test_file_of_the_half_disc_is_the_script() -> None:
    solution, script = solved("half_disc.toml"), load("curved_contact").main()
    vertical = -(solution.problem.contact.weights * solution.pressure) @ solution.problem.contact.frames[:, 0, 1]
    assert vertical == pytest.approx(script["load"], rel=1e-9)


def test_files_of_the_cube_are_the_gallery() -> None:
    for name, problem in (("cube_friction", survey_cube("5.1", 8)), ("cube_logarithmic", survey_cube_logarithmic(n=8))):
        known = hv.solve(hv.discretize(problem)).raise_for_status()
        assert solved(f"{name}.toml").energy == pytest.approx(known.energy, rel=1e-9)


def test_thermoviscoelastic() -> None:
    found = load("thermoviscoelastic").main()
    assert found["momentum"] == pytest.approx(found["pushed"], rel=1e-6)
    assert abs(found["heat_gap"]) < 1e-12
    assert 0.25 < found["least"] < found["greatest"] < 0.28
    assert found["margin"] > 0.0


def test_every_problem_file_solves_with_the_command(tmp_path: Path) -> None:
    files = sorted((EXAMPLES / "problems").glob("*.toml"))
    assert len(files) >= 3
    result = tmp_path / "result.json"
    command = [sys.executable, "-m", "hemivar", "solve", str(files[0]), "--quiet", "--json", str(result)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(result.read_text())["status"] == "converged"


# ---- documentation -----------------------------------------------------------------------------------------

DOCS = sorted((EXAMPLES.parent / "docs").glob("*.md"))
PAGES = [*DOCS, *(EXAMPLES.parent / name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "README.md"))]


@pytest.mark.parametrize("page", DOCS, ids=lambda path: path.name)
def test_snippets_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks marked ``python`` run one after the other; blocks marked ``py`` need other software."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
        exec(compile(block, str(page), "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_and_names_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
    for path in re.findall(r"\bexamples/[\w/]+\.(?:py|toml|msh)", text):
        assert (EXAMPLES.parent / path).exists(), f"{page.name} names {path}"
    for name in re.findall(r"\bhv\.(\w+)", text):
        assert name in hv.__all__, f"{page.name} names hemivar.{name}"


def test_every_method_and_its_options_are_documented() -> None:
    text = (EXAMPLES.parent / "docs" / "methods.md").read_text(encoding="utf-8")
    for name, method in hv.METHODS.items():
        assert f"`{name}`" in text
        for part in (method, getattr(method, "optimizer", None), getattr(method, "inner", None)):
            if part is None:
                continue
            for option in fields(part):
                assert re.search(rf"[`(]{option.name}=", text), f"{name}: {option.name}"
    for status in hv.Status:
        assert f"`{status.name}`" in text
