"""What problem files say about time: read as the library means it, written back to the last digit, refused in words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.fem.dynamics import body_family
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import ProblemFile, parse_problem, parse_problem_file, read_problem_file, write_problem
from hemivar.files.settings import OutputSettings, TimeSettings
from hemivar.formula import Formula, FormulaArray
from hemivar.laws.memory import MemoryChain, Secant
from hemivar.laws.registry import MEMORIES
from hemivar.mechanics.moduli import Moduli
from hemivar.mesh import Mesh, rectangle
from hemivar.mesh.write import msh_text

PARTS = {
    "mesh": "rectangle = [1.0, 1.0]\ncells = [4, 4]",
    "material": "lame = [4.0, 4.0]",
    "supports": 'left = "clamped"',
    "contact.bottom": 'normal = "signorini"',
}


def text_of(**changes: str) -> str:
    parts = PARTS | {name.replace("__", "."): text for name, text in changes.items()}
    return "\n".join(f"[{name}]\n{text}" for name, text in parts.items())


def read(**changes: str) -> ProblemFile:
    return parse_problem_file(text_of(**changes))


FULL = """\
title = "everything that time asks for"
[mesh]
rectangle = [2.0, 1.0]
cells = [4, 2]
[material]
lame = [4.0, "4 + x"]
density = "1 + 0.1 * y"
viscosity = [0.1, "0.2 + x"]
branches = [
    { lame = [2.0, "1 + y"], time = 0.5 },
    { young = 3.0, poisson = 0.25, time = 0.1 },
    { tensor = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, "1 + x"]], time = 2.0 },
]
[loads]
body = ["0.1 * t", -0.5]
traction = { right = ["0", "-2 * min(t, 1)"] }
pressure = { top = "0.1 * t * x" }
bedding = "0.5 + x"
[supports]
left = { x = "0.01 * t", y = 0.0 }
[contact.bottom]
normal = { law = "compliance", stiffness = "2 + t" }
friction = { law = "coulomb", coefficient = "0.1 + 0.1 * t" }
gap = "0.1 * t * x"
damping = { law = "compliance", stiffness = "1 + t" }
[time]
until = 2.0
scheme = { name = "generalized-alpha", rho = 0.8 }
step = { rtol = 1e-3, first = 1e-3, max = 0.05 }
inertia = true
initial = { displacement = [0.0, "0.1 * x"], velocity = [0.0, -1.0] }
jump = "stop"
stops = [0.1, 1.5]
[output]
every = 0.01
fields = "run.pvd"
animation = "run.mp4"
table = "run.csv"
checkpoint = { file = "run.ckpt", minutes = 10 }
probes = { tip = [1.0, 1.0] }
"""


def test_what_is_read_is_what_the_library_states() -> None:
    """Python's own statement of the same: equal in every part."""
    found = parse_problem_file(FULL)
    material = hv.Material.lame(
        4.0,
        Formula("4 + x"),
        density=Formula("1 + 0.1 * y"),
        viscosity=(0.1, Formula("0.2 + x")),
        branches=[
            hv.materials.Branch(lame=(2.0, Formula("1 + y")), time=0.5),
            hv.materials.Branch(young=3.0, poisson=0.25, time=0.1),
            hv.materials.Branch(
                tensor=FormulaArray((2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, Formula("1 + x")), (3, 3)), time=2
            ),
        ],
    )
    problem = hv.ContactProblem(
        mesh=rectangle((2.0, 1.0), (4, 2)),
        material=material,
        contact={
            "bottom": hv.Contact(
                hv.Compliance(Formula("2 + t")),
                hv.Tresca(hv.laws.CoulombBound(Formula("0.1 + 0.1 * t"))),
                gap=Formula("0.1 * t * x"),
                damping=hv.Compliance(Formula("1 + t")),
            )
        },
        supports={"left": hv.Fixed(x=Formula("0.01 * t"), y=0.0)},
        body_force=FormulaArray((Formula("0.1 * t"), -0.5), (2,)),
        tractions={
            "right": FormulaArray((0.0, Formula("-2 * min(t, 1)")), (2,)),
            "top": hv.Pressure(Formula("0.1 * t * x")),
        },
        title="everything that time asks for",
        bedding=Formula("0.5 + x"),
    )
    assert difference(problem, found.problem) is None
    assert found.problem.time_dependent == {"load", "supports", "gap", "law"}
    march = hv.evolution.March(
        2.0,
        hv.evolution.GeneralizedAlpha(0.8),
        hv.evolution.AdaptiveStep(1e-3, 1e-3, None, 0.05),
        hv.evolution.Save(0.01, probes={"tip": (1.0, 1.0)}),
        stops=(0.1, 1.5),
        jump="stop",
        checkpoint=hv.evolution.Checkpoint(Path("run.ckpt"), 10.0),
    )
    start = {"displacement": FormulaArray((0.0, Formula("0.1 * x")), (2,)), "velocity": np.array([0.0, -1.0])}
    assert difference(TimeSettings(march, True, start), found.time) is None
    assert difference(OutputSettings("run.pvd", "run.mp4", "run.csv"), found.output) is None


