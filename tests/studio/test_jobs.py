"""What the studio answers: the library's own results, the picture before the certificate, the newest request first."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem import nodal_average
from hemivar.files.problem_file import parse_problem, parse_problem_file
from hemivar.files.sample import template
from hemivar.studio.badges import badge_of
from hemivar.studio.binary_message import Message, unpacked
from hemivar.studio.jobs import MOST_CELLS, Bench
from hemivar.studio.page_worker import Desk
from hemivar.studio.requests import Request
from hemivar.workflows.marching import evolution_of, plan_of

EXAMPLES = Path(__file__).parents[2] / "examples" / "problems"


def never() -> bool:
    return False


def answers(bench: Bench, kind: str, text: str, **more: object) -> list[Message]:
    """All messages to one request."""
    return list(bench.answer(Request(kind, 7, text, **more), never))  # type: ignore[arg-type]


def kinds(messages: list[Message]) -> list[object]:
    return [one.head["type"] for one in messages if one.head["type"] not in ("progress", "notice")]


def one(messages: list[Message], kind: str) -> Message:
    return next(message for message in messages if message.head["type"] == kind)


def test_a_message_comes_back_from_its_bytes() -> None:
    message = Message({"type": "x", "n": float("nan"), "t": "é"}, {"a": np.eye(2), "b": np.arange(3), "c": np.zeros(0)})
    head, arrays = unpacked(message.packed())
    assert (head["type"], head["n"], head["t"]) == ("x", None, "é")
    np.testing.assert_array_equal(arrays["a"], np.eye(2))
    np.testing.assert_array_equal(arrays["b"], [0, 1, 2])
    assert arrays["c"].size == 0


def test_the_picture_comes_before_the_certificate_and_the_shape_once() -> None:
    bench, text = Bench(Path()), template("survey")
    first = answers(bench, "solve", text)
    assert kinds(first) == ["problem", "shape", "picture", "certificate", "done"]
    key = str(one(first, "shape").head["key"])
    assert kinds(answers(bench, "solve", text, shape=key)) == ["problem", "picture", "certificate", "done"]


@pytest.mark.parametrize("first", ["true", "false"])
def test_stiffening_that_is_switched_is_counted_or_left_out(first: str) -> None:
    """The body that is kept is not the same one, though its stiffness is."""
    text = (
        "[mesh]\nrectangle = [20.0, 1.0]\ncells = [4, 1]\n[material]\nyoung = 1000.0\npoisson = 0.0\n[supports]\n"
        'left = "clamped"\n[contact.bottom]\nnormal = { law = "none" }\n[loads]\n'
        "traction = { right = [0.2, 2e-2] }\nstiffening = {}\n"
    )
    bench, second = Bench(Path()), {"true": "false", "false": "true"}[first]
    for flag in (first, second):
        stated = text.replace("stiffening = {}", f"stiffening = {flag}")
        energy = one(answers(bench, "solve", stated), "picture").head["energy"]
        assert energy == pytest.approx(hv.solve(parse_problem(stated)).energy, rel=1e-9)


def test_sliders_stand_where_a_browser_counts_them() -> None:
    """A browser counts units of UTF-16, of which an emoji takes two."""
    text = template("survey").replace("survey, data", "🙂 survey 🙂 é")
    browser = text.encode("utf-16-le")
    sliders = one(answers(Bench(Path()), "solve", text), "problem").head["sliders"]
    assert isinstance(sliders, list)
    assert sliders
    for slider in sliders:
        assert float(browser[2 * slider["start"] : 2 * slider["end"]].decode("utf-16-le")) == slider["value"]


#: Pressed down by its upper edge onto a foundation of springs, and pulled up by its load.
HELD = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, 0.3]
[supports]
top = { displacement = [0.0, -0.05] }
[contact.bottom]
normal = { law = "compliance", stiffness = 5.0 }
"""


