"""A new law, memory, material or scheme is one file: everything that lists them finds it there."""

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
DRY = '''"""Friction that halves its bound at once."""

from __future__ import annotations

from hemivar.basics.stated import stating
from hemivar.basics.types import Parameter
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.friction.friction_law import Friction, SlipMeasure
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import FRICTION

__all__ = ["Lubricated"]


@named(LawKind.FRICTION, "lubricated", "friction of at most half the bound", "j(s) = bound |s|/2")
@stating(**FRICTION)
def Lubricated(bound: Parameter, *, of: SlipMeasure | str | None = None) -> Friction:
    """Friction of at most half the bound."""
    return Friction(0.5 * bound, of=of)
'''
PEELING = '''"""Glue whose potential is a rational function."""

from __future__ import annotations

from dataclasses import dataclass, field

from hemivar.basics.stated import stating
from hemivar.laws.coupled.own_coupled import OwnCoupledLaw
from hemivar.laws.coupled.own_coupled_makers import CoupledFormulaLaw
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, LINE, positive

__all__ = ["Peeling"]


@named(LawKind.NORMAL, "peeling", "glue that fades with the square of its opening and slip", "j = energy rho/(1 + rho)")
@stating(energy=positive("fracture energy", LINE, 0.5), width=positive("where it fades", LENGTH, 0.01))
def Peeling(energy: float, width: float) -> OwnCoupledLaw:
    """Glue that fades with the square of its opening and slip."""
    square = f"(min(r, 0)^2 + s^2)/{width**2!r}"
    return CoupledFormulaLaw(f"{energy!r}*{square}/(1 + {square}) + 5e3*max(r, 0)^2", reach=0.1)
'''
FADING = '''"""Friction that wears off."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, Parameter
from hemivar.laws.friction import Friction
from hemivar.laws.memory.contact_memory import LocalStep, Memory, MemoryState, kept
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import positive
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Fading"]


@named(LawKind.MEMORY, "fading", "friction that wears off with its work", "h = bound exp(-rate work)")
@dataclass(frozen=True, eq=False)
class Fading(Memory):
    """Friction that wears off with its work."""

    rate: Parameter = field(metadata=positive("how fast it wears off", "length/force", 5.0))
    name: ClassVar[str] = "fading"

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(work=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        friction = parts.friction
        bound = np.asarray(friction.bound) * np.exp(-self.values()["rate"] * state["work"])
        return parts.with_parts(friction=Friction(bound, friction.profile, of=friction.of))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        slip = r[:, 1:] - step.before[:, 1:]
        return kept(work=state["work"] + np.abs((lam[:, 1:] * slip).sum(axis=1)))
'''
STRAIGHT = '''"""A linear material as a stored energy."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.named import LawKind, named
from hemivar.mechanics.material_words import PLANE_OF_ENERGY, PlaneState
from hemivar.mechanics.moduli import Number
from hemivar.mechanics.named_energies import NamedEnergy
from hemivar.mechanics.per_volume import constant
from hemivar.mechanics.stored_energy import Invariants, IsotropicBounds

__all__ = ["Straight"]


@named(LawKind.MATERIAL, "straight", "linear, as a stored energy", "W = bulk tr^2/2 + shear |dev eps|^2")
@dataclass(frozen=True, eq=False)
class Straight(NamedEnergy):
    """A linear material as a stored energy."""

    bulk: Number = field(metadata=constant("bulk modulus", example=6.5))
    shear: Number = field(metadata=constant("shear modulus", example=4.0))
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)
    kind = "straight"
    formula = "W = bulk tr^2/2 + shear |dev eps|^2"

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        bulk, shear = self.at(points)
        zero = np.zeros(p.shape)
        return Invariants(0.5 * bulk * p**2 + shear * s, bulk * p, shear + zero, bulk + zero, zero, zero)

    def bounds(self, points: Array) -> IsotropicBounds:
        bulk, shear = self.at(points)
        return IsotropicBounds(bulk, shear, bulk, shear)
'''
THETA = '''"""Stages at a part of the step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from hemivar.basics.stated import Form, stated
from hemivar.evolution.schemes.scheme import RateFormula, Scheme, StageRule
from hemivar.laws.named import LawKind, named

__all__ = ["Theta"]


@named(LawKind.SCHEME, "theta", "slow motion", "the balance at a part theta of the step")
@dataclass(frozen=True)
class Theta(Scheme):
    """Stages at a part of the step."""

    name: ClassVar[str] = "theta"
    order: ClassVar[int] = 1
    theta: float = field(default=0.6, metadata=stated(Form.NUMBER, least=0.5, most=1.0))

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        span = self.theta * step
        end = RateFormula(1.0 / span, 1.0 - 1.0 / self.theta)
        lifted, last_rate = RateFormula(1.0 / span**2, -1.0 / span), RateFormula(1.0 / (span * step), -1.0 / span)
        return (StageRule(self.theta, RateFormula(1.0 / span), lifted, 1.0 / self.theta, end, last_rate),)
'''
#: Files of a law of each kind, a memory, a material and a scheme.
FILES = {
    "laws/normal/hardening.py": HARDENING,
    "laws/friction/lubricated.py": DRY,
    "laws/coupled/peeling.py": PEELING,
    "laws/memory/fading.py": FADING,
    "mechanics/straight.py": STRAIGHT,
    "evolution/schemes/theta.py": THETA,
}
#: What asks all places that list laws.
ASKING = """
import json
import tomllib
from pathlib import Path

import hemivar as hv
from hemivar.basics.units import Units
from hemivar.laws import testing
from hemivar.studio.sliders import sliders_of
from hemivar.studio.toml_numbers import numbers_of
from tests.composition.cases import BESIDE, COUPLED, NORMALS
from tests.evolution.test_schemes_rules import SCHEMES
from tests.laws.catalogue import LAWS
from tests.laws.coupled.test_own_coupled import LAWS as COUPLED_LAWS
from tests.laws.memory.test_parts import EACH
from tests.laws.written import DOCS
from tests.mechanics.test_named_energies_by_hand import EVERY
from tests.robustness.seeds import SEEDS

law = hv.laws.Hardening(10.0, 0.05)
testing.check_law(law)
testing.check_vector_law(hv.laws.Peeling(0.5, 0.01).at(None), reach=0.04)
hv.materials.check_material(hv.materials.Straight(6.5, 4.0))
pages = {name: (DOCS / name).read_text() for name in ("laws.md", "problem-file.md", "evolution.md")}
text = Path("march.toml").read_text()
sliders = {one.label: one for one in sliders_of(tomllib.loads(text), numbers_of(text), Units())}
print(json.dumps({
    "derivative": law.derivative([0.05, 0.1]).tolist(),
    "stress": hv.materials.Straight(6.5, 4.0).describe().formula == "W = bulk tr^2/2 + shear |dev eps|^2",
    "scheme": hv.evolution.Theta(0.7).theta == 0.7,
    "memory": hv.laws.Fading(2.0).rate == 2.0,
    "friction": hv.laws.Lubricated(2.0).bound == 1.0,
    "catalogue": "hardening" in LAWS and "lubricated" in LAWS,
    "coupled catalogue": "peeling" in COUPLED_LAWS,
    "memories": "fading" in EACH,
    "energies": "straight" in EVERY,
    "schemes": "theta" in SCHEMES,
    "composition": "hardening" in NORMALS and "peeling" in COUPLED and "fading" in BESIDE,
    "seeds": "hardening" in SEEDS,
    "sliders": [sliders[key].meaning for key in ("normal.limit", "memory.0.rate", "bulk")],
    "laws.md": "`Hardening(stiffness, limit)`" in pages["laws.md"] and "`Lubricated(bound)`" in pages["laws.md"],
    "problem-file.md": [row for row in (
        '| `"hardening"` | springs that are twice as stiff beyond a penetration | `stiffness` > 0, `limit` > 0 |',
        '| `"lubricated"` | friction of at most half the bound | `bound` |',
        '| `"peeling"` | glue that fades with the square of its opening and slip | `energy` > 0, `width` > 0 |',
        '| `"fading"` | friction that wears off with its work | `rate` > 0 |',
        '| `"straight"` | linear, as a stored energy | `bulk`, `shear` |',
        '`{ name = "theta", theta = 0.6 }`',
    ) if row not in pages["problem-file.md"]] == [],
    "evolution.md": "| `Fading` | friction that wears off with its work |" in pages["evolution.md"]
    and "| `Theta(theta)` | 1 | slow motion | the balance at a part theta of the step |" in pages["evolution.md"],
}))
"""
FILE = """
mesh = { rectangle = [1.0, 1.0], cells = [4, 4] }
material = { law = "straight", bulk = 900.0, shear = 400.0 }
supports = { top = { displacement = [0.0, -0.1] }, left = "roller", right = "roller" }

[contact.bottom]
normal = { law = "hardening", stiffness = 10.0, limit = 0.05 }
friction = { law = "lubricated", bound = 0.1 }
"""
MARCH = """memory = [{ kind = "fading", rate = 2.0 }]

[time]
until = 0.2
step = 0.1
scheme = { name = "theta", theta = 0.7 }
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
    for file, text in FILES.items():
        (tmp_path / "src" / "hemivar" / file).write_text(text)
    (tmp_path / "plate.toml").write_text(FILE)
    (tmp_path / "march.toml").write_text(FILE + MARCH)
    glued = FILE.split("normal =")[0] + 'normal = { law = "peeling", energy = 0.5, width = 0.01 }\n'
    (tmp_path / "glued.toml").write_text(glued)
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
    meanings = ["penetration at which they harden", "how fast it wears off", "bulk modulus"]
    assert [said.partition(" (")[0] for said in answers.pop("sliders")] == meanings
    assert answers == dict.fromkeys(answers, True)
    laws = " ".join(run("-m", "hemivar", "laws").split())
    for summary in (
        "hardening: springs that are twice as stiff beyond a penetration",
        "lubricated: friction of at most half the bound",
        "peeling: glue that fades with the square of its opening and slip",
        "fading: friction that wears off with its work",
    ):
        assert summary in laws
    assert "straight: linear, as a stored energy" in run("-m", "hemivar", "materials")
    for command, name in (("solve", "plate"), ("solve", "glued"), ("march", "march")):
        run("-m", "hemivar", command, f"{name}.toml", "--json", f"{name}.json")
        assert ('"finished"' if name == "march" else '"converged"') in (tmp_path / f"{name}.json").read_text()
    run("-m", "pytest", "-q", "-n", "0", "tests/laws/test_nonmonotone.py", "-k", "hardening or lubricated")
    own = ("coupled/test_own_coupled.py", "memory/test_parts.py")
    run("-m", "pytest", "-q", "-n", "0", *(f"tests/laws/{name}" for name in own), "-k", "kit and peeling or fading")
    run("-m", "pytest", "-q", "-n", "0", "tests/mechanics/test_named_energies_by_hand.py", "-k", "itself and straight")
    run("-m", "pytest", "-q", "-n", "0", "tests/evolution/test_schemes_rules.py", "-k", "with_mass")