def round_trip(text: str, folder: Path) -> str:
    (folder / "given.toml").write_text(text, encoding="utf-8")
    given = read_problem_file(folder / "given.toml")
    written = write_problem(given, folder / "written.toml")
    found = read_problem_file(written)
    for part in ("problem", "solver", "time", "output"):
        assert difference(getattr(given, part), getattr(found, part)) is None
    again = write_problem(found, folder / "again.toml").read_text(encoding="utf-8")
    assert written.read_text(encoding="utf-8") == again
    return again


def test_everything_comes_back(tmp_path: Path) -> None:
    round_trip(FULL, tmp_path)
    given, found = (
        parse_problem((tmp_path / name).read_text(encoding="utf-8")) for name in ("given.toml", "again.toml")
    )
    one, other = (body_family(problem.at_time(0.7)) for problem in (given, found))
    for name in ("stiffness", "viscosity", "mass"):
        np.testing.assert_array_equal(getattr(one, name).inner.data, getattr(other, name).inner.data)
    for (time, branch), (again, other_branch) in zip(one.branches, other.branches, strict=True):
        assert time == again
        np.testing.assert_array_equal(branch.inner.data, other_branch.inner.data)


@pytest.mark.parametrize(
    "changes",
    [
        {"material": "lame = [4.0, 4.0]\nviscosity = [0, 0]"},
        {"material": "young = 4.0\npoisson = 0.3\nplane = 'stress'\ndensity = 2\nviscosity = [0.4, 0.4]"},
        {"material": "lame = [4.0, 4.0]\nviscosity = [[1, 0, 0], [0, '1 + x', 0], [0, 0, 0]]"},
        {"material": "tensor = [[2,0,0],[0,2,0],[0,0,1]]\ndensity = '1 + x'\nbranches = [{lame = [1, 1], time = 1}]"},
        {"material": "lame = [4.0, 4.0]\n[[material.branches]]\nlame = [1, 2]\ntime = 3"},
        {"loads": "bedding = 2.0"},
        {"loads": "bedding = '2 + sin(x)'"},
        {"time": "until = 1\nstep = 0.1"},
        {"time": "until = 1e3\nscheme = 'implicit-euler'"},
        {"time": "until = 1\nstops = [0.25, 0.5]"},
        {"time": "until = 1\nscheme = { name = 'midpoint', conserving = true }"},
        {"time": "until = 1\nscheme = { name = 'midpoint' }\nstep = { rtol = 1e-3 }\njump = 'global'"},
        {"time": "until = 1\ninitial = { displacement = ['x', 0.1] }", "output": "probes = { 'a b' = [1, 0.5] }"},
        {"time": "until = 1", "output": "checkpoint = 'run.ckpt'\nfields = 'a.pvd'\nanimation = 'a.gif'"},
        {"contact__bottom": 'normal = "signorini"\ndamping = "signorini"'},
        {"contact__bottom": 'normal = "signorini"\nmemory = [{ kind = "secant" }, { kind = "slip-sum" }]'},
        {"contact__bottom": 'normal = "signorini"\ndamping = { law = "formula", potential = "r^2" }'},
    ],
    ids=str,
)
def test_parts_come_back(changes: Mapping[str, str], tmp_path: Path) -> None:
    round_trip(text_of(**changes), tmp_path)