def test_the_energy_over_a_slider_has_the_force_of_the_support_as_its_slope() -> None:
    """The derivative of the least energy by a prescribed displacement is the reaction (envelope theorem)."""
    key, low, high = "supports.top.displacement.1", -0.12, 0.0
    messages = answers(Bench(Path()), "energies", HELD, key=key, low=low, high=high)
    assert kinds(messages) == ["energies", "done"]
    found = one(messages, "energies").arrays
    value, energy = (np.asarray(found[name], dtype=float) for name in ("value", "energy"))
    np.testing.assert_allclose(value, np.linspace(low, high, 41))
    slope = (energy[2:] - energy[:-2]) / (value[2:] - value[:-2])
    for place in (3, 20, 37):
        solution = hv.solve(parse_problem(HELD.replace("-0.05", repr(float(value[place])))))
        assert energy[place] == pytest.approx(solution.energy, rel=1e-9)
        assert slope[place - 1] == pytest.approx(solution.reactions["top"][1], rel=2e-2, abs=1e-3)


def test_the_energy_over_a_slider_breaks_where_the_state_jumps() -> None:
    """A block of stiffness 12 passes the peak 1.2 of its foundation, at .02, when it is pushed by .02 + 1.2/12."""
    law = '"softening", stiffness = 60.0, limit = 0.02, softening = 16.0'
    text = HELD.replace("0.3", "0.0").replace("[supports]", '[supports]\nleft = "roller"\nright = "roller"')
    text = text.replace('"compliance", stiffness = 5.0', law)
    key, low, high = "supports.top.displacement.1", -0.21, 0.0
    found = one(answers(Bench(Path()), "energies", text, key=key, low=low, high=high), "energies").arrays
    value, energy = (np.asarray(found[name], dtype=float) for name in ("value", "energy"))
    assert len(value) == 42
    (place,) = np.flatnonzero(np.isnan(energy))
    assert value[place - 1] <= -0.12 <= value[place + 1]
    np.testing.assert_allclose(energy[value < value[place]], 0.5 * 1.2 * 0.095, rtol=1e-6)  # what it has taken up
    held = value[value > value[place]]
    np.testing.assert_allclose(energy[value > value[place]], 0.5 * 10.0 * held**2, rtol=1e-6, atol=1e-12)


def test_an_energy_is_asked_for_over_a_number_that_has_one() -> None:
    bench = Bench(Path())
    wrong = one(answers(bench, "energies", HELD, key="loads.body.7"), "error").head["message"]
    assert "'loads.body.7' is not a number of the problem; choose one" in str(wrong)
    rough = HELD + 'friction = { law = "coulomb", coefficient = 0.3 }\n'
    none = one(answers(bench, "energies", rough, key="loads.body.1", low=-1.0, high=0.0), "error").head["message"]
    assert "Coulomb friction has no energy" in str(none)
    stiff = answers(bench, "energies", HELD, key="contact.bottom.normal.stiffness", low=-1.0, high=5.0)
    energy = one(stiff, "energies").arrays["energy"]
    assert np.isnan(energy[0])  # no law at this value
    assert np.isfinite(energy[-1])
    cells = one(answers(bench, "energies", HELD, key="mesh.cells.0", low=1.0, high=6.0), "energies").arrays["value"]
    np.testing.assert_array_equal(cells, np.arange(1, 7))
    assert kinds(list(bench.answer(Request("energies", 7, HELD, key="loads.body.1"), lambda: True))) == ["done"]


