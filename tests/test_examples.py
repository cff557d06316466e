"""Every example runs, and its numbers are those of a closed form or of an independent computation."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import re
import runpy
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import clarabel
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from scipy.optimize import brentq
from skfem.models.elasticity import linear_elasticity

import hemivar as hv
from hemivar.gallery import survey_cube, survey_cube_logarithmic
from tests.samples import slow
from tests.test_tutorials import looks_alike

EXAMPLES = Path(__file__).parents[1] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py") if not path.stem.startswith("_"))


@functools.cache
def run_example(name: str) -> dict[str, Any]:
    """What an example has defined when it has run, and printed; NumPy has nothing to warn of."""
    matplotlib.use("Agg")
    with contextlib.redirect_stdout(io.StringIO()) as printed, warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    plt.close("all")
    return found | {"printed": printed.getvalue()}


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
        (here / file).read_text(encoding="utf-8")
        for file in ("test_examples.py", "test_gallery_nonmonotone.py", "verification/test_double_cantilever.py")
    )
    for name in NAMES:
        assert re.search(rf"""["']{name}(\.py)?["']""", text), f"examples/{name}.py has no test of its numbers"


@pytest.mark.parametrize("name", NAMES)
def test_is_written_to_be_read(name: str) -> None:
    """A title, cells with text between them, a figure; nothing is hidden in a main()."""
    text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert re.match(r'r?"""\n(.+)\n=+\n\n\S', text)
    assert "def main" not in text
    assert len(re.findall(r"^# %%\n# \S", text, re.MULTILINE)) >= 2
    assert re.search(r"plt\.show\(\)|^\w*\.?plot\w*\(|\.plot\(", text, re.MULTILINE)


def test_one_runs_as_a_script(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "weighted_block.py")]
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert "penetration" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_first_solution() -> None:
    solution = run_example("first_solution")["solution"]
    known = independent(32, (-0.8, -0.8), constant(0.3), 2.0, constant(0.5))
    assert solution.energy == pytest.approx(known.energy, rel=1e-8)
    assert solution.penetration.max() == pytest.approx(known.penetration, rel=1e-6)
    assert solution.pressure.max() == pytest.approx(known.pressure, rel=1e-5)
    assert solution.normal_force == pytest.approx(known.normal_force, rel=1e-6)


def test_bar_from_arrays() -> None:
    found = run_example("bar_from_arrays")["found"]
    # kappa = 4, r0 = 6 * 0.25 / 4 - 0.01 = 0.365
    assert found["survey"] == pytest.approx(((4 * 0.365 - 0.3) / 6, 4 * (0.365 - (4 * 0.365 - 0.3) / 6)), abs=1e-12)
    assert found["compliance"] == pytest.approx((4 * 0.365 / 9, 20 * 0.365 / 9), abs=1e-12)
    assert found["signorini"] == pytest.approx((0.0, 1.46), abs=1e-12)


def test_weighted_block() -> None:
    found = run_example("weighted_block")["found"]
    # M = kappa = 12, kappa r0 = g/2: penetration (g/2 - 0.3)/14 where positive, pressure g/2 - 12 s.
    known = {0.3: (0.0, 0.15), 0.6: (0.0, 0.3), 1.0: (0.2 / 14, 0.5 - 2.4 / 14), 3.0: (1.2 / 14, 1.5 - 14.4 / 14)}
    known[10.0] = (4.7 / 14, 5.0 - 56.4 / 14)
    assert found.keys() == known.keys()
    for weight, pair in known.items():
        assert found[weight] == pytest.approx(pair, abs=1e-10)


def test_all_methods() -> None:
    rows = run_example("all_methods")["rows"]
    assert rows.keys() == hv.solvers.METHODS.keys()
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
    found = run_example("own_matrix_from_fem")
    s = 0.9 / 14
    assert found["penetration"] == pytest.approx(s, abs=1e-12)
    assert found["spread"] < 1e-12
    assert found["solution"].normal_force == pytest.approx(12 * (0.1 - s), abs=1e-12)
    # 1/2 kappa (D - s)^2 in the block, q s + p s^2/2 in the foundation
    assert found["solution"].energy == pytest.approx(6 * (0.1 - s) ** 2 + 0.3 * s + s**2, abs=1e-12)


