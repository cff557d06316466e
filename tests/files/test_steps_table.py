"""The list [[steps]] of a problem file, read and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem_file, problem_text
from hemivar.files.snapshot import snapshot
from hemivar.formula import Formula
from hemivar.mechanics import Step
from hemivar.solvers.contact_states import NormalState

FILE = """
mesh = { rectangle = [100.0, 10.0], cells = [25, 1] }
material = { young = 70000.0, poisson = 0.0 }
supports = { bottom = "roller", top = "roller", left = { y = 0.0 } }
area.friction = { law = "tresca", bound = 2.0 }
[[steps]]
name = "pull"
loads.traction = { right = [120.0, 0.0] }
[[steps]]
name = "release"
loads.traction.right = [0.0, 0.0]
[[steps]]
name = "again"
ramp = false
loads = { traction = { right = [60.0, 0.0] }, stress = "0 * x" }
supports.left = { y = "0 * x" }
[output]
probes = { end = [100.0, 0.0] }
"""


def test_steps_of_a_file_are_those_of_python(tmp_path: Path) -> None:
    stated = parse_problem_file(FILE)
    assert [step.name for step in stated.problem.steps] == ["pull", "release", "again"]
    assert [step.ramp for step in stated.problem.steps] == [True, True, False]
    history = hv.march(hv.Evolution(stated.problem), save=stated.time.march.save if stated.time else None)
    steps = [
        Step("pull", tractions={"right": (120.0, 0.0)}),
        Step("release", tractions={"right": (0.0, 0.0)}),
        Step("again", tractions={"right": (60.0, 0.0)}),
    ]
    own = hv.ContactProblem(
        hv.rectangle((100.0, 10.0), (25, 1)), hv.Material.young(70000.0, 0.0),
        {"area": hv.Contact(hv.laws.NoContact(), hv.Tresca(2.0))}, {"bottom": "roller", "top": "roller"}, steps=steps,
    )  # fmt: skip
    far = int(np.argmax(own.mesh.points @ [1.0, -1.0]))
    there = [frame.displacement[far, 0] for frame in hv.march(hv.Evolution(own)).frames]
    assert history["end.u_x"] == pytest.approx(there, rel=1e-7)


def test_steps_are_written_and_read_again(tmp_path: Path) -> None:
    stated = parse_problem_file(FILE)
    text = problem_text(stated)
    assert problem_text(parse_problem_file(text)) == text
    steps = [
        Step("push", tractions={"top": hv.Pressure(Formula("1 + x"))}, body_force=(0.0, -1.0)),
        Step("hold", supports={"left": hv.Fixed(x=0.1)}, initial_stress=np.array([[1.0, 0.5], [0.5, 0.0]])),
        Step("rest", tractions={"top": hv.Pressure(0.0)}, body_force=0.0, initial_stress=0.0),
    ]
    mesh = hv.rectangle((1.0, 1.0), 2)
    problem = hv.ContactProblem(
        mesh, hv.Material.young(10.0, 0.3), {"bottom": hv.Contact(hv.Signorini())}, {"left": hv.Fixed(x=0.0)},
        steps=steps,
    )  # fmt: skip
    path = hv.write_problem(problem, tmp_path / "p.toml")
    read = hv.read_problem(path)
    assert repr(read.steps) == repr(problem.steps)
    one, other = hv.march(hv.Evolution(problem)), hv.march(hv.Evolution(read))
    assert np.array_equal(one.frames[-1].displacement, other.frames[-1].displacement)
    with pytest.raises(ProblemError, match="the Python function"):
        problem_text(hv.ContactProblem(
            mesh, hv.Material.young(10.0, 0.3), supports={"left": "clamped"},
            steps=[Step("a", body_force=lambda x: x), Step("b")],
        ))  # fmt: skip


def test_bolts_of_a_file_are_tightened_and_written() -> None:
    text = """
    mesh = { rectangle = [1.0, 1.0], cells = 4 }
    material = { young = 100.0, poisson = 0.0 }
    supports = { top = "clamped", left = "roller", right = "roller" }
    contact.bottom.normal = "bolt"
    steps = [{ name = "tighten", bolts.bottom = 2.0 }, { name = "work", supports.top.displacement = [0.0, 0.01] }]
    """
    text = text.replace('top = "clamped"', "top = { displacement = [0.0, 0.0] }")
    stated = parse_problem_file(text)
    assert stated.problem.steps[0].bolts == {"bottom": 2.0}
    again = parse_problem_file(problem_text(stated)).problem
    assert problem_text(again) == problem_text(stated)
    history = hv.march(hv.Evolution(again))
    assert -history["normal_force"] == pytest.approx([2.0, 3.0], rel=1e-9)  # the block is stretched by .01 more
    with pytest.raises(ProblemError, match=r"\[steps.0.bolts\] bottom: must be a number"):
        parse_problem_file(text.replace("bolts.bottom = 2.0", 'bolts.bottom = "tight"'))
    with pytest.raises(ProblemError, match="it tightens a bolt at 'left', where there is none"):
        parse_problem_file(text.replace("bolts.bottom", "bolts.left"))


@pytest.mark.parametrize("steps", [True, False])
def test_stresses_of_a_frame_are_those_of_its_time(steps: bool) -> None:
    """A body that cannot move has its initial stress, which changes from step to step, or with the time."""
    walls = dict.fromkeys(("left", "right", "top"), "clamped")
    given: dict[str, Any] = {"initial_stress": "t"}
    if steps:
        given = {"steps": [Step("one", initial_stress=1.0), Step("two", initial_stress=2.0)]}
    stated = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.0), {"bottom": hv.Contact(hv.laws.Bilateral())},
        walls, **given,
    )  # fmt: skip
    history = hv.march(hv.Evolution(stated, start=0.0 if steps else 1.0), until=2.0, step=1.0)
    for frame, stress in zip(history.frames, (1.0, 2.0), strict=True):
        kept = snapshot(history.discrete, frame)
        assert kept.problem.origin is not None
        found = hv.fem.stress(kept.problem.origin, frame.displacement)
        np.testing.assert_allclose(found, np.broadcast_to(stress * np.eye(2), found.shape), atol=1e-12)


def test_a_bolt_is_bonded_in_every_frame() -> None:
    stated = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.0), {"bottom": hv.Contact(hv.laws.Bolt())},
        {"top": hv.Fixed(y=0.0), "left": "roller"},
        steps=[Step("tighten", bolts={"bottom": 1.0}), Step("pull", supports={"top": hv.Fixed(y=0.1)})],
    )  # fmt: skip
    history = hv.march(hv.Evolution(stated))
    _, pulled = (snapshot(history.discrete, frame).states for frame in history.frames)
    assert set(pulled.normal.tolist()) == {NormalState.BONDED}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[output]", "[time]\nuntil = 1.0\n[output]", r"time: goes without steps, which have no duration"),
        ('name = "pull"', "", r"\[steps.0\] name: must be a text, not missing"),
        ("ramp = false", "ramp = 1", r"\[steps.2\] ramp: must be true or false"),
        ("ramp = false", "length = 1", r"\[steps.2\] length: unknown key"),
        ("loads.traction.right", "loads.bedding", r"\[steps.1.loads\] bedding: unknown key"),
        ("loads.traction.right", "loads.traction.lid", r"\[steps.1.loads\] traction.lid: the mesh has no boundary"),
        ('"0 * x"', '"t"', "something depends on t beside the steps"),
        ('"release"', '"pull"', "two steps are called 'pull'"),
    ],
)
def test_steps_of_files_that_make_no_sense_name_their_key(old: str, new: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        parse_problem_file(FILE.replace(old, new, 1))
    with pytest.raises(ProblemError, match="steps: must be a list of tables, not a table"):
        parse_problem_file("steps = {}\n" + FILE.partition("[[steps]]")[0])