def test_regions_have_their_own(tmp_path: Path) -> None:
    plain = rectangle((2.0, 1.0), (4, 2))
    left = np.flatnonzero(plain.points[plain.cells].mean(axis=1)[:, 0] < 1.0)
    right = np.setdiff1d(np.arange(plain.number_of_cells), left)
    mesh = Mesh(plain.points, plain.cells, plain.boundaries, {"left": left, "right": right})
    (tmp_path / "two.msh").write_text(msh_text(mesh), encoding="utf-8")
    text = (
        '[mesh]\nfile = "two.msh"\n[material.regions.left]\nlame = [1, 1]\ndensity = 2\n'
        "[material.regions.right]\nlame = [2, 2]\ndensity = 3\nviscosity = [1, 1]\n"
        "branches = [{lame = [1, 1], time = 2}]\n"
    )
    round_trip(text, tmp_path)
    found = read_problem_file(tmp_path / "given.toml").problem
    assert found.material.relaxation_times == (2.0,)
    mass = body_family(found).mass
    assert mass is not None
    assert mass.inner.sum() == pytest.approx(2.0 * (2.0 + 3.0))
    (tmp_path / "given.toml").write_text(text.replace("density = 2\n", ""), encoding="utf-8")
    with pytest.raises(ProblemError, match=r"\[material\] regions: .*region 'left' has no density"):
        read_problem_file(tmp_path / "given.toml")


def test_a_static_file_has_neither() -> None:
    found = read()
    assert found.time is None
    assert found.output == OutputSettings()


def test_a_static_file_becomes_an_evolution_by_its_time() -> None:
    found = read(time="until = 1.0")
    assert difference(found.problem, read().problem) is None
    assert found.time == found.time
    assert found.time is not None
    assert found.time.march.until == 1.0
    assert not found.time.inertia


def test_statics_refuses_a_file_with_time() -> None:
    with pytest.raises(ProblemError, match=r"a load of the problem depends on time; take the problem at one time"):
        hv.discretize(read(loads="body = ['t', 0]").problem)
    hv.discretize(read(loads="body = ['x', 0]", time="until = 1").problem)


def test_python_functions_of_time_are_refused(tmp_path: Path) -> None:
    problem = read().problem
    moving = hv.ContactProblem(problem.mesh, problem.material, body_force=lambda x, t: t * x)
    for stated in (moving, moving.at_time(1.0)):
        with pytest.raises(
            ProblemError, match=r"body_force is the Python function .*, which a problem file cannot express"
        ):
            write_problem(stated, tmp_path / "p.toml")


def test_every_memory_comes_back(tmp_path: Path) -> None:
    """With parameters as numbers, and as formulas."""
    for name, entry in MEMORIES.items():
        for values in ("0.5", "'0.5 + 0.1 * x'"):
            given = "".join(f", {part.name} = {values}" for part in entry.parameters)
            contact = f'normal = "compliance"\nmemory = [{{ kind = "{name}"{given} }}]'.replace(
                '"compliance"', '{ law = "compliance", stiffness = 1 }'
            )
            round_trip(text_of(contact__bottom=contact), tmp_path)
            (memory,) = read_problem_file(tmp_path / "given.toml").problem.contact["bottom"].memory
            assert type(memory) is entry.build
            at = memory.at(np.array([[0.0, 0.0], [1.0, 0.0]]))
            for part in entry.parameters:
                value = np.broadcast_to(getattr(at, part.name), 2)
                np.testing.assert_allclose(value, [0.5, 0.5 if values == "0.5" else 0.6])


def test_memories_of_ones_own_are_refused(tmp_path: Path) -> None:
    problem = read().problem
    contact = hv.Contact(hv.Signorini(), memory=(MemoryChain((Secant(),)),))
    stated = hv.ContactProblem(problem.mesh, problem.material, {"bottom": contact})
    with pytest.raises(ProblemError, match=r"contact\['bottom'\].memory\[0\] is a MemoryChain.*memories of the kinds"):
        write_problem(stated, tmp_path / "p.toml")


def test_moduli_are_what_the_keyword_means() -> None:
    stated = hv.Material.lame(1, 1, viscosity=(1.0, 2.0)).viscosity  # type: ignore[attr-defined]
    assert difference(Moduli((1.0, 2.0), None, False, "viscosity"), stated) is None
    assert difference(Moduli((1.0, 2.5), None, False, "viscosity"), stated) == "constants"