def test_curved_contact_is_hertz_within_one_per_cent() -> None:
    found = run_example("curved_contact")
    width = math.sqrt(4 * found["load"] * (1 - 0.3**2) / math.pi)
    assert found["half_width"] == pytest.approx(width, rel=1e-12)
    assert found["found_width"] == pytest.approx(width, rel=0.01)
    assert found["found_peak"] == pytest.approx(2 * found["load"] / (math.pi * width), rel=0.01)
    assert found["solution"].penetration.max() <= 1e-15


def test_hertz_obstacle_is_hertz_within_one_per_cent() -> None:
    found = run_example("hertz_obstacle")
    width = math.sqrt(4 * found["force"] * 200.0 * (1 - 0.3**2) / (math.pi * 210e3))
    assert found["found_peak"] == pytest.approx(2 * found["force"] / (math.pi * width), rel=0.01)
    assert found["deepest"][1] / width == pytest.approx(
        0.70, abs=0.06
    )  # Johnson, Contact Mechanics: 0.70 for plane strain


def test_two_cylinders_are_hertz() -> None:
    """Half width and pressure by Hertz, for R = 10, E = 210000, nu = 0.3 and 1000 N/mm."""
    found = run_example("two_cylinders")
    assert pytest.approx(0.2348908547, rel=1e-9) == found["HALF_WIDTH"]
    assert pytest.approx(2710.279092, rel=1e-9) == found["PEAK"]
    assert found["widths"][-1] == pytest.approx(0.2348908547, rel=0.01)
    assert found["peaks"][-1] == pytest.approx(2710.279092, rel=0.002)
    assert found["order"] > 1.5
    upper, lower = found["finest"].contact_forces.values()
    np.testing.assert_allclose(upper, -lower, atol=1e-9)
    np.testing.assert_allclose(upper, [0.0, 1000.0], atol=1e-6)


def test_two_spheres_are_hertz() -> None:
    found = run_example("two_spheres")
    assert pytest.approx(0.3191252149, rel=1e-9) == found["HALF_WIDTH"]
    assert pytest.approx(4688.340501, rel=1e-9) == found["PEAK"]
    assert found["errors"][-1] < 0.02
    assert found["finest"].pressure.max() == pytest.approx(4688.340501, rel=0.01)
    assert found["finest"].normal_force == pytest.approx(1000.0, rel=2e-3)


def test_press_fit_is_lame_of_second_order() -> None:
    found = run_example("press_fit")
    assert found["EXACT"]["strain"] == pytest.approx(54.08653846, rel=1e-9)
    for errors in found["errors"].values():
        assert errors[-1] < 5e-4
        assert (np.log2(errors[:-1] / errors[1:]) > 1.9).all()
    assert found["around_axis"] == pytest.approx(54.08653846, rel=5e-4)


@pytest.mark.slow  # by default a block that its weight holds does (tests/branches/test_path_limit_load.py)
def test_a_retaining_wall_slides_and_topples_where_statics_says() -> None:
    found = run_example("retaining_wall")
    area, push = 4.0 * (3.2 + 1.0) / 2.0, 9.81 * 4.0**2 / 2.0
    assert found["path"].limit_load == pytest.approx(0.7 * 24.0 * area / push, rel=1e-8)
    arm = 3.2 - (4.0 * 0.5 + 4.4 * (1.0 + 2.2 / 3.0)) / area  # of the weight about the toe: rectangle and triangle
    assert found["tipping"].limit_load == pytest.approx(24.0 * area * arm / (push * 4.0 / 3.0), rel=1e-8)
    assert found["found"].carried < found["tipping"].limit_load < found["found"].not_carried