def test_sliders_have_the_units_of_the_file_and_coulombs_law_its_name() -> None:
    rough = HELD + 'friction = { law = "coulomb", coefficient = 0.3 }\n[units]\nlength = "mm"\nstress = "MPa"\n'
    messages = answers(Bench(Path()), "solve", rough)
    sliders = one(messages, "problem").head["sliders"]
    assert isinstance(sliders, list)
    units = {slider["key"]: slider["unit"] for slider in sliders}
    assert units["material.lame.0"] == "MPa"
    assert units["supports.top.displacement.1"] == units["mesh.rectangle.0"] == "mm"
    assert units["loads.body.0"] == units["contact.bottom.friction.coefficient"] == ""
    tresca = rough.replace('law = "coulomb", coefficient', 'law = "tresca", bound')
    sliders = one(answers(Bench(Path()), "solve", tresca), "problem").head["sliders"]
    assert isinstance(sliders, list)
    assert next(slider["unit"] for slider in sliders if slider["key"].endswith("bound")) == "MPa"
    curves = one(messages, "picture").head["curves"]
    assert isinstance(curves, list)
    assert [curve["name"] for curve in curves] == ["compliance", "coulomb"]


@pytest.mark.parametrize("name", ["survey", "softening", "hertz", "cube", "membrane"])
def test_fields_are_those_of_the_library(name: str) -> None:
    text = template(name).replace("cells = [64, 64]", "cells = [16, 16]")
    messages = answers(Bench(Path()), "solve", text)
    solution = hv.solve(parse_problem(text))
    shape, picture = one(messages, "shape"), one(messages, "picture")
    assert picture.head["converged"]
    assert picture.head["energy"] == pytest.approx(solution.energy, rel=1e-9)
    np.testing.assert_allclose(picture.arrays["local"], solution.local, atol=1e-9)
    np.testing.assert_allclose(picture.arrays["pressure"], solution.pressure, atol=1e-6 * abs(solution.pressure).max())
    field = solution.problem.field
    assert field is not None
    points = shape.arrays["points"][:, : field.mesh.dim]
    place = np.array([np.argmin(np.linalg.norm(field.mesh.points - p, axis=1)) for p in points[::7]])
    shown = picture.arrays["displacement"][::7]
    columns = slice(2, 3) if shape.head["kind"] == "scalar" else slice(0, field.mesh.dim)
    np.testing.assert_allclose(
        shown[:, columns], solution.displacement.reshape(field.number_of_nodes, -1)[place], atol=1e-12
    )
    if shape.head["kind"] == "plane":
        size = 1e-6 * abs(solution.multiplier).max()
        np.testing.assert_allclose(picture.arrays["friction"], solution.friction[:, 0], atol=size)
    if "stress" in picture.arrays:
        stress = nodal_average(field.mesh, solution.von_mises())[place]
        np.testing.assert_allclose(picture.arrays["stress"][::7], stress, rtol=1e-5)
    corners = shape.arrays["triangles"]
    assert corners.max() < len(points)


@pytest.mark.parametrize("name", ["two-bodies", "press-fit"])
def test_two_bodies_come_with_no_foundation(name: str) -> None:
    text = template(name)
    messages = answers(Bench(Path()), "solve", text)
    assert kinds(messages) == ["problem", "shape", "picture", "certificate", "done"]
    (boundary,) = one(messages, "shape").head["boundaries"]  # type: ignore[misc]
    assert boundary["pair"]
    solution, picture = hv.solve(parse_problem(text)), one(messages, "picture")
    np.testing.assert_allclose(picture.arrays["pressure"], solution.pressure, rtol=1e-9)
    np.testing.assert_allclose(picture.arrays["moved"][:, :2], solution.contact.moved(solution.displacement))


def test_a_body_that_is_kept_gives_the_same_as_a_new_one() -> None:
    """Another load and law are solved on the body of before, another material or mesh is not."""
    text = template("survey")
    bench = Bench(Path())
    answers(bench, "solve", text)
    for old, new in (
        ("-0.8, -0.8", "-0.5, -1.1"),
        ("q_max = 0.3", "q_max = 0.1"),
        ("bound = 0.5", "bound = 0.2"),
        ('normal = { law = "survey"', 'gap = 0.02\nnormal = { law = "survey"'),
        ("lame = [4.0, 4.0]", "lame = [4.0, 2.0]"),
        ("cells = [32, 32]", "cells = [16, 16]"),
        ('left = "clamped"', 'right = "clamped"'),
    ):
        assert old in text
        changed = text.replace(old, new)
        kept, fresh = (one(answers(b, "solve", changed), "picture") for b in (bench, Bench(Path())))
        for name, values in fresh.arrays.items():
            np.testing.assert_allclose(kept.arrays[name], values, rtol=1e-6, atol=1e-9, err_msg=f"{new}: {name}")
        assert kept.head["energy"] == pytest.approx(fresh.head["energy"], rel=1e-9)


