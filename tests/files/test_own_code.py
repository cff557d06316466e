"""Laws, frictions, memories and materials of the user's, which a problem file names and the user allows."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics import user_code
from hemivar.basics.content import digest_of
from hemivar.basics.user_code import load_file
from hemivar.errors import ProblemError
from hemivar.files.changes import Change
from hemivar.files.problem_file import parse_problem, parse_problem_file, problem_text, read_problem_file
from tests.problem_files import TRESCA, block_file

#: Laws as users write them; each does what one of the library's does.
LAWS = """
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.laws import Friction, Superpotential
from hemivar.laws.memory import Memory
from hemivar.laws.parameters import positive
from hemivar.laws.parametrised import NamedLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.mechanics.material_words import PLANE_OF_ENERGY, PlaneState
from hemivar.mechanics.named_energies import NamedEnergy
from hemivar.mechanics.per_volume import constant
from hemivar.mechanics.stored_energy import Invariants, IsotropicBounds

imported = Superpotential


@dataclass(frozen=True, eq=False)
class TwoSprings(NamedLaw):
    '''Two springs that push, the second from a penetration on.'''

    first: float = field(metadata=positive("stiffness of the first spring", "force/area/length"))
    second: float = field(default=40.0, metadata=positive("stiffness of both springs", "force/area/length"))
    limit: float = field(default=0.02, metadata=positive("penetration of the second", "length"))
    name: ClassVar[str] = "survey"  # of the library, which no file takes for it

    def _build(self, values):
        slopes = columns(np.zeros(1), values["first"], values["second"])
        return PiecewiseQuadratic(columns(np.zeros(1), values["limit"]), slopes, np.zeros((1, 2)), name=self.name)


@dataclass(frozen=True, eq=False)
class Silent(NamedLaw):
    '''One spring; its fields say nothing.'''

    stiffness: float
    name: ClassVar[str] = "silent"

    def _build(self, values):
        if self.stiffness == 13.0:
            raise ZeroDivisionError("thirteen")
        return PiecewiseQuadratic(np.zeros((1, 1)), columns(0.0, values["stiffness"]), np.zeros((1, 1)), name=self.name)

    def __post_init__(self):
        if self.stiffness == 12.0:
            raise KeyError("twelve")


@dataclass(frozen=True, eq=False)
class Dry(NamedLaw):
    '''The size of the slip, times a factor.'''

    factor: float = 1.0
    name: ClassVar[str] = "dry"

    def _build(self, values):
        jump = 2.0 * columns(values["factor"])
        return PiecewiseQuadratic(np.zeros((1, 1)), np.zeros((1, 2)), jump, start=-0.5 * jump[:, 0], name=self.name)


@dataclass(frozen=True, eq=False)
class Bounded(NamedLaw):
    bound: float = 1.0
    _build = TwoSprings._build


class Half(Superpotential):
    pass


@dataclass(frozen=True, eq=False)
class Plain(NamedEnergy):
    '''An isotropic linear material as a stored energy.'''

    bulk: float = field(metadata=constant("bulk modulus"))
    shear: float = field(metadata=constant("shear modulus"))
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)
    kind = "plain"
    formula = "W = bulk tr^2/2 + shear |dev|^2"

    def invariants(self, points, p, s):
        bulk, shear = self.at(points)
        zero = np.zeros(p.shape)
        return Invariants(0.5 * bulk * p**2 + shear * s, bulk * p, shear + zero, bulk + zero, zero, zero)

    def bounds(self, points):
        bulk, shear = self.at(points)
        return IsotropicBounds(bulk, shear, bulk, shear)


def make():
    raise RuntimeError("called")


class Outer:
    class Inner(TwoSprings):
        pass


class _Raises:
    @property
    def __class__(self):
        raise RuntimeError("asked")


thing = _Raises()


def __getattr__(name):
    raise RuntimeError("looked up")