@pytest.mark.slow
def test_rubber_bearing_is_a_thin_film() -> None:
    """The film with Tresca's friction, integrated by hand; the free side is felt less in thinner strips."""
    forces = run_example("rubber_bearing")["forces"]
    stuck = 0.12 / (6.0 * 0.01)
    for width, (force, film) in forces.items():
        end = 0.5 * width
        slid = 0.01 * (end**3 - stuck**3) + 0.09 * (end**2 - stuck**2)  # int x (3 mu D x + 3 g/2) dx
        assert film == pytest.approx(0.04 * stuck**3 + slid, rel=1e-6)
        assert force == pytest.approx(film, rel={64.0: 0.005, 32.0: 0.005, 16.0: 0.025, 8.0: 0.08}[width])


def test_slip_flow_has_the_states_of_its_scalar_equations() -> None:
    found = run_example("slip_flow")
    slips = [one.unknowns.mean() for one in found["states"]]
    assert slips == pytest.approx([0.8 / 20.8, 0.5, 1.0], abs=1e-10)
    flows, fluxes = found["flows"], found["fluxes"]
    assert flows.exhaustive
    # a wall of stiffness a and offset b on each side: a s + b = G/2 -+ mu (s - other)
    pairs = set()
    for a, b in ((20.0, 0.0), (-4.0, 2.4), (0.0, 0.0)):
        for c, d in ((20.0, 0.0), (-4.0, 2.4), (0.0, 0.0)):
            matrix = np.array([[a + 0.8, -0.8], [-0.8, c + 0.8]])
            if abs(np.linalg.det(matrix)) > 1e-9:
                pair = np.linalg.solve(matrix, [0.8 - b, 0.8 - d])
                drag = np.maximum(np.minimum(20.0 * pair, 2.4 - 4.0 * pair), 0.0)
                if np.allclose(drag, [a * pair[0] + b, c * pair[1] + d]):
                    pairs.add(tuple(pair.round(9)))
    computed = {tuple(one.penetration[[0, -1]].round(9)) for one in flows}
    assert len(flows) == len(pairs) == 8
    assert computed == pairs
    for flux, exact in fluxes:
        assert flux == pytest.approx(exact, rel=1e-10)
    assert min(flux for flux, _ in fluxes) == pytest.approx(0.04 + 1.6 / 9.6, rel=1e-10)


def test_piezoelectric_sensor_is_a_spring_of_two_moduli() -> None:
    found = run_example("piezoelectric_sensor")
    for circuit, modulus in (("short", 117e9), ("open", 117e9 + 23.3**2 / 1.302e-8)):
        pressure, _ = found["found"][circuit]
        kappa = modulus / 2e-3
        np.testing.assert_allclose(pressure, 1e-7 * kappa * 8e13 / (kappa + 8e13), rtol=1e-9)
    strain = 1e-7 * 8e13 / (kappa + 8e13) / 2e-3
    assert found["signal"] == pytest.approx(strain * 2e-3 * 23.3 / 1.302e-8, rel=1e-9)
    assert found["potential"].max() > 10.0 * found["potential"][np.abs(found["x"]) > 4.9].max()


def clamped_beam(load: float) -> float:
    """Deflection of the middle of a clamped beam on springs: 1 long, stiffness 0.02, springs 40."""
    a = 0.5 * (40.0 / 0.08) ** 0.25
    c, s, ch, sh = math.cos(a), math.sin(a), math.cosh(a), math.sinh(a)
    return load / 40.0 * (1.0 - 2.0 * (c * sh + s * ch) / (math.sinh(2.0 * a) + math.sin(2.0 * a)))