def test_another_load_does_not_condense_the_body_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from hemivar.systems import workspace

    count = []
    condense = workspace.condense
    monkeypatch.setattr(workspace, "condense", lambda *a: count.append(1) or condense(*a))
    bench, text = Bench(Path()), template("survey")
    for load in (-0.8, -0.7, -0.6):
        answers(bench, "solve", text.replace("-0.8, -0.8", f"-0.8, {load}"))
    assert len(count) == 1


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("q_max = 0.3", "q_max = -1.0", "contact.bottom.normal.q_max", "at least 0"),
        ("lame = [4.0, 4.0]", "lame = [4.0, -4.0]", "material.lame.0", "positive"),
        ("lame", "lamé", None, "not valid TOML"),
        ("cells = [32, 32]", "cells = [3200, 3200]", "mesh.cells.0", "cells"),
        ('left = "clamped"', 'left = "glued"', None, "left"),
    ],
)
def test_mistakes_are_told_in_a_sentence_beside_their_key(old: str, new: str, key: str | None, words: str) -> None:
    text = template("survey")
    assert old in text
    (message,) = answers(Bench(Path()), "solve", text.replace(old, new))
    assert message.head["type"] == "error"
    assert words in str(message.head["message"])
    assert "\n" not in str(message.head["message"])
    assert message.head["key"] == key


def test_a_body_too_large_for_a_page_is_refused_before_it_is_made() -> None:
    began = time.perf_counter()
    text = template("survey").replace("cells = [32, 32]", "cells = [2000, 2000]")
    (message,) = answers(Bench(Path()), "solve", text)
    assert str(MOST_CELLS) in str(message.head["message"])
    assert time.perf_counter() - began < 5.0


def test_all_solutions_of_the_softening_foundation() -> None:
    text = template("softening")
    messages = answers(Bench(Path()), "solutions", text)
    found = hv.find_solutions(parse_problem(text))
    pictures = [m for m in messages if m.head["type"] == "picture"]
    assert [m.head["energy"] for m in pictures] == pytest.approx([s.energy for s in found])
    assert [m.head["kind"] for m in pictures] == [s.kind.value for s in found if s.kind is not None]
    assert "all solutions" in str(one(messages, "solutions").head["words"])


def test_the_load_path_and_the_body_at_a_point_of_it() -> None:
    text = (EXAMPLES / "delamination.toml").read_text(encoding="utf-8")
    bench = Bench(EXAMPLES)
    messages = answers(bench, "path", text)
    path = hv.follow_path(parse_problem(text))
    told = one(messages, "path")
    np.testing.assert_allclose(told.arrays["load_factor"], path.load_factor)
    assert told.head["folds"] == [fold.index for fold in path.main_folds]
    index = len(path) // 2
    point = one(answers(bench, "point", text, index=index), "picture")
    np.testing.assert_allclose(point.arrays["local"], path.local[index])
    # the body is in equilibrium with the contact forces of the point
    problem = path.line.at(float(path.load_factor[index]))
    out = problem.load - problem.contact_force(path.multiplier[index])
    u = np.linalg.solve(problem.stiffness.toarray(), out)
    assert problem.field is not None
    expected = problem.field.full(u)[: problem.field.mesh.number_of_nodes]
    np.testing.assert_allclose(point.arrays["displacement"][:, :2], expected, atol=1e-9 * abs(expected).max() + 1e-12)
    other = answers(bench, "point", text.replace("title", "# title", 1) + "\n", index=0)
    assert "follow it again" in str(other[0].head["message"])


