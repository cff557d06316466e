"""Laws of opening and slip together with the engine ``petsc``: mixed-mode glue and orthotropic friction."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from hemivar.certificates import certify
from hemivar.files import write_json
from tests.ranks.against_serial import plan, record_of, serial_of

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

GLUED = (
    "[mesh]\nrectangle = [1.0, 0.5]\ncells = [16, 8]\n[material]\nyoung = 300.0\npoisson = 0.3\n"
    '[loads]\ntraction = { top = [4.0, 3.0] }\n[supports]\nleft = "clamped"\n[contact.bottom]\n'
)
RUBBED = (
    "[mesh]\nbox = [1.0, 1.0, 1.0]\ncells = [6, 6, 6]\n[material]\nlame = [4.0, 4.0]\n"
    '[loads]\nbody = [-0.5, -0.2, -0.5]\n[supports]\nleft = "clamped"\n'
    '[contact.bottom]\nnormal = { law = "compliance", stiffness = 10.0 }\nfriction = '
)


def glued(glue: str) -> str:
    """A block pulled off and along its glue."""
    return GLUED + f'normal = {{ law = "mixed-mode", {glue} }}\n'


CASES = {
    # tough glue, some of which softens: one solution
    "bilinear": glued("strength = 3.0, energy = 1.5, stiffness = 4e3, ratio = 1.5"),
    "exponential": glued('strength = 3.0, energy = 2.0, stiffness = 4e3, shape = "exponential"'),
    # another law meets the glue, on a boundary that not every rank has
    "beside friction": glued("strength = 3.0, energy = 1.5, stiffness = 4e3")
    + '[contact.right]\nnormal = { law = "compliance", stiffness = 100.0 }\n'
    + 'friction = { law = "tresca", bound = 0.1 }\n',
    "orthotropic": RUBBED + '{ law = "orthotropic", bound = 0.05, ratio = 0.4, axis = [1.0, 1.0, 0.0] }\n',
    "orthotropic by the pressure": RUBBED
    + '{ law = "orthotropic", bound = { coulomb = 0.1 }, ratio = 0.4, axis = [1.0, 1.0, 0.0] }\n',
}
GLUES = [name for name, text in CASES.items() if "mixed-mode" in text]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the problem files are."""
    path = tmp_path_factory.mktemp("problems")
    for name, text in CASES.items():
        (path / f"{name}.toml").write_text(text, encoding="utf-8")
    plan(path, dict.fromkeys(CASES, 1e-12) | {"orthotropic by the pressure": 1e-11})
    return path


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("name", CASES)
def test_the_serial_solution_and_its_record(folder: Path, name: str, ranks: int) -> None:
    record = record_of(folder, name, ranks)["contact"]
    reference = serial_of(folder / f"{name}.toml")[1]
    serial = json.loads(write_json(reference, folder / f"{name}.serial.json").read_text(encoding="utf-8"))["contact"]
    assert list(record) == list(serial)
    assert ("damage" in record) == (name in GLUES)
    for key in ("friction", "damage", "dissipated", "mode_ratio"):
        if key in serial:
            own, other = (np.array(one[key], dtype=float) for one in (record, serial))
            np.testing.assert_allclose(own, other, atol=1e-8 * max(1.0, float(np.nanmax(np.abs(other)))), err_msg=key)
    for key in ("normal_state", "tangential_state"):
        assert record[key] == serial[key]


@pytest.mark.parametrize("name", CASES)
def test_no_more_is_claimed_than_serially(folder: Path, name: str) -> None:
    found = record_of(folder, name, 2)["certificate"]
    discrete, reference = serial_of(folder / f"{name}.toml")
    serial = certify(discrete, reference.unknowns, reference.multiplier)
    assert found["unique"] is not True or serial.unique is True
    margin = -np.inf if "margin" in found["minus_infinite"] else found["margin"]
    assert margin == pytest.approx(serial.margin, rel=1e-3)
    assert found["unique"] is (True if serial.unique is True else None)
    assert found["coupling"] == pytest.approx(serial.smallness.coupling, rel=1e-3) or "coupling" in found["infinite"]