def test_sinking_plate_follows_the_beam() -> None:
    found = run_example("sinking_plate")
    # before the ground gives way the beam is known
    assert found["beam"](0.5 * 0.01) * clamped_beam(0.5) == pytest.approx(0.5 * 0.01, rel=1e-4)
    (sunk, stable), *_ = found["path"].at(0.5)
    assert stable
    assert sunk[found["middle"], 0] == pytest.approx(clamped_beam(0.25), rel=0.005)
    exact = np.array([found["top"], found["valley"]])
    errors = {cells: np.abs(np.array(folds) / exact - 1.0) for cells, folds in found["folds"].items()}
    assert (errors[32] < (0.005, 0.03)).all()
    assert (errors[32] < 0.3 * errors[16]).all()
    assert [stable for _, stable in found["states"]] == [True, False, True]
    for (local, _), known in zip(found["states"], found["known"], strict=True):
        assert local[found["middle"], 0] == pytest.approx(known, rel=0.06)


def test_glued_bracket_is_a_plane_base_on_springs() -> None:
    found = run_example("glued_bracket")
    assert found["off"] < 0.015
    tension, shear = 6.0 * 48.0 / (40.0 * 60.0**2), 1.0 / 2400.0
    assert found["by_hand"] == pytest.approx(0.3 / math.hypot(tension, shear), rel=1e-12)
    assert found["tears"] == pytest.approx(found["by_hand"], rel=0.01)
    # statics of the torn bracket: force, shear and moment
    solution, weights = found["solution"], found["weights"]
    assert abs(weights @ solution.pressure) < 1e-8 * found["force"]
    assert found["moment"] == pytest.approx(48.0 * found["force"], rel=1e-8)
    assert np.linalg.norm(weights @ solution.multiplier[:, 1:]) == pytest.approx(found["force"], rel=1e-8)
    assert 0.1 < found["broken"] < 0.4
    assert found["mises"].max() > 10.0


def test_indenters_are_those_of_hertz_and_sneddon() -> None:
    found = run_example("indenters")
    assert found["exact"]["sphere"] == pytest.approx(1.5, rel=1e-9)
    assert found["exact"]["punch"] == pytest.approx(4.395604396, rel=1e-9)
    assert found["radius"] == pytest.approx(0.3446814956, rel=1e-9)
    for excess in found["excess"].values():
        assert np.array(excess[:-1]) / excess[1:] == pytest.approx(2.0, abs=0.06)
        assert abs(2.0 * excess[-1] - excess[-2]) < 1e-3, "nothing is left in a half space"
    assert max(found["off"].values()) < 0.004
    sphere = found["found"]["sphere"]
    scale = sphere.normal_force / 1.5
    peak = sphere.pressure[np.argsort(sphere.contact.points[:, 0])[:5]].mean()
    assert peak == pytest.approx(6.028325694 * scale, rel=0.01)


def test_sticky_sphere_lets_go_at_the_force_of_johnson_kendall_and_roberts() -> None:
    found = run_example("sticky_sphere")
    assert found["PULL_OFF"] == pytest.approx(0.3769911184, rel=1e-9)
    assert 0.0 < found["above"] < 0.03
    assert found["off"] < 0.04
    assert found["force"].min() > -0.5026548246 * 0.8  # far from the limit of a long range
    smallest = np.argmin(found["force"])
    assert found["radius"][smallest] == pytest.approx(found["AT_REST"] / 4.0 ** (1.0 / 3.0), rel=0.06)


def test_three_blocks_close_their_ledger_and_slip_at_coulombs_bound() -> None:
    found = run_example("three_blocks")
    assert found["history"].ended == "finished"
    assert found["gap"] < 1e-12
    for most in found["most"].values():
        assert most == pytest.approx(0.64, rel=1e-3)
    history, period = found["history"], slice(-51, None)
    loop = -np.trapezoid(history["top:bottom.friction_force"][period], found["drag"](history.times[period]))
    heat = float(np.ptp(history["friction"][period]))
    assert loop == pytest.approx(heat, rel=0.01), "the area of the loop is the heat of a period"


def test_wheel_on_rail_is_hertz_within_one_per_cent() -> None:
    found = run_example("wheel_on_rail")
    assert found["mesh"].parts.count == 2
    width = math.sqrt(8.0 * found["force"] * 460.0 * (1.0 - 0.3**2) / (math.pi * 210e3))
    assert found["found_width"] == pytest.approx(width, rel=0.01)
    assert found["found_peak"] == pytest.approx(2.0 * found["force"] / (math.pi * width), rel=0.01)