def test_an_evolution_comes_frame_by_frame_with_its_history() -> None:
    text = template("bounce")
    stated = parse_problem_file(text)
    assert stated.time is not None
    messages = answers(Bench(Path()), "solve", text)
    frames = [m for m in messages if m.head["type"] == "picture"]
    times = [float(str(m.head["time"])) for m in frames]
    assert times == sorted(times)
    assert len(times) > 50
    history = one(messages, "history")
    assert history.head["ended"] == "finished"
    march = hv.workflows.result_of(hv.workflows.march(evolution_of(stated), plan_of(stated)))
    assert isinstance(march, hv.evolution.History)
    assert history.arrays["normal_force"].max() == pytest.approx(march["normal_force"].max(), rel=1e-5)
    badge = one(messages, "certificate").head
    assert march.uniqueness.lower() in str(badge["meaning"]).lower()
    assert badge["level"] == ("good" if march.uniqueness == "every step has one solution only" else "fair")
    assert times[-1] == pytest.approx(history.arrays["times"][-1])
    refused = answers(Bench(Path()), "path", text)
    assert "[time]" in str(refused[-1].head["message"])


def test_nothing_is_written_from_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = template("bounce").replace("[output]\n", '[output]\ncheckpoint = "kept"\n')
    assert parse_problem_file(text).output is not None
    messages = answers(Bench(tmp_path), "solve", text)
    assert one(messages, "history").head["ended"] == "finished"
    assert list(tmp_path.iterdir()) == []