"""


@pytest.fixture
def code(tmp_path: Path) -> Iterator[list[str]]:
    (tmp_path / "ownlaws.py").write_text(LAWS)
    path = list(sys.path)
    yield [str(tmp_path / "ownlaws.py")]
    assert sys.path == path
    sys.modules.pop("ownlaws", None)


def on_law(normal: str = "{ law = 'ownlaws:TwoSprings', first = 10.0 }", friction: str = TRESCA) -> str:
    return block_file(4, normal=normal, friction=friction)


def test_a_law_solves_as_its_table(code: list[str]) -> None:
    own = parse_problem(on_law(), code=code)
    table = "penetrations = [-1, 0, 0.02, 1.02], pressures = [0, 0, 0.2, 40.2]"
    known = parse_problem(on_law(f"{{ law = 'pressure-table', {table} }}"))
    assert np.allclose(hv.solve(own).displacement, hv.solve(known).displacement, rtol=0, atol=1e-9)
    assert hv.solve(own).certify().kind is not None


@pytest.mark.parametrize(
    ("normal", "friction", "known"),
    [
        ("{ law = 'ownlaws:Silent', stiffness = 30.0 }", TRESCA, on_law("{ law = 'compliance', stiffness = 30 }")),
        (
            "'signorini'",
            "{ law = 'ownlaws:Dry', factor = 0.5, bound = '0.3 + 0.1*x' }",
            on_law("'signorini'", "{ law = 'tresca', bound = '0.15 + 0.05*x' }"),
        ),
        (
            "{ law = 'compliance', stiffness = 30 }",
            "{ law = 'ownlaws:Dry', bound = { coulomb = 0.3 } }",
            on_law("{ law = 'compliance', stiffness = 30 }", "{ law = 'coulomb', coefficient = 0.3 }"),
        ),
    ],
)
def test_normal_laws_and_profiles_do_what_the_librarys_do(
    code: list[str], normal: str, friction: str, known: str
) -> None:
    own = hv.solve(parse_problem(on_law(normal, friction), code=code))
    assert np.allclose(own.displacement, hv.solve(parse_problem(known)).displacement, rtol=0, atol=1e-8)


def test_a_material_is_the_linear_one_that_it_states(code: list[str]) -> None:
    own_table = f"law = 'ownlaws:Plain'\nbulk = {4.0 + 8.0 / 3.0}\nshear = 4.0\ndensity = 2.0"
    own = parse_problem(on_law().replace("lame = [4.0, 4.0]", own_table), code=code)
    linear = parse_problem(on_law(), code=code)
    assert np.allclose(hv.solve(own).displacement, hv.solve(linear).displacement, rtol=0, atol=1e-8)
    assert problem_text(own) == problem_text(parse_problem(problem_text(own), code=code))
    assert 'law = "ownlaws:Plain"' in problem_text(own)


SPRING = "{ law = 'ownlaws:Silent', stiffness = 30.0 }"
REGIONS = """
[mesh.lower]
rectangle = [1.0, 1.0]
cells = [2, 2]
[mesh.upper]
rectangle = [1.0, 1.0]
cells = [2, 2]
origin = [0.0, 1.0]
[material.regions.lower]
law = "ownlaws:Plain"
bulk = 6.0
shear = 4.0
[material.regions.upper]
lame = [4.0, 4.0]
[supports]
"upper:top" = "clamped"
[contact."lower:bottom"]
normal = "signorini"
"""
MEMBRANE = """
kind = "membrane"
[mesh]
rectangle = [1.0, 1.0]
cells = [2, 2]
[material]
tension = 1.0
[supports]
left = 0.0
[area]
normal = {}
"""
HEAT = """
[time]
until = 1.0
step = 0.5
[heat]
conductivity = 1.0
capacity = 1.0
[heat.contact.bottom]
exchange = {}
"""


@pytest.mark.parametrize("text", [
    on_law("'signorini'") + f"damping = {SPRING}\n", REGIONS, MEMBRANE.format(SPRING),
    on_law("'signorini'") + HEAT.format(SPRING),
])  # fmt: skip
def test_every_table_that_names_a_law(code: list[str], text: str, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="is code of your own"):
        parse_problem(text)
    stated = parse_problem_file(text, tmp_path, code=code)
    again = parse_problem_file(problem_text(stated), tmp_path, code=code)
    assert problem_text(again) == problem_text(stated)
    assert "ownlaws:" in problem_text(stated)


def test_a_memory_marches_as_in_python() -> None:
    text = on_law("{ law = 'compliance', stiffness = 30 }", "{ law = 'tresca', bound = 0.05, of = 'rate' }")
    text += "memory = [{ kind = 'tests.stranger:Fading', rate = 3.0 }]\n"
    with pytest.raises(ProblemError, match=r"memory\[0\].kind: 'tests.stranger:Fading' is code of your own"):
        parse_problem(text)
    problem = parse_problem(text, code=["tests.stranger"])
    (remembered,) = problem.contact["bottom"].memory
    assert (type(remembered).__name__, remembered.rate) == ("Fading", 3.0)  # type: ignore[attr-defined]
    assert tomllib.loads(problem_text(problem))["contact"]["bottom"]["memory"] == [
        {"kind": "tests.stranger:Fading", "rate": 3.0}
    ]
    assert hv.march(hv.Evolution(problem, inertia=False), 0.2, step=0.1).ended == "finished"


def test_written_files_give_back_name_and_values(code: list[str], tmp_path: Path) -> None:
    text = on_law("{ law = 'ownlaws:TwoSprings', first = '10 + x', limit = 0.03 }", "'ownlaws:Dry'")
    problem = parse_problem(text, code=code)
    path = hv.write_problem(problem, tmp_path / "p.toml")
    contact = tomllib.loads(path.read_text())["contact"]["bottom"]
    assert contact["normal"] == {"law": "ownlaws:TwoSprings", "first": "10 + x", "limit": 0.03}
    assert contact["friction"] == "ownlaws:Dry"
    again = hv.read_problem(path, code=code)
    assert problem_text(again) == problem_text(problem)
    with pytest.raises(ProblemError, match="code of your own"):
        hv.read_problem(path)


def test_a_law_that_no_file_can_name_is_not_written(code: list[str]) -> None:
    laws = load_file(Path(code[0]))
    problem = parse_problem(on_law(), code=code)
    inner = hv.Contact(laws.Outer.Inner(10.0))
    with pytest.raises(ProblemError, match=r"which a problem file cannot express; it can express .* classes of a m"):
        problem_text(hv.ContactProblem(problem.mesh, problem.material, {"bottom": inner}, problem.supports))


@pytest.mark.parametrize(
    ("name", "allowed", "why"),
    [
        ("os:system", [], "is code of your own, which runs when it is read; if you trust it, add --allow-code os or"),
        ("os:system", ["os"], "'os:system' is not a class of the module 'os'; name a class"),
        ("builtins:eval", ["builtins"], "is not a class"),
        (
            "builtins:dict",
            ["builtins"],
            "is not a class of a normal law; give one derived from Superpotential or VectorLaw",
        ),
        ("os.path:join", ["os"], "add --allow-code os.path, in Python code="),
        ("../x:Y", [], "'../x:Y' names no class; write module:Class"),
        ("/tmp/x.py:Y", [], "names no class; write module:Class"),
        ("ownlaws:", [], "names no class"),
        ("ownlaws:Outer.Inner", [], "names no class"),
        ("a:b:c", [], "names no class"),
        ("no_such_module:Law", ["no_such_module"], "there is no module 'no_such_module'; install it, or allow its f"),
        ("ownlaws:make", None, "is not a class"),
        ("ownlaws:thing", None, "is not a class"),
        ("ownlaws:Nothing", None, "is not a class"),
        ("ownlaws:Half", None, "is abstract and cannot be made; supply "),
        ("ownlaws:Plain", None, "is not a class of a normal law"),
        ("ownlaws:imported", None, "is the library's own; give its own name, as 'hemivar laws' lists it"),
        ("tests.files.test_own_code:Path", ["tests.files.test_own_code"], "is only imported there; name it as pathlib"),
    ],
)
def test_names_that_are_refused(code: list[str], name: str, allowed: list[str] | None, why: str) -> None:
    with pytest.raises(ProblemError) as caught:
        parse_problem(on_law(f"{{ law = '{name}', first = 10.0 }}"), code=code if allowed is None else allowed)
    assert str(caught.value).startswith(f"problem: [contact.bottom] normal.law: '{name}'") or "there is no" in why
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{ law = 'ownlaws:TwoSprings' }", "first: is missing (stiffness of the first spring); write normal = { law"),
        ("{ law = 'ownlaws:TwoSprings', first = -1 }", "normal.first: is -1; it must be at least 0"),
        ("{ law = 'ownlaws:TwoSprings', first = 0 }", "first of law 'survey' is 0; it must be positive"),
        ("{ law = 'ownlaws:TwoSprings', first = 1, third = 2 }", "unknown key; remove it (known here: law, first, se"),
        ("{ law = 'ownlaws:Silent', stiffness = '1 + x' }", "normal.stiffness: must be a number, not the text"),
        ("{ law = 'ownlaws:Silent' }", "normal.stiffness: is missing (a number)"),
        ("{ law = 'ownlaws:Silent', stiffness = 12 }", "cannot be made of its values (KeyError: 'twelve')"),
    ],
)
def test_values_are_checked_as_those_of_the_library(code: list[str], text: str, why: str) -> None:
    with pytest.raises(ProblemError) as caught:
        hv.discretize(parse_problem(on_law(text), code=code))
    assert why in str(caught.value)


def test_friction_has_its_own_kind_of_class(code: list[str]) -> None:
    with pytest.raises(ProblemError, match="its parameter 'bound' is one that every friction has; rename it"):
        parse_problem(on_law("'signorini'", "'ownlaws:Bounded'"), code=code)
    with pytest.raises(ProblemError, match="is not a class of a friction law; give one derived from Superp"):
        parse_problem(on_law("'signorini'", "'ownlaws:Plain'"), code=code)
    with pytest.raises(ProblemError, match="law 'survey' is not even"):
        parse_problem(on_law("'signorini'", "{ law = 'ownlaws:TwoSprings', first = 1.0 }"), code=code)


@pytest.mark.parametrize(
    ("allowed", "why"),
    [
        (["./own-laws.py"], "is neither a module nor a Python file"),
        (["./ownlaws"], "is neither a module nor a Python file"),
        (["own laws"], "is neither a module nor a Python file"),
        (["a/ownlaws.py", "b/ownlaws.py"], "'a/ownlaws.py' and 'b/ownlaws.py' have one name; rename one"),
        (["./ownlaws.py"], "allowed code 'ownlaws.py': there is no such file"),
        ("ownlaws", "code is 'ownlaws'; give a list of modules and files"),
    ],
)
def test_code_that_makes_no_sense(
    allowed: list[str], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ProblemError) as caught:
        parse_problem(on_law(), code=allowed)
    assert why in str(caught.value)


@pytest.mark.parametrize(("text", "why"), [
    ("1/0", "the module 'broken' cannot be imported (ZeroDivisionError: division by zero); correct it"),
    ("import no_such_helper", "cannot be imported (ModuleNotFoundError: No module named 'no_such_helper')"),
    ("raise SystemExit(3)", "cannot be imported (SystemExit: 3)"),
    ("def", "cannot be imported (SyntaxError"),
])  # fmt: skip
def test_a_file_that_cannot_be_imported(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "broken.py"
    file.write_text(text)
    with pytest.raises(ProblemError) as caught:
        parse_problem(on_law("'broken:Law'"), code=[str(file)])
    assert why in str(caught.value)
    assert "broken" not in sys.modules


def test_a_file_never_takes_the_name_of_another_module(tmp_path: Path) -> None:
    for name in ("json", "antigravity"):  # one that is loaded, and one that could be
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('run')")
        with pytest.raises(ProblemError, match=f"has the name of another module, '{name}'; rename the file"):
            parse_problem(on_law(f"'{name}:Law'"), code=[str(tmp_path / f"{name}.py")])


def test_nothing_is_run_that_is_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(user_code, "_installed", lambda: pytest.fail("packages are looked for"))
    file = tmp_path / "harmful.py"
    file.write_text("raise RuntimeError('run')")
    parse_problem(block_file(2), code=[str(file)])
    with pytest.raises(ProblemError, match="code of your own"):
        parse_problem(on_law("'harmful:Law'"), base_dir=tmp_path)  # beside the file, and not allowed


def test_changes_and_digests(code: list[str], tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(block_file(2))
    change = [Change("contact.bottom.normal", {"law": "ownlaws:TwoSprings", "first": 10.0})]
    with pytest.raises(ProblemError, match="code of your own"):
        read_problem_file(path, change)
    law = read_problem_file(path, change, code=code).problem.contact["bottom"].normal
    (tmp_path / "otherlaws.py").write_text(LAWS)
    other = load_file(tmp_path / "otherlaws.py").TwoSprings(10.0)
    sys.modules.pop("otherlaws")
    same = type(law)(10.0)
    assert digest_of(law) == digest_of(same) != digest_of(other)
    assert digest_of(law) != digest_of(type(law)(11.0))


SCRIPT = """
import sys
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem, problem_text
text = open("p.toml").read()
for name in ("two-springs", "twice", "broken", "odd"):
    try:
        problem = parse_problem(text.replace("survey", name))
    except ProblemError as error:
        print(error)
    else:
        print([line for line in problem_text(problem).splitlines() if name in line][0])