@pytest.mark.parametrize("name", ["half_disc", "wheel"])
def test_shipped_mesh_is_small(name: str) -> None:
    assert (EXAMPLES / "meshes" / f"{name}.msh").stat().st_size < 300_000


def test_law_in_space() -> None:
    found = run_example("law_in_space")
    assert found["uneven"].penetration == pytest.approx(0.06, abs=1e-12)
    assert found["layered"].penetration == pytest.approx((1.2 + 7 * 0.04) / 20, abs=1e-12)
    known = independent(32, (0.8, -0.8), found["hardness"], 2.0, found["bound"])
    assert found["solution"].energy == pytest.approx(known.energy, rel=1e-8)
    bound = found["bound"](found["points"])
    assert (found["size"] - bound).max() < 1e-12
    assert np.abs(found["size"] - bound)[found["slipping"]].max() < 1e-12
    assert np.count_nonzero(found["slipping"] & found["smooth"]) > 0


def test_own_laws_are_the_named_one() -> None:
    found = run_example("own_laws")
    for name, depth in found["depths"].items():
        assert depth == pytest.approx(found["depths"]["named"], rel=1e-6), name
    assert found["laws"]["table"].at(None).weak_convexity[0] == pytest.approx(2.0)


@pytest.mark.slow
def test_warm_start() -> None:
    found = run_example("warm_start")
    for warm, cold in zip(found["warm"], found["cold"], strict=True):
        assert np.abs(warm.unknowns - cold.unknowns).max() < 1e-9
    assert sum(warm.steps for warm in found["warm"]) < sum(cold.steps for cold in found["cold"])
    assert all(0.8 <= order <= 0.95 for order in found["found"][1:])  # the survey's Figure 5
    assert found["smooth_orders"][-1] == pytest.approx(1.0, abs=0.03)  # linear elements, smooth solution


def test_units() -> None:
    found = run_example("units")
    assert max(found["displacement"], found["pressure"], found["energy"]) < 1e-9
    assert found["si"].steps == found["mm"].steps
    assert 0 < found["touching"] < 40  # part of the bracket touches, part does not


def test_patch_test() -> None:
    found = run_example("patch_test")
    assert found["sunk"] < 1e-12
    assert found["uneven"] < 1e-12
    assert found["off"] < 1e-12
    assert found["beam_error"] < 1e-7


def test_three_solutions() -> None:
    found = run_example("three_solutions")
    assert found["found"].exhaustive
    assert found["depths"] == pytest.approx(found["by_hand"], abs=1e-12)
    # kappa (t r0 - r) = j'(r) where the law begins to give way, r = 0.1, and where nothing is left, r = 0.1 + 0.2/0.9
    assert found["folds"] == pytest.approx([(0.1 + 0.2 / 0.9) / 0.45, 0.5 / 0.45], rel=1e-12)


def test_convexity_and_margin() -> None:
    found = run_example("convexity_and_margin")
    for softening, margin in found["margins"].items():
        assert margin == pytest.approx(1.0 - softening / 12.0, abs=1e-6)
        if margin > 0.0:
            assert found["counts"][softening] == 1
    assert max(found["counts"].values()) > 1


def test_cube_friction() -> None:
    found = run_example("cube_friction")
    assert np.count_nonzero(found["slipping"]) > 0
    assert found["length"][found["slipping"]] == pytest.approx(0.4, abs=1e-9)
    assert found["length"].max() <= 0.4 + 1e-9
    assert found["along"][found["slipping"]] == pytest.approx(-1.0, abs=1e-6)
    assert np.abs(found["balance"]).max() < 1e-9