LAW_OF_A_FILE = '{ law = "table", file = "%s" }'
ONE_BOUNDARY = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[supports]
top = "clamped"
[contact.bottom]
normal = %s
"""


def test_files_outside_of_the_folder_are_refused(tmp_path: Path) -> None:
    """A page that was given a file of another folder reads this one; what is typed there opens nothing else."""
    home = tmp_path / "home"
    home.mkdir()
    for place in (home, tmp_path):
        (place / "law.csv").write_text("r,derivative\n0.0,0.0\n1.0,2.0\n", encoding="utf-8")
    (home / "way").symlink_to(tmp_path)
    inside, *outside = (
        ONE_BOUNDARY % (LAW_OF_A_FILE % name) for name in ("law.csv", "../law.csv", tmp_path / "law.csv", "way/law.csv")
    )
    mesh = ONE_BOUNDARY.replace("rectangle = [1.0, 1.0]\ncells = [4, 4]", 'file = "/etc/passwd"') % '"rigid"'
    part = template("two-bodies").replace("[mesh.lower]", '[mesh.lower]\nfile = "../lower.msh"')
    assert kinds(answers(Bench(home), "solve", inside))[-1] == "done"
    for text in (*outside, mesh, part):
        (refused,) = answers(Bench(home), "solve", text)
        assert "lies outside of the folder" in str(refused.head["message"])
    included = 'file = "m.inp"'
    text = ONE_BOUNDARY.replace("rectangle = [1.0, 1.0]\ncells = [4, 4]", included) % '"rigid"'
    (tmp_path / "secret.inc").write_text("*NODE\n1, zero, 0\n", encoding="utf-8")
    (home / "m.inp").write_text("*INCLUDE, INPUT=../secret.inc\n*NODE\n2,1,0\n", encoding="utf-8")
    (refused,) = answers(Bench(home), "solve", text)
    assert "'secret.inc' is included from outside of the folder" in str(refused.head["message"])
    assert kinds(answers(Bench(home, given=outside[0]), "solve", outside[0]))[-1] == "done"


def test_parts_of_a_mesh_that_are_too_large_are_refused_before_they_are_made() -> None:
    text = template("two-bodies").replace("[20, 10]", "[20000, 10000]")
    assert text != template("two-bodies")
    start = time.process_time()
    *_, refused = answers(Bench(Path()), "solve", text)
    assert "the studio shows up to 400000" in str(refused.head["message"])
    assert time.process_time() - start < 5.0


def test_curves_are_those_of_the_laws() -> None:
    curves = one(answers(Bench(Path()), "solve", template("survey")), "picture").head["curves"]
    assert isinstance(curves, list)
    normal, friction = curves
    assert normal["jumps"] == [[0.0, 0.0, pytest.approx(0.3)]]
    r, pressure = normal["pieces"][-1]
    np.testing.assert_allclose(pressure, 0.3 + 2.0 * np.array(r), rtol=1e-9)
    assert friction["jumps"] == [[0.0, pytest.approx(-0.5), pytest.approx(0.5)]]
    assert (normal["side"], normal["name"], friction["name"]) == ("normal", "survey", "tresca")


COULOMB = ONE_BOUNDARY.replace("cells = [4, 4]", "cells = [10, 10]").replace(
    "[contact.bottom]", "[loads]\nbody = [0.6, -1.0]\n[contact.bottom]"
) % ('{ law = "compliance", stiffness = 20.0 }\nfriction = { law = "coulomb", coefficient = 0.3 }')


def beside(curve: dict[str, object]) -> float:
    """The largest distance of the points of a curve to it, jumps filled in, by the size of the picture."""
    r, y = (np.array(part) for part in curve["points"])  # type: ignore[attr-defined]
    most = max(1.1 * float(abs(y).max()), 1e-300)
    pieces = [np.array(piece) for piece in curve["pieces"]]  # type: ignore[attr-defined]
    for place, low, high in curve["jumps"]:  # type: ignore[attr-defined]
        ends = np.clip([-math.inf if low is None else low, math.inf if high is None else high], -most, most)
        pieces.append(np.array([np.full(400, place), np.linspace(*ends, 400)]))
    x, t = np.concatenate(pieces, axis=1)
    size = np.array([float(str(curve["reach"])), most])[:, None]
    apart = np.array([np.hypot(*((np.array([[a], [b]]) - [x, t]) / size)).min() for a, b in zip(r, y, strict=True)])
    return float(apart.max())


@pytest.mark.parametrize("text", [template("survey"), template("hertz"), COULOMB], ids=["survey", "hertz", "coulomb"])
def test_contact_points_lie_on_the_law_that_is_drawn(text: str) -> None:
    """By Coulomb's law each point has a bound of its own: tractions are divided by it."""
    curves = one(answers(Bench(Path()), "solve", text), "picture").head["curves"]
    assert isinstance(curves, list)
    for curve in curves:
        assert len(curve["points"][0]) > 5
        assert beside(curve) < 0.02, curve["name"]
    if text is COULOMB:
        assert curves[1]["bounded"]
        assert max(map(abs, curves[1]["points"][1])) == pytest.approx(1.0, rel=1e-6)


def test_in_time_each_frame_has_its_law_and_friction_is_that_of_the_rate() -> None:
    text = COULOMB + "\n[time]\nuntil = 0.2\nstep = 0.02\n"
    text = text.replace("lame = [4.0, 4.0]", "lame = [4.0, 4.0]\nviscosity = [0.5, 0.5]")
    messages = answers(Bench(Path()), "solve", text)
    assert kinds(messages)[-1] == "done", messages[-1].head
    frames = [m.head for m in messages if m.head["type"] == "picture"]
    assert len(frames) > 5
    for head in frames[1:]:
        _, friction = head["curves"]  # type: ignore[misc]
        assert friction["by"] == "rate"
        assert beside(friction) < 0.05, head["time"]


def test_the_badge_claims_what_the_certificate_says() -> None:
    survey = hv.solve(parse_problem(template("survey"))).certify()
    assert badge_of(survey)[0] == "good"
    assert survey.unique is True
    kinds_found = {badge_of(s.certify())[0] for s in hv.find_solutions(parse_problem(template("softening")))}
    assert kinds_found == {"fair", "poor"}  # minimisers that are not alone, and a saddle
    wrong = hv.certify(
        survey_problem := hv.discretize(parse_problem(template("survey"))), np.ones(survey_problem.unknowns)
    )
    assert badge_of(wrong)[:2] == ("poor", "not a solution")