ONE = "lame = [4.0, 4.0]\n"
CONTACT = 'normal = "signorini"\n'
#: What is wrong, and the words that say so.
BAD: dict[str, tuple[dict[str, str], str]] = {
    "density zero": ({"material": ONE + "density = 0"}, r"\[material\] density: is 0; it must be greater than 0"),
    "density formula": ({"material": ONE + "density = 'x - 5'"}, r"\[material\] density = .*; it must be positive"),
    "density text": ({"material": ONE + "density = 'much'"}, "density: formula 'much'.*'much' is not known"),
    "density list": ({"material": ONE + "density = [1, 2]"}, "density: must be a number or a formula"),
    "density of t": (
        {"material": ONE + "density = 't'"},
        "density: formula 't' uses t, but this cannot change with time",
    ),
    "elasticity of t": ({"material": "lame = [4.0, '4 + t']"}, r"lame: formula '4 \+ t' uses t, but this cannot"),
    "viscosity number": ({"material": ONE + "viscosity = 1"}, "viscosity: must be two numbers or formulas.*number 1"),
    "viscosity of three": ({"material": ONE + "viscosity = [1, 2, 3]"}, r"\[material\] viscosity: must be 3 lists"),
    "viscosity negative": ({"material": ONE + "viscosity = [0, -1]"}, r"viscosity.*mu = -1; it must not be negative"),
    "viscosity formula": ({"material": ONE + "viscosity = [0, '0.1 - x']"}, r"\[material\] viscosity: mu = -.* at x ="),
    "viscosity matrix": (
        {"material": ONE + "viscosity = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]"},
        "viscosity matrix is not positive semidefinite",
    ),
    "branches table": ({"material": ONE + "branches = { time = 1 }"}, "branches: must be a list of tables, such as"),
    "branches numbers": ({"material": ONE + "branches = [1]"}, "branches: must be a list of tables"),
    "branch without time": ({"material": ONE + "branches = [{ lame = [1, 1] }]"}, r"branches\[0\].time: is missing"),
    "branch time": (
        {"material": ONE + "branches = [{ lame = [1, 1], time = 1 }, { lame = [1, 1], time = 0 }]"},
        r"branches\[1\].time: is 0; it must be positive",
    ),
    "branch of nothing": ({"material": ONE + "branches = [{ time = 1 }]"}, "no elastic constants are given"),
    "branch of two": (
        {"material": ONE + "branches = [{ lame = [1, 1], young = 1, poisson = 0, time = 1 }]"},
        "lame and young are given",
    ),
    "branch poisson": ({"material": ONE + "branches = [{ young = 1, time = 1 }]"}, "poisson: goes with young"),
    "branch indefinite": (
        {"material": ONE + "branches = [{ lame = [-9, 1], time = 1 }]"},
        "branch: lam = -9; it must be",
    ),
    "branch key": (
        {"material": ONE + "branches = [{ lam = [1, 1], time = 1 }]"},
        r"branches\[0\].lam: unknown key; did",
    ),
    "bedding negative": ({"loads": "bedding = -1"}, r"\[loads\] bedding: is -1; it must be at least 0"),
    "bedding of t": ({"loads": "bedding = 't'"}, "bedding: formula 't' uses t"),
    "bedding vector": ({"loads": "bedding = [1, 1]"}, "bedding: must be a number or a formula"),
    "obstacle of t": (
        {"contact.bottom": CONTACT + "obstacle = { distance = 'y + t' }"},
        "formula 'y \\+ t' uses t, but",
    ),
    "damping friction": (
        {"contact.bottom": CONTACT + 'damping = { law = "tresca", bound = 1 }'},
        "damping.law: 'tresca' is a friction law; use it under friction",
    ),
    "damping unknown": ({"contact.bottom": CONTACT + 'damping = "dashpot"'}, "'dashpot' is not a normal law"),
    "damping number": ({"contact.bottom": CONTACT + "damping = 2"}, "damping: must be a law such as"),
    "damping key": (
        {"contact.bottom": CONTACT + 'damping = { law = "compliance", stifness = 2 }'},
        "damping.stifness: unknown key; did you mean 'stiffness'",
    ),
    "memory table": ({"contact.bottom": CONTACT + "memory = { kind = 'secant' }"}, "memory: must be a list such as"),
    "memory of text": ({"contact.bottom": CONTACT + "memory = ['secant']"}, "memory: must be a list of tables such as"),
    "memory without kind": ({"contact.bottom": CONTACT + "memory = [{}]"}, r"memory\[0\].kind: is missing"),
    "memory unknown": (
        {"contact.bottom": CONTACT + "memory = [{ kind = 'elephant' }]"},
        "kind: 'elephant' is not known",
    ),
    "time without until": ({"time": "step = 0.1"}, r"\[time\] until: is missing"),
    "until zero": ({"time": "until = 0"}, r"\[time\] until: is 0; it must be positive"),
    "until before": ({"time": "until = -1"}, "until: is -1; it must be positive"),
    "until infinite": ({"time": "until = inf"}, "until: is inf; give a finite number"),
    "until text": ({"time": "until = 'tomorrow'"}, "until: must be a number"),
    "step zero": ({"time": "until = 1\nstep = 0"}, r"\[time\] step: is 0; it must be positive"),
    "step long": ({"time": "until = 1\nstep = 2"}, "step: is 2, longer than the whole time 1"),
    "step text": ({"time": "until = 1\nstep = 'small'"}, "step: must be a number or { rtol = 1e-3, ... }"),
    "step true": ({"time": "until = 1\nstep = true"}, "step: must be a number or { rtol = 1e-3, ... }, not true"),
    "step without rtol": ({"time": "until = 1\nstep = { first = 0.1 }"}, "step.rtol: is missing"),
    "step rtol": ({"time": "until = 1\nstep = { rtol = 2 }"}, "step.rtol: is 2; it must be smaller than 1"),
    "step order": (
        {"time": "until = 1\nstep = { rtol = 0.1, min = 0.2, max = 0.1 }"},
        "step.min: is 0.2, more than max = 0.1",
    ),
    "step first": ({"time": "until = 1\nstep = { rtol = 0.1, first = 2 }"}, "step.first: is 2, longer than the whole"),
    "step key": ({"time": "until = 1\nstep = { rtol = 0.1, maxx = 2 }"}, "step.maxx: unknown key; did you mean 'max'"),
    "scheme unknown": ({"time": "until = 1\nscheme = 'eulr'"}, "scheme: 'eulr' is not known"),
    "scheme without name": ({"time": "until = 1\nscheme = { rho = 1 }"}, "scheme.name: is missing; write one of"),
    "scheme parameter": (
        {"time": "until = 1\nscheme = { name = 'generalized-alpha', rho = 2 }"},
        "scheme.rho: is 2; it must lie between 0 and 1",
    ),
    "scheme gamma": (
        {"time": "until = 1\nscheme = { name = 'newmark', gamma = 0.4 }"},
        "scheme.gamma: is 0.4; it must lie between 0.5 and 1",
    ),
    "scheme beta": (
        {"time": "until = 1\nscheme = { name = 'newmark', beta = 0.6 }"},
        "scheme.beta: is 0.6; it must lie between 0 and 0.5",
    ),
    "scheme unstable": (
        {"time": "until = 1\nscheme = { name = 'newmark', beta = 0.2, gamma = 0.5 }"},
        r"\[time\] scheme: Newmark\(beta=0.2, gamma=0.5\) is not stable",
    ),
    "scheme theta": (
        {"time": "until = 1\nscheme = { name = 'moreau-jean', theta = 0.4 }"},
        "scheme.theta: is 0.4; it must lie between 0.5 and 1",
    ),
    "scheme conserving": (
        {"time": "until = 1\nscheme = { name = 'midpoint', conserving = 1 }"},
        "scheme.conserving: must be true or false, not the number 1",
    ),
    "scheme foreign": (
        {"time": "until = 1\nscheme = { name = 'midpoint', rho = 1 }"},
        "scheme.rho: unknown key; remove it",
    ),
    "inertia without density": ({"time": "until = 1\ninertia = true"}, "inertia: needs a density; add density to"),
    "inertia number": ({"time": "until = 1\ninertia = 1"}, "inertia: must be true or false, not the number 1"),
    "sdirk2 with inertia": (
        {"material": ONE + "density = 1", "time": "until = 1\ninertia = true\nscheme = 'sdirk2'"},
        "scheme: 'sdirk2' is for bodies without inertia",
    ),
    "newmark without inertia": (
        {"time": "until = 1\nscheme = 'newmark'"},
        "scheme: 'newmark' is for bodies with inertia",
    ),
    "velocity without inertia": (
        {"time": "until = 1\ninitial = { velocity = [0, 1] }"},
        "initial.velocity: is given to bodies with inertia only",
    ),
    "initial of three": (
        {"time": "until = 1\ninitial = { displacement = [0, 1, 0] }"},
        "initial.displacement: has 3 entries; it must be a list of 2",
    ),
    "initial of t": (
        {"time": "until = 1\ninitial = { displacement = [0, 't'] }"},
        "formula 't' uses t, but this cannot",
    ),
    "initial key": ({"time": "until = 1\ninitial = { speed = [0, 1] }"}, "initial.speed: unknown key"),
    "stops": ({"time": "until = 1\nstops = 0.5"}, "stops: must be a list of times, not the number 0.5"),
    "stops late": ({"time": "until = 1\nstops = [0.5, 1.5]"}, "stops: names 1.5; give times between 0 and until = 1"),
    "stops text": ({"time": "until = 1\nstops = ['a']"}, "stops: must be"),
    "jump": ({"time": "until = 1\njump = 'high'"}, "jump: 'high' is not known"),
    "time key": ({"time": "untill = 1"}, r"\[time\] untill: unknown key; did you mean 'until'"),
    "output alone": ({"output": "every = 0.1"}, "output: says what is saved during time integration; add a table"),
    "every zero": ({"time": "until = 1", "output": "every = 0"}, "every: is 0; it must be positive"),
    "fields": (
        {"time": "until = 1", "output": "fields = 'run.png'"},
        "fields: is 'run.png'; give the name of a file that",
    ),
    "animation": ({"time": "until = 1", "output": "animation = '.gif'"}, "animation: is '.gif'"),
    "table": ({"time": "until = 1", "output": "table = 3"}, "table: must be a text, not the number 3"),
    "checkpoint": ({"time": "until = 1", "output": "checkpoint = ''"}, "checkpoint: is empty; write what it says"),
    "checkpoint minutes": (
        {"time": "until = 1", "output": "checkpoint = { file = 'a', minutes = -1 }"},
        "checkpoint.minutes: is -1; it must be at least 0",
    ),
    "checkpoint file": ({"time": "until = 1", "output": "checkpoint = { minutes = 1 }"}, "checkpoint.file: is missing"),
    "probe": (
        {"time": "until = 1", "output": "probes = { tip = [1] }"},
        "probes.tip: has 1 entries; it must be a list",
    ),
    "output key": ({"time": "until = 1", "output": "field = 'a.pvd'"}, "field: unknown key; did you mean 'fields'"),
    "key elsewhere": ({"material": ONE + "bedding = 1"}, r"bedding: unknown key; it belongs in \[loads\]"),
}


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(name: str) -> None:
    changes, words = BAD[name]
    parts = PARTS | changes
    text = "\n".join(f"[{table}]\n{part}" for table, part in parts.items())
    with pytest.raises(ProblemError, match=words) as caught:
        parse_problem_file(text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("problem: ")


@pytest.mark.parametrize(
    ("given", "control"), [('"dissipation"', "dissipation"), ('{ opening = "bottom" }', {"opening": "bottom"})]
)
def test_a_control_is_read_and_written_back(given: str, control: object, tmp_path: Path) -> None:
    stated = read(time=f"until = 1.0\nstep = 0.1\ncontrol = {given}")
    assert stated.time is not None
    assert stated.time.march.control == hv.evolution.March(1.0, control=control).control  # type: ignore[arg-type]
    write_problem(stated, tmp_path / "again.toml")
    again = read_problem_file(tmp_path / "again.toml")
    assert again.time is not None
    assert again.time.march.control == stated.time.march.control


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ('"disipation"', "did you mean 'dissipation'"),
        ("3", "must be .dissipation. or"),
        ("{ opening = 3 }", "must be a text"),
        ('{ slip = "bottom" }', "opening"),
        ("{}", "opening is missing|opening. is missing"),
    ],
)
def test_a_control_that_is_none_is_refused(given: str, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        read(time=f"until = 1.0\nstep = 0.1\ncontrol = {given}")