@pytest.mark.slow
def test_membrane_obstacle() -> None:
    found = run_example("membrane_obstacle")
    orders = np.log2(np.array(found["errors"][:-1]) / found["errors"][1:])
    assert orders.mean() == pytest.approx(2.0, abs=0.2)
    assert found["solution"].contact_length == pytest.approx(math.pi * found["radius"] ** 2, rel=0.1)


def test_antiplane_friction() -> None:
    found = run_example("antiplane_friction")
    assert found["error"] < 1e-3 * found["exact"].max()
    assert np.abs(found["friction"]).max() <= 1.0 + 1e-9


@pytest.mark.slow
def test_bounce() -> None:
    found = run_example("bounce")
    assert found["history"].events[0][0] == pytest.approx(math.sqrt(0.1), abs=0.02)
    assert abs(found["history"].ledger["gap"]) < 1e-6
    assert found["up"] == pytest.approx(found["known"].exact(found["known"].until), rel=0.02)


@pytest.mark.slow
def test_stick_slip() -> None:
    found = run_example("stick_slip")
    # rate V (1 - cos wt) + dF sin(wt)/sqrt(k m) = half of the peak, at wt = x
    x = brentq(lambda x: 0.1 * (1.0 - math.cos(x)) + 0.2 * math.sin(x) - 0.5 * found["belt"].peak, 0.0, 1.5)
    assert found["starts"][0] == pytest.approx(found["belt"].begins + x / 2.0, abs=0.08)  # steps of 0.03
    assert np.diff(found["starts"]) == pytest.approx(found["period"], rel=0.05)
    assert found["rate"].max() == pytest.approx(found["belt"].peak, rel=0.05)


def test_relaxation() -> None:
    errors = list(run_example("relaxation")["errors"].values())
    assert errors[-1] < 1e-4
    assert np.log2(errors[0] / errors[-1]) > 3.6


def test_wear() -> None:
    assert run_example("wear")["error"] < 0.01