def test_the_newest_request_wins() -> None:
    """A request ends the work on the one before it; what waits behind a newer one is never begun."""
    begun: list[int] = []
    told: list[tuple[object, object]] = []
    finished = threading.Event()

    class Slow(Bench):
        def answer(self, request: Request, stopped: object) -> object:  # type: ignore[override]
            begun.append(request.generation)
            for _ in range(400):
                time.sleep(0.005)
                yield Message({"type": "step", "generation": request.generation})
                if request.generation == 4:
                    finished.set()
                    return

    desk = Desk(Slow(Path()), lambda message: told.append((message.head["type"], message.head["generation"])))
    desk.put(Request("solve", 1))
    while not told:
        time.sleep(0.005)
    for generation in (2, 3, 4):
        desk.put(Request("solve", generation))
    assert finished.wait(10.0)
    desk.close()
    desk.join(10.0)
    assert begun[0] == 1
    assert begun[-1] == 4
    assert len(begun) <= 3
    numbers = [int(str(generation)) for _, generation in told]
    assert numbers == sorted(numbers)
    assert numbers.count(1) < 200  # its 400 steps were not waited for


def test_a_page_that_waits_for_another_says_so() -> None:
    told: list[Message] = []
    go_on, at_work, ended = threading.Event(), threading.Event(), threading.Event()

    class Waits(Bench):
        def answer(self, request: Request, stopped: object) -> object:  # type: ignore[override]
            at_work.set()
            assert go_on.wait(10.0)
            yield Message({"type": "done", "generation": request.generation})

    first = Desk(Waits(Path()), lambda message: None)
    second = Desk(Waits(Path()), lambda message: (told.append(message), len(told) == 3 and ended.set()))  # type: ignore[arg-type,return-value]
    first.put(Request("solve", 1))
    assert at_work.wait(10.0)
    second.put(Request("solve", 5))
    for generation in (5, 6):  # a change meanwhile is answered as well
        for _ in range(1000):
            if told and told[-1].head["generation"] == generation:
                break
            time.sleep(0.005)
        assert (told[-1].head["type"], told[-1].head["generation"]) == ("progress", generation)
        if generation == 5:
            second.put(Request("solve", 6))
    assert "another page" in str(told[0].head["words"])
    go_on.set()
    assert ended.wait(10.0)
    for desk in (first, second):
        desk.close()
        desk.join(10.0)
    assert told[-1].head["type"] == "done"


def test_an_error_of_the_program_is_told_and_the_worker_lives() -> None:
    told: list[Message] = []

    class Broken(Bench):
        def answer(self, request: Request, stopped: object) -> object:  # type: ignore[override]
            if request.generation == 1:
                raise ZeroDivisionError
            yield Message({"type": "done", "generation": request.generation})

    desk = Desk(Broken(Path()), told.append)
    for generation in (1, 2):
        desk.put(Request("solve", generation))
        for _ in range(1000):
            if len(told) >= generation:
                break
            time.sleep(0.005)
    desk.close()
    assert [m.head["type"] for m in told] == ["error", "done"]
    assert "should not occur" in str(told[0].head["message"])


ENDING = """
import time
from pathlib import Path
from hemivar.files.sample import template
from hemivar.studio.jobs import Bench
from hemivar.studio.page_worker import Desk
from hemivar.studio.requests import request_of
desks = [Desk(Bench(Path()), lambda message: None) for _ in range(2)]
for desk in desks:
    desk.put(request_of({"type": "path", "generation": 1, "text": template("survey")}))
time.sleep(0.5)
print("the end")
"""


def test_a_process_may_end_while_its_workers_compute() -> None:
    """Of the server as of a notebook: a thread that went on into the end of the interpreter made it fail there."""
    quiet = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, env=quiet, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "the end\n", "")
