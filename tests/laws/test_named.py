"""A new law is one file: everything that lists laws finds it there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.laws.written import written

ROOT = Path(__file__).parents[2]
#: A law in a file of its own.
HARDENING = '''"""Springs that become stiffer."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.types import Array, Parameter
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, RATE, positive
from hemivar.laws.parametrised import NamedLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["Hardening"]


@named(LawKind.NORMAL, "hardening", "springs that are twice as stiff beyond a penetration", "j'(r) = stiffness r, ...")
@dataclass(frozen=True, eq=False)
class Hardening(NamedLaw):
    """Springs that are twice as stiff beyond a penetration."""

    stiffness: Parameter = field(metadata=positive("of the springs", RATE, 10.0))
    limit: Parameter = field(metadata=positive("penetration at which they harden", LENGTH, 0.05))
    name = "hardening"

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        k, limit, zero = values["stiffness"], values["limit"], np.zeros(1)
        return PiecewiseQuadratic(columns(zero, limit), columns(zero, k, 2.0 * k), np.zeros((1, 2)), name=self.name)
'''
#: What asks all places that list laws.
ASKING = """
import json
import numpy as np
import hemivar as hv
from hemivar.laws import testing
from hemivar.laws.registry import NORMAL_LAWS
from hemivar.studio import sliders
from tests.composition.cases import NORMALS
from tests.laws.catalogue import LAWS
from tests.laws.written import DOCS
from tests.robustness.seeds import SEEDS

law = hv.laws.Hardening(10.0, 0.05)
testing.check_law(law)
print(json.dumps({
    "derivative": law.derivative([0.05, 0.1]).tolist(),
    "registry": "hardening" in NORMAL_LAWS,
    "catalogue": "hardening" in LAWS,
    "composition": "hardening" in NORMALS,
    "seeds": "hardening" in SEEDS,
    "sliders": "hardening" in json.dumps(sorted(sliders.NORMAL_LAWS)),
    "laws.md": "`Hardening(stiffness, limit)`" in (DOCS / "laws.md").read_text(),
    "problem-file.md": '| `"hardening"` | springs that are twice as stiff beyond a penetration | `stiffness` > 0, '
    "`limit` > 0 |" in (DOCS / "problem-file.md").read_text(),
}))
"""
FILE = """
mesh = { rectangle = [1.0, 1.0], cells = [4, 4] }
material = { young = 1000.0, poisson = 0.3 }
supports = { top = { displacement = [0.0, -0.1] }, left = "roller", right = "roller" }
contact.bottom.normal = { law = "hardening", stiffness = 10.0, limit = 0.05 }
"""


def test_exports_and_rows_of_pages_are_those_that_are_written() -> None:
    """``python -m tests.laws.written`` writes them."""
    assert [path.name for path, text in written().items() if path.read_text(encoding="utf-8") != text] == []


@pytest.mark.slow
def test_a_law_is_one_file(tmp_path: Path) -> None:
    """In a copy of the library: Python, problem files, the command, pages, tests of laws, composition, studio."""
    passed = shutil.ignore_patterns("__pycache__", "*.png", "files", "gmsh")
    for folder in ("src", "tests", "docs"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=passed if folder != "src" else None)
    (tmp_path / "src" / "hemivar" / "laws" / "normal" / "hardening.py").write_text(HARDENING)
    path = os.pathsep.join([str(tmp_path / "src"), str(tmp_path)])

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, *words],
            env={**os.environ, "PYTHONPATH": path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("-m", "tests.laws.written")
    answers = json.loads(run("-c", ASKING).splitlines()[-1])
    assert answers.pop("derivative") == pytest.approx([0.5, 1.5])
    assert answers == dict.fromkeys(answers, True)
    assert "springs that are twice as stiff beyond a penetration" in " ".join(run("-m", "hemivar", "laws").split())
    (tmp_path / "plate.toml").write_text(FILE)
    run("-m", "hemivar", "solve", "plate.toml", "--json", "plate.json")
    assert '"converged"' in (tmp_path / "plate.json").read_text()
    run("-m", "pytest", "-q", "-n", "0", "tests/laws/test_nonmonotone.py", "-k", "hardening")