@pytest.mark.slow
def test_delayed_failure() -> None:
    histories = run_example("delayed_failure")["histories"]
    rest, torn = histories[0.2]["tip.u_y"], histories[0.28]["tip.u_y"]
    assert rest[-1] == pytest.approx(rest[len(rest) // 2], rel=1e-2)
    assert torn[-1] > 3.0 * torn[len(torn) // 10] > 3.0 * rest[-1]


@pytest.mark.slow
def test_bar_impact() -> None:
    found = run_example("bar_impact")
    for mean in found["means"].values():
        assert mean == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
def test_exact_distance() -> None:
    found = run_example("exact_distance")
    for n, bound in found["bounds"].items():
        assert bound.guaranteed
        assert bound.distance >= found["errors"][n]
        assert bound.distance <= 3.0 * found["errors"][n]


@pytest.mark.slow
def test_adaptive_mesh() -> None:
    found = run_example("adaptive_mesh")["found"]
    assert found.reached
    assert found.distance.relative <= 0.1
    assert found.distance.guaranteed


@pytest.mark.slow
def test_mixed_mode() -> None:
    """The work is the fracture energy at every angle; the trapezoidal rule of 46 steps cuts the peak off."""
    found = run_example("mixed_mode")
    assert len(found["works"]) == 4
    for work in found["works"].values():
        assert work == pytest.approx(0.5, rel=0.005)
    for normal, shear in found["peaks"].values():
        assert np.hypot(normal / 30.0, shear / 45.0) == pytest.approx(1.0, abs=0.015)
    assert found["margin"] > 0.9


def test_trace_constants() -> None:
    found = run_example("trace_constants")
    for bound in found["found"].values():
        assert 0.0 < bound.simple <= bound.lower <= bound.upper
    assert found["certificate"].margin >= 0.5  # the discrete constant is not below that of the body


# ---- problem files -----------------------------------------------------------------------------------------


def solved_file(name: str) -> hv.Solution:
    return hv.solve(hv.discretize(hv.read_problem(EXAMPLES / "problems" / name))).raise_for_status()


def test_file_of_the_survey() -> None:
    known = independent(32, (-0.8, -0.8), constant(0.3), 2.0, constant(0.5))
    assert solved_file("survey_5_1.toml").energy == pytest.approx(known.energy, rel=1e-8)


def test_file_of_the_block() -> None:
    solution = solved_file("block.toml")
    np.testing.assert_allclose(solution.penetration, 0.2 / 14, rtol=0, atol=1e-12)
    np.testing.assert_allclose(solution.pressure, 0.5 - 2.4 / 14, rtol=0, atol=1e-12)


def test_file_of_the_half_disc_is_the_script() -> None:
    solution, script = solved_file("half_disc.toml"), run_example("curved_contact")
    vertical = -(solution.problem.contact.weights * solution.pressure) @ solution.problem.contact.frames[:, 0, 1]
    assert vertical == pytest.approx(script["load"], rel=1e-9)


def test_files_of_the_cube_are_the_gallery() -> None:
    for name, problem in (("cube_friction", survey_cube("5.1", 8)), ("cube_logarithmic", survey_cube_logarithmic(n=8))):
        known = hv.solve(hv.discretize(problem)).raise_for_status()
        assert solved_file(f"{name}.toml").energy == pytest.approx(known.energy, rel=1e-9)


@pytest.mark.slow
def test_thermoviscoelastic() -> None:
    found = run_example("thermoviscoelastic")
    assert found["momentum"] == pytest.approx(found["pushed"], rel=1e-6)
    assert abs(found["heat"].gap) < 1e-12
    assert 0.25 < found["temperature"].min() < found["temperature"].max() < 0.28
    assert found["history"].margin > 0.0


def test_every_problem_file_solves_with_the_command(tmp_path: Path) -> None:
    files = sorted((EXAMPLES / "problems").glob("*.toml"))
    assert len(files) >= 3
    result = tmp_path / "result.json"
    command = [sys.executable, "-m", "hemivar", "solve", str(files[0]), "--quiet", "--json", str(result)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(result.read_text())["status"] == "converged"


# ---- documentation -----------------------------------------------------------------------------------------

DOCS = sorted([*(EXAMPLES.parent / "docs").glob("*.md"), *(EXAMPLES.parent / "docs" / "theory").glob("*.md")])
OUTPUTS = runpy.run_path(str(EXAMPLES.parent / "docs" / "lesson_outputs.py"))
README, PAPER = EXAMPLES.parent / "README.md", EXAMPLES.parent / "paper" / "paper.md"
#: Pages whose code runs for seconds.
LONG_PAGES = (
    "bounds.md", "figures.md", "glue.md", "identification.md", "nonlinear.md", "tutorial-failure.md",
    "tutorial-mathematician.md",
)  # fmt: skip
PAGES = [*DOCS, *(EXAMPLES.parent / name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "README.md"))]


@pytest.mark.parametrize(
    "page",
    [slow(page) if page.name in LONG_PAGES else page for page in (*DOCS, README, PAPER)],
    ids=lambda path: path.name if path.parent.name == "docs" else str(path.relative_to(EXAMPLES.parent)),
)
def test_snippets_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks marked ``python`` run one after the other; ``py`` needs other software (test_other_software).

    What a block prints is what stands below it, in a lesson below every block: ``python docs/lesson_outputs.py``.
    """
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLES / "meshes" / "bracket.msh", tmp_path)  # the lesson for engineers tells its reader to
    for block, printed, _ in OUTPUTS["run"](page.read_text(encoding="utf-8"), page.name):
        if block["printed"] is not None or page.stem in OUTPUTS["LESSONS"]:
            assert OUTPUTS["same"](block["printed"] or "", printed), f"{page.name}: {block['code']}prints\n{printed}"
    if page == README:
        assert looks_alike(tmp_path / "bracket.png", EXAMPLES.parent / "docs" / "images" / "bracket.png")


@pytest.mark.parametrize(
    ("printed", "same"),
    [
        ("force 1.25 N, 3 points, in 7.1 s\n", True),
        ("force  1.2501 N, 3 points, in 0.2 s", True),
        ("force 1.35 N, 3 points, in 7.1 s\n", False),
        ("force 1.25 N, 4 points, in 7.1 s\n", False),
        ("force 1.25 kN, 3 points, in 7.1 s\n", False),
        ("force 1.25 N, 3 points, in 7.1 s, residual 2e-15\n", False),
        ("", False),
    ],
)
def test_what_a_page_shows_is_compared(printed: str, same: bool) -> None:
    assert OUTPUTS["same"]("force 1.25 N, 3 points, in 0.02 s\n", printed) is same
    assert OUTPUTS["same"]("residual 2e-15", "residual 7.3e-17")
    assert not OUTPUTS["same"]("residual 2e-15", "residual 7.3e-4")


def test_own_elements_states_what_its_examples_print_and_shows_their_code() -> None:
    text = (EXAMPLES.parent / "docs" / "own-elements.md").read_text(encoding="utf-8")
    section = text.split("## Examples with closed forms")[1].split("## ")[0]
    rows = [line.split("|")[1:-1] for line in section.splitlines() if line.startswith("|")][2:]
    assert len(rows) >= 8
    name = ""
    for example, *_, by_hand, computed in rows:
        name = (re.findall(r"examples/(\w+)\.py", example) or [name])[0]
        for figure in (by_hand, computed):
            assert figure.split()[0] in run_example(name)["printed"], f"{name} does not print {figure}"
    code = (EXAMPLES / "slip_flow.py").read_text(encoding="utf-8")
    block = text.split("DRAG = ")[1].split("slips = ")[0].splitlines()
    assert len(block) > 10
    assert all(line in code for line in block)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_and_names_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        made = target.startswith(("gallery/", "reference/")) and page.parent.name == "docs"  # with the site
        if "://" not in target and not made:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
    for path in re.findall(r"\bexamples/[\w/]+\.(?:py|toml|msh)", text):
        assert (EXAMPLES.parent / path).exists(), f"{page.name} names {path}"
    for name in re.findall(r"\bhv\.(\w+)", text):
        assert name in dir(hv), f"{page.name} names hemivar.{name}"
    for room, name in re.findall(r"\bhv\.(\w+)\.(\w+)", text):
        assert hasattr(getattr(hv, room), name), f"{page.name} names hemivar.{room}.{name}"


def test_every_page_is_in_one_menu_of_the_site_and_answers_a_question() -> None:
    docs = EXAMPLES.parent / "docs"
    texts = {page.relative_to(docs).with_suffix("").as_posix(): page.read_text(encoding="utf-8") for page in DOCS}
    del texts["README"]
    entries = []
    for page, text in texts.items():
        for menu in re.findall(r"^```\{toctree\}\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            names = re.findall(r"^([\w/-]+)$", menu, re.MULTILINE)
            entries += [f"theory/{name}" if page.startswith("theory/") else name for name in names]
    entries = [name for name in entries if not name.startswith("notebooks/")]
    made = {"gallery/index", "reference/index"}  # with the site
    assert sorted(set(entries) - made) == sorted(texts.keys() - {"index"})
    assert len(entries) == len(set(entries))
    questions = re.findall(r"\]\(([\w/-]+)\.md\)", texts["which"])
    asked = {page for page in texts if page == "theory/index" or not page.startswith("theory/")}
    assert asked - {"index", "which", "installation"} <= set(questions)


def test_every_method_and_its_options_are_documented() -> None:
    text = (EXAMPLES.parent / "docs" / "methods.md").read_text(encoding="utf-8")
    for name, method in hv.solvers.METHODS.items():
        assert f"`{name}`" in text
        for part in (method, getattr(method, "optimizer", None), getattr(method, "inner", None)):
            if part is None:
                continue
            for option in fields(part):
                assert re.search(rf"[`(]{option.name}=", text), f"{name}: {option.name}"
    for status in hv.Status:
        assert f"`{status.name}`" in text
