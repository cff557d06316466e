"""How runs of the engine ``petsc`` end: by signals, limits of time, killed launchers, and what they then claim."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.problem_files import block_file
from tests.ranks.running import environment, mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_HERE = Path(__file__).parent
_TEXT = block_file(24, friction='{ law = "logarithmic", bound = 0.5 }')


def _problem(folder: Path, text: str = _TEXT) -> Path:
    path = folder / "p.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _hostile(
    ranks: int, conditions: dict[str, object], problem: Path, *options: str | Path
) -> subprocess.CompletedProcess[str]:
    arguments = ["solve", problem, "--engine", "petsc", "-q", *options]
    return mpirun(ranks, _HERE / "hostile.py", json.dumps(conditions), *arguments, limit=150.0)


@pytest.mark.parametrize(
    ("name", "ranks", "rank"), [("SIGTERM", 2, 1), ("SIGHUP", 2, 0), ("SIGINT", 1, 0), ("SIGUSR1", 2, 1)]
)
def test_a_signal_on_one_rank_ends_all_with_iterate_and_files(tmp_path: Path, name: str, ranks: int, rank: int) -> None:
    conditions = {"signal": name, "rank": rank, "at": 2}
    files = ("--json", tmp_path / "r.json", "--vtu", tmp_path / "r.vtu")
    done = _hostile(ranks, conditions, _problem(tmp_path), "--rtol", "1e-14", *files)
    assert done.returncode == 130, done.stderr
    assert done.stderr.count("hemivar: ") == 1
    assert "hemivar: interrupted" in done.stderr
    record = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["status"] == "interrupted"
    assert record["certificate"]["unique"] is None
    assert np.isfinite(record["displacement"]).all()
    assert (tmp_path / "r.pvtu").exists()


def test_the_limit_of_time_holds_on_coarser_meshes_too(tmp_path: Path) -> None:
    problem = _problem(tmp_path, _TEXT.replace("[24, 24]", "[64, 64]"))
    done = _hostile(2, {"slow": 3.0}, problem, "--max-time", "1.5", "--json", tmp_path / "r.json")
    assert done.returncode == 1, done.stderr
    record = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["status"] == "max_time"
    assert record["steps"] == 0  # the first step on the coarsest mesh took it all
    assert record["timings"]["nested"] + record["timings"]["iterate"] < 60.0


def test_a_killed_launcher_leaves_the_old_files(tmp_path: Path) -> None:
    problem = _problem(tmp_path)
    files = [str(tmp_path / name) for name in ("r.json", "r.vtu", "kept")]
    options = ["solve", str(problem), "--engine", "petsc", "-q", "--json", files[0], "--vtu", files[1]]
    options += ["--checkpoint", files[2]]
    assert mpirun(2, "-m", "hemivar", *options).returncode == 0
    names = ("r.json", "r.pvtu", "r_0.vtu", "r_1.vtu", "r_contact.pvtu", "kept")
    before = {name: (tmp_path / name).read_bytes() for name in names}
    for wait in (0.9, 1.6, 2.3):
        command = ["mpirun", "-n", "2", sys.executable, "-m", "hemivar", *options]
        run = subprocess.Popen(
            command, env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        time.sleep(wait)
        os.kill(run.pid, signal.SIGKILL)
        run.wait(timeout=60.0)
        time.sleep(1.0)  # its ranks end when they miss it
        for name in names:
            now = (tmp_path / name).read_bytes()
            if name == "r.json":
                assert json.loads(now)["status"] == json.loads(before[name])["status"]
                continue
            head = 60 if name == "kept" else None
            assert len(now) > 0
            assert now[:head] == before[name][:head], name
        done = mpirun(
            2, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", "--checkpoint", files[2], "--resume"
        )
        assert done.returncode == 0, done.stderr


def test_the_same_run_twice_gives_the_same_bits(tmp_path: Path) -> None:
    problem = _problem(tmp_path)
    found = []
    for name in ("one.json", "two.json"):
        done = mpirun(2, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", "--json", tmp_path / name)
        assert done.returncode == 0, done.stderr
        record = json.loads((tmp_path / name).read_text(encoding="utf-8"))
        found.append([record[key] for key in ("displacement", "contact", "energy", "residual_parts", "steps")])
    assert found[0] == found[1]


def test_both_energies_are_one(tmp_path: Path) -> None:
    """With Coulomb's bound the energy takes it at the pair's own state, as in serial."""
    from hemivar.fem import discretize
    from hemivar.files.problem_file import read_problem

    text = _TEXT.replace('"logarithmic", bound = 0.5', '"coulomb", coefficient = 0.2')
    text = text.replace('"survey", q_max = 0.3, p_const = 2.0', '"compliance", stiffness = 20.0')
    problem = _problem(tmp_path, text)
    done = mpirun(2, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    record = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["energy"] == record["certificate"]["energy"]
    discrete = discretize(read_problem(problem))
    assert discrete.field is not None
    u = discrete.field.restrict(np.array(record["displacement"]))
    lam = np.column_stack([record["contact"]["pressure"], -np.array(record["contact"]["friction"])])
    assert record["energy"] == pytest.approx(discrete.energy(u, lam), rel=1e-9)
    assert record["certificate"]["unique"] is None


def test_claims_of_the_certificate(tmp_path: Path) -> None:
    problem = _problem(tmp_path)
    done = mpirun(2, "-m", "tests.ranks.claims", problem)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["shown"]["unique"] is True
    assert said["shown"]["method"] == "factorisation"
    assert said["shown"]["error_bound"] > 0.0
    # the very same margin is an estimate where no factorisation shows it, and claims nothing
    for key in ("large", "sampled", "no time"):
        assert said[key]["unique"] is None, key
        assert said[key]["kind"] == "stationary", key
        assert (said[key]["error_bound"] is None) == (key != "sampled"), key
        assert ("error bound" in said[key]["left_out"]) == (key != "sampled"), key
        assert "kind" in said[key]["left_out"], key
    assert said["sampled"]["error_bound_sampled"] is True
    assert said["shown"]["kind"] == "unique minimiser"
    assert said["shown"]["left_out"] == ["trace constant"]
    assert 0.0 < said["shown"]["equilibrium"] <= said["shown"]["error_bound"]
    assert said["no time"]["margin"] is None
    assert "margin" in said["no time"]["left_out"]
    assert "estimate" in said["large"]["method"]
    assert said["large"]["margin"] == pytest.approx(said["shown"]["margin"], abs=1e-3)
    assert said["sampled"]["alpha_sampled"] is True
    assert said["off"]["stationary"] is False
    assert said["off"]["kind"] == "not stationary"
    assert said["nan"] is None
    # a constant that is too small is found out
    assert said["too small"]["unique"] is None
    np.testing.assert_allclose(said["norms"], [5e200, 5e-200, 0.0, np.sqrt(2.0), np.inf])


def test_a_body_on_which_nothing_acts_rests_and_says_so(tmp_path: Path) -> None:
    text = """\
        title = "block"
        mesh = { rectangle = [2.0, 1.0], cells = [8, 4] }
        material = { young = 1e3, poisson = 0.3 }
        supports.left = { x = 0.0 }
        contact.bottom = { normal = { law = "compliance", stiffness = 1e4 }, gap = 0.1 }
        """
    problem = _problem(tmp_path, text)
    done = mpirun(2, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    record = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["status"] == "converged"
    assert not np.array(record["displacement"]).any()
    assert any("this equilibrium is one of many" in said for said in record["warnings"])