print(type(parse_problem(text).contact["bottom"].normal).__name__)
"""


def test_names_of_packages(code: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    load_file(Path(code[0]))
    given = {"own": {"mine": "ownlaws:Silent"}, "twice": {"mine": "ownlaws:Silent", "other": "ownlaws:Dry"}}
    given |= {"survey": {"mine": "ownlaws:Silent"}}
    monkeypatch.setattr(user_code, "_installed", lambda: given)
    problem = parse_problem(on_law("{ law = 'own', stiffness = 30 }"))
    assert tomllib.loads(problem_text(problem))["contact"]["bottom"]["normal"] == {"law": "own", "stiffness": 30.0}
    with pytest.raises(ProblemError, match="'twice' is a name that the packages 'mine' and 'other' give; remove one"):
        parse_problem(on_law("{ law = 'twice', stiffness = 30 }"))
    assert type(parse_problem(block_file(2)).contact["bottom"].normal).__name__ == "ThresholdCompliance"


@pytest.mark.slow
def test_installed_packages_name_their_laws(tmp_path: Path) -> None:
    (tmp_path / "ownlaws.py").write_text(LAWS)
    for package, lines in (
        ("springs", "two-springs = ownlaws:TwoSprings\ntwice = ownlaws:TwoSprings\nsurvey = ownlaws:TwoSprings"),
        ("glues", "twice = ownlaws:Silent\nbroken = no_such_module:Law\nodd = ownlaws"),
    ):
        folder = tmp_path / f"{package}-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (folder / "entry_points.txt").write_text(f"[hemivar.laws]\n{lines}\n")
    (tmp_path / "p.toml").write_text(block_file(2, normal="{ law = 'survey', q_max = 10.0 }"))
    script = SCRIPT.replace('replace("survey", name)', 'replace("survey", name).replace("q_max", "first")')
    run = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120
    )
    solved, twice, broken, odd, ours = run.stdout.splitlines()
    assert solved == 'normal = { law = "two-springs", first = 10.0 }'
    assert "'twice' is a name that the packages 'glues' and 'springs' give; remove one of them" in twice
    assert "there is no module 'no_such_module'" in broken
    assert "'ownlaws' names no class; its package must write module:Class" in odd
    assert ours == "ThresholdCompliance"
    listed = subprocess.run(
        [sys.executable, "-m", "hemivar", "laws"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120
    )
    own, _, installed = " ".join(listed.stdout.split()).partition("laws of installed packages ")
    assert own.count("survey: ") == 1
    assert "survey" not in installed
    assert "two-springs (package springs): Two springs that push, the second from a penetration on." in installed
    assert 'normal = { law = "two-springs", first = ... } first stiffness of the first spring' in installed
    assert "twice: 'twice' is a name that the packages 'glues' and 'springs' give; remove one of them" in installed
    assert "broken: there is no module 'no_such_module'" in installed
