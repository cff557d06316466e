"""What a body carries, against closed forms, the path, and other units."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar import cli
from hemivar.basics.generators import result_of
from hemivar.branches import LoadBracket, Reached, load_bracket
from hemivar.branches import bracket as brackets
from hemivar.branches.bracket import BracketOptions, bracketing
from hemivar.errors import ProblemError, SupportError
from hemivar.fem import LoadLine
from hemivar.laws import BenzeggaghKenane, BilinearCohesion, ContactLaw, MixedMode, ModeDependentGlue, SlipTable
from hemivar.mesh import Mesh
from hemivar.solvers import NonsmoothNewton, Status
from tests.samples import slow

STIFF = hv.Material.lame(4e3, 4e3)
PLANE, SPACE = hv.rectangle((1.0, 1.0), 4), hv.box((1.0, 1.0, 1.0), 2)
#: Opening: 24 mm^-1 up to 2.0; shear: 3.0.
CRITERION = BenzeggaghKenane(0.5, 0.9, 2.0)
GLUE = ModeDependentGlue(2.0, 3.0, 24.0, CRITERION)
SLIP = SlipTable(2.0, [0.0, 0.1, 0.5], [0.0, 1.0, 0.0])


def encloses(found: LoadBracket, limit: float) -> None:
    """The limit load lies in the bracket, which is closed to 1 %; its lower end is an equilibrium."""
    assert found.not_carried is not None
    assert found.carried <= limit * (1.0 + 1e-9)
    assert found.not_carried >= limit * (1.0 - 1e-3)
    assert found.not_carried - found.carried <= 0.01 * found.not_carried
    assert found.complete
    assert found.ended is not Status.CONVERGED
    assert found.solution.status is Status.CONVERGED


def pushed(contact: hv.Contact, load: tuple[float, ...], mesh: Mesh = PLANE) -> hv.ContactProblem:
    """A stiff block that contact alone holds, loaded on its contact boundary: the same everywhere along it."""
    return hv.ContactProblem(mesh=mesh, material=STIFF, contact={"bottom": contact}, tractions={"bottom": load})


# ---- one point ----------------------------------------------------------------------------------------------------


def glued_point(softening: float, stiffness: object, load: object, trace: object) -> hv.DiscreteProblem:
    """One point of glue, strength 2.4 at an opening of 0.1, on springs."""
    law = ContactLaw(hv.Adhesive(24.0, 2.4, softening, 72.0)).at(None)
    return hv.DiscreteProblem.of_arrays(
        sp.csr_array(np.array(stiffness)), np.array(load), sp.csr_array(np.array(trace)), np.ones(1), np.zeros(1), law
    )


@pytest.mark.parametrize("softening", [6.0, 36.0])
def test_a_point_that_is_pulled_through_a_spring_carries_its_strength(softening: float) -> None:
    """The spring of stiffness 12 passes the force on, however the glue softens."""
    spring = [[12.0, -12.0], [-12.0, 12.0]]
    found = load_bracket(glued_point(softening, spring, [1.0, 0.0], [[0.0, -1.0]]))
    encloses(found, 2.4)
    opening = found.carried / 24.0
    np.testing.assert_allclose(found.solution.unknowns, [opening + found.carried / 12.0, opening], rtol=1e-6)
    assert found.fold == pytest.approx(2.4, rel=1e-8)
    assert found.ended is Status.NOT_CARRIED
    assert str(found).endswith(f"{found.not_carried:.4g} is not carried: the path folds at 2.4")


def test_where_no_fold_was_found_the_iteration_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body too large for a path."""
    monkeypatch.setattr(brackets, "affordable", lambda problem: False)
    found = load_bracket(glued_point(6.0, [[12.0, -12.0], [-12.0, 12.0]], [1.0, 0.0], [[0.0, -1.0]]))
    assert found.fold is None
    assert "the body ran away there" in str(found)
    assert "the iteration failed there: stalled" in str(replace(found, ended=Status.STALLED))


@pytest.mark.parametrize("ask", [load_bracket, hv.follow_path])
def test_a_load_that_does_not_grow_is_refused(ask: Callable[..., object]) -> None:
    supports = {"top": hv.Fixed(x=0.0, y=0.0)}
    block = hv.ContactProblem(
        mesh=PLANE, material=STIFF, contact={"bottom": hv.Contact(hv.Signorini())}, supports=supports
    )
    heavy = replace(block, body_force=(0.0, -1.0))
    for problem, constant in ((block, []), (heavy, ["body"])):
        with pytest.raises(ProblemError, match="nothing grows"):
            ask(problem, constant=constant)
    ask(heavy)


@pytest.mark.parametrize(("softening", "opening"), [(6.0, 1.0 / 3.0), (36.0, 5.0 / 12.0)])
def test_a_point_beside_a_spring_carries_everything(softening: float, opening: float) -> None:
    """12 w + t(w) = 5: with the fall 6 the glue holds still, with 36 it has jumped to broken on the way."""
    found = load_bracket(glued_point(softening, [[12.0]], [1.0], [[-1.0]]))
    assert (found.carried, found.not_carried, found.ended) == (5.0, None, Status.CONVERGED)
    assert found.solution.unknowns[0] == pytest.approx(opening, rel=1e-9)
    assert str(found) == "carries the load up to the factor 5, the largest that was tried"


def test_a_body_that_nothing_holds_carries_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(NonsmoothNewton, "default_steps", 20)  # none of its steps leads anywhere
    spring, law = sp.csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]])), ContactLaw(hv.Signorini()).at(None)
    trace = sp.csr_array(np.array([[0.0, -1.0]]))
    found = load_bracket(
        hv.DiscreteProblem.of_arrays(spring, np.array([1.0, 0.0]), trace, np.ones(1), np.zeros(1), law)
    )
    assert found.carried == 0.0
    assert found.not_carried is not None
    assert found.not_carried < 1e-8
    assert str(found).startswith("carries nothing, no equilibrium found at ")


@pytest.mark.parametrize("limit", [2.3, 2.3e-3, 2.3e-6])
def test_a_small_part_of_the_load_is_bracketed_as_closely(limit: float) -> None:
    spring = [[12.0, -12.0], [-12.0, 12.0]]
    encloses(load_bracket(glued_point(6.0, spring, [2.4 / limit, 0.0], [[0.0, -1.0]])), limit)


# ---- uniform strips -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [PLANE, slow(SPACE)], ids=["plane", "space"])
@pytest.mark.parametrize(("opening", "shear"), [slow(1.0, 0.0), slow(0.0, 1.0), slow(1.0, 1.0), (0.3, 1.0)])
def test_a_strip_of_mode_dependent_glue_carries_the_strength_of_its_mode(
    mesh: Mesh, opening: float, shear: float
) -> None:
    """Damage begins at rho_0^2 = w_0^2 + (s_0^2 - w_0^2) B^eta, where a dead load has its limit."""
    ratio = np.sqrt(0.5 / 0.9) * 3.0 / 2.0
    mode = (shear / ratio) ** 2 / (opening**2 + (shear / ratio) ** 2)
    first, second = 2.0 / 24.0, 3.0 / (ratio * 24.0)
    onset = np.sqrt(first**2 + (second**2 - first**2) * mode**2.0)
    limit = 24.0 * onset / np.hypot(opening, shear / ratio)
    load = (shear, *(0.0,) * (mesh.dim - 2), opening)
    encloses(load_bracket(pushed(hv.Contact(GLUE), load, mesh)), limit)


def test_a_load_beside_friction_is_bracketed_by_the_bound() -> None:
    """A block that is pressed on and pushed along: discretising it is refused, and half of its load is carried."""
    pressed = pushed(hv.Contact(hv.Compliance(100.0), hv.Tresca(0.3)), (0.6, -1.0))
    with pytest.raises(SupportError):
        hv.discretize(pressed)
    encloses(load_bracket(pressed), 0.5)


def test_what_no_part_of_the_load_leaves_in_its_place_is_refused() -> None:
    with pytest.raises(SupportError, match=r"translation \(1, 0\)"):
        load_bracket(pushed(hv.Contact(hv.Compliance(100.0)), (0.6, -1.0)))


def test_coulomb_friction_and_glue() -> None:
    block = replace(pushed(hv.Contact(hv.Adhesive(24.0, 2.0, 6.0, 72.0), hv.Coulomb(0.3)), (0.0, 1.0)))
    encloses(load_bracket(replace(block, supports={"left": "roller"})), 2.0)


def test_a_nonlinear_body() -> None:
    soft = replace(pushed(hv.Contact(GLUE), (0.0, 1.0)), material=hv.Material.hencky(4e3, 4e3, 0.25, 0.001))
    encloses(load_bracket(soft), 2.0)


def test_a_scalar_problem() -> None:
    shear = hv.ScalarProblem(
        mesh=PLANE,
        coefficient=4e3,
        contact={"bottom": hv.ScalarContact(SLIP)},
        fluxes={"top": 1.0},
        kind="antiplane",
    )
    encloses(load_bracket(shear), 2.0)


def test_prescribed_displacements_grow_with_the_load() -> None:
    held = hv.ContactProblem(
        mesh=PLANE, material=STIFF, contact={"bottom": hv.Contact(GLUE)}, supports={"top": hv.Fixed(x=0.0, y=0.1)}
    )
    found = load_bracket(held, upto=2.0)
    assert found.carried == 2.0
    top = found.solution.displacement[held.mesh.points[:, 1] > 1.0 - 1e-9]
    np.testing.assert_allclose(top, np.tile([0.0, 0.2], (len(top), 1)), atol=1e-12)


def test_every_load_on_the_way_has_its_part_of_the_prescribed_displacements() -> None:
    def held(up: float) -> hv.ContactProblem:
        contact = {"bottom": hv.Contact(hv.Adhesive(24.0, 20.0, 6.0, 72.0), hv.Tresca(0.1))}
        sides = {"left": hv.Fixed(x=0.02 * up)}
        return hv.ContactProblem(PLANE, hv.Material.lame(4.0, 4.0), contact, sides, tractions={"top": (0.0, -0.2 * up)})

    seen: list[Reached] = []
    result_of(bracketing(held(1.0), BracketOptions(2.0)), lambda reached: bool(seen.append(reached)))
    for reached in seen[:3]:
        expected = hv.solve(held(reached.carried)).raise_for_status()
        np.testing.assert_allclose(reached.at.r, expected.local, atol=1e-7)


# ---- another method, other units, other steps ----------------------------------------------------------------------


def lever(size: float = 1.0, stress: float = 1.0, contact: hv.Contact | None = None) -> hv.ContactProblem:
    """A beam that glue along its foot holds, pulled up at its end; stress and length in other units."""
    glue = MixedMode(BilinearCohesion(2.0 * stress, 0.5 * stress * size, 24.0 * stress / size), 1.0)
    return hv.ContactProblem(
        mesh=hv.rectangle((4.0 * size, 1.0 * size), (16, 4)),
        material=hv.Material.young(200.0 * stress, 0.3),
        contact={"bottom": hv.Contact(glue) if contact is None else contact},
        tractions={"right": (0.0, 0.1 * stress)},
    )


@cache
def bracket_of_lever(upto: float = 30.0) -> LoadBracket:
    return load_bracket(lever(), upto)


def test_the_limit_load_of_the_path_lies_in_the_bracket() -> None:
    own = hv.Contact(hv.Adhesive(24.0, 2.0, 6.0, 72.0), SLIP)
    limit = hv.follow_path(lever(contact=own), (0.0, 50.0)).limit_load
    assert limit is not None
    encloses(load_bracket(lever(contact=own), upto=50.0), limit)


@pytest.mark.parametrize(("size", "stress"), [(1e3, 1e-6), slow(1e-3, 1e6), slow(1e3, 1.0)])
def test_units_do_not_change_it(size: float, stress: float) -> None:
    ours, theirs = bracket_of_lever(), load_bracket(lever(size, stress), 30.0)
    assert ours.not_carried is not None
    assert (theirs.carried, theirs.not_carried) == (ours.carried, ours.not_carried)


TOPS = (30.0, 47.0, 400.0)


def test_the_largest_load_that_is_tried_does_not_change_what_is_carried() -> None:
    limits = [(found.carried, found.not_carried) for found in map(bracket_of_lever, TOPS)]
    assert max(low for low, _ in limits) <= 1.01 * min(high or 0.0 for _, high in limits)


def test_a_solve_brackets_its_load_in_the_same_way() -> None:
    """There is one continuation; a solve of the largest load says the same as part of that load."""
    found, solution = bracket_of_lever(), hv.solve(LoadLine.of(lever()).at(30.0))
    assert solution.carried is not None
    assert found.not_carried is not None
    np.testing.assert_allclose(30.0 * np.array(solution.carried), (found.carried, found.not_carried), rtol=1e-12)


# ---- own continuation of glue with two fracture energies ------------------------------------------------------------


@dataclass(frozen=True)
class Own:
    """Numbers of glue with the exponent 2 of Benzeggagh and Kenane, and springs in compression."""

    stiffness: float
    shear_stiffness: float
    strength: float
    shear_strength: float
    energy: float
    shear_energy: float
    compression: float

    @property
    def glue(self) -> ModeDependentGlue:
        criterion = BenzeggaghKenane(self.energy, self.shear_energy, 2.0)
        springs = hv.Compliance(self.compression)
        first = self.strength, self.shear_strength, self.stiffness
        return ModeDependentGlue(*first, criterion, self.shear_stiffness, compression=springs)

    def traction(self, r: np.ndarray) -> np.ndarray:
        """Multipliers (m, 2), written down anew."""
        k, ratio = self.stiffness, self.shear_stiffness / self.stiffness
        shear = ratio * r[:, 1] ** 2
        rho = np.sqrt(np.maximum(-r[:, 0], 0.0) ** 2 + shear) + 1e-150
        mixed = np.minimum(shear / rho**2, 1.0) ** 2.0
        ends = (self.strength / k) ** 2, self.shear_strength**2 / (k * self.shear_stiffness)
        onset = np.sqrt(ends[0] + (ends[1] - ends[0]) * mixed)
        last = 2.0 * (self.energy + (self.shear_energy - self.energy) * mixed) / (k * onset)
        falling = k * onset * (last - rho) / ((last - onset) * rho)
        secant = np.where(rho <= onset, k, np.where(rho < last, falling, 0.0))
        return np.stack([np.where(r[:, 0] < 0.0, secant, self.compression) * r[:, 0], ratio * secant * r[:, 1]], axis=1)


def own_limit(glue: Own, body: hv.systems.CondensedProblem, top: float, longest: float = 0.3) -> float:
    """The largest t on the path of A r + W lam(r) = t g, by Newton's method in the arc length; about ``top``."""
    matrix, load, weights = body.matrix, top * body.load, body.weights
    m, w = len(weights), np.repeat(weights, 2)

    def system(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at, tangent = r.reshape(m, 2), matrix.copy()
        for k, part in enumerate(np.eye(2) * 1e-7 * np.abs(r).max(initial=1e-3)):
            slope = (glue.traction(at + part) - glue.traction(at - part)) / (2.0 * part[k])
            for i in range(2):
                tangent[2 * np.arange(m) + i, 2 * np.arange(m) + k] += weights * slope[:, i]
        return matrix @ r + w * glue.traction(at).ravel(), tangent

    r, t, length = np.zeros(2 * m), 0.0, longest
    first = np.linalg.solve(system(r)[1], load)
    size, best = np.abs(first).max(), 0.0
    way = np.append(first / size, 1.0) / np.linalg.norm(np.append(first / size, 1.0))
    while t >= 0.8 * best and length > 1e-7:
        q, s = r + length * size * way[:-1], t + length * way[-1]
        for _ in range(12):
            force, tangent = system(q)
            missed = np.append(force - s * load, ((q - r) / size) @ way[:-1] + (s - t) * way[-1] - length)
            if np.abs(missed).max() < 1e-10 * np.abs(load).max():
                way = np.append((q - r) / size, s - t) / length
                r, t, best, length = q, s, max(best, s), min(2.0 * length, longest)
                break
            border = np.append(way[:-1] / size, way[-1])
            change = np.linalg.solve(np.block([[tangent, -load[:, None]], [border[None]]]), -missed)
            q, s = q + change[:-1], s + change[-1]
        else:
            length *= 0.5
    return top * best


def plate(glue: ModeDependentGlue, pull: tuple[float, float]) -> hv.ContactProblem:
    """An aluminium plate of 40 mm x 10 mm that epoxy alone holds."""
    return hv.ContactProblem(
        mesh=hv.rectangle((40.0, 10.0), (8, 2)),
        material=hv.Material.young(70e3, 0.33, plane="stress"),
        contact={"bottom": hv.Contact(glue)},
        tractions={"right": pull},
    )


def test_glue_with_two_fracture_energies_against_own_continuation() -> None:
    own = Own(24.0, 24.0 * 0.5 / 0.9 * 2.25, 2.0, 3.0, 0.5, 0.9, 1e4)
    stated = lever(contact=hv.Contact(own.glue))
    limit = own_limit(own, hv.systems.condense(hv.discretize(stated)), 20.0)
    assert 20.0 < limit < 25.0
    encloses(load_bracket(stated, 30.0), limit)


@pytest.mark.slow
@pytest.mark.parametrize(("energy", "pull"), [(0.4, (10.0, 10.0)), (1.2, (10.0, 10.0)), (0.4, (10.0, 4.0))])
def test_slow_iterations_below_the_largest_load_are_let_finish(energy: float, pull: tuple[float, float]) -> None:
    """The fixed point of the mode contracts by ever less towards the limit load."""
    own = Own(7488.0, 1449.0, 20.0, 18.0, energy, 1.2, 7488.0)
    stated = plate(own.glue, pull)
    encloses(load_bracket(stated), own_limit(own, hv.systems.condense(hv.discretize(stated)), 3.0, 0.03))


# ---- ends ---------------------------------------------------------------------------------------------------------


def test_the_time_limit_leaves_the_bracket_so_far() -> None:
    found = load_bracket(lever(), 20.0, max_time=0.0)
    assert (found.carried, found.ended, found.complete) == (0.0, Status.MAX_TIME, False)
    assert str(found) == "no equilibrium under load yet (the bracket is not closed: max_time)"


@pytest.mark.parametrize("way", ["asked", "keyboard"])
def test_it_ends_after_a_load_factor_where_it_is_asked_to(way: str) -> None:
    seen: list[Reached] = []

    def stop(reached: Reached) -> bool:
        seen.append(reached)
        if way == "keyboard" and len(seen) == 3:
            raise KeyboardInterrupt
        return len(seen) == 3

    found = result_of(bracketing(lever(), BracketOptions(1.0)), stop)
    assert [one.tried for one in seen] == [1, 2, 3]
    assert (found.ended, found.tried, found.carried) == (Status.INTERRUPTED, 3, seen[-1].carried)
    assert seen[0].carried == pytest.approx(0.1)
    assert found.solution.status is Status.CONVERGED


def test_an_interruption_while_a_load_factor_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    step, taken = NonsmoothNewton.step, list[int]()

    def interrupted(self: NonsmoothNewton, *arguments: object) -> object:
        taken.append(1)
        if len(taken) == 5:
            raise KeyboardInterrupt
        return step(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(NonsmoothNewton, "step", interrupted)
    found = load_bracket(lever(), 20.0)
    assert found.ended is Status.INTERRUPTED
    assert not found.complete


def test_mistakes_are_named() -> None:
    with pytest.raises(ProblemError, match="upto is -1"):
        load_bracket(lever(), -1.0)
    with pytest.raises(ProblemError, match="upto is 'high'; give the largest load factor"):
        load_bracket(lever(), "high")  # type: ignore[arg-type]


# ---- the command --------------------------------------------------------------------------------------------------

STRIP = """
[mesh]
rectangle = [1.0, 1.0]
cells = 4
[material]
lame = [4e3, 4e3]
[loads]
traction = { bottom = [0.0, 1.0] }
[contact.bottom]
normal = { law = "mode-dependent", strength = 2.0, shear_strength = 3.0, energy = 0.5, shear_energy = 0.9, \
stiffness = 24.0, exponent = 2.0 }
"""


def test_the_command_prints_and_writes_the_bracket(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out, picture = tmp_path / "strip.toml", tmp_path / "b.json", tmp_path / "b.png"
    file.write_text(STRIP)
    assert cli.main(["bracket", str(file), "--json", str(out), "--plot", str(picture)]) == 0
    record = json.loads(out.read_text())
    printed = re.search(
        r"equilibria up to the load factor (\S+), no equilibrium found at (\S+) ", capsys.readouterr().out
    )
    assert printed is not None
    assert float(printed.group(1)) == pytest.approx(record["carried"], rel=1e-3)
    assert record["carried"] <= 2.0 <= record["not_carried"] <= 1.01 * record["carried"]
    assert record["ended"] == "unbounded"
    assert record["solution"]["resultants"]["normal_force"] == pytest.approx(-record["carried"], rel=1e-6)
    assert picture.stat().st_size > 1000


def test_the_command_says_that_everything_is_carried(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "strip.toml", tmp_path / "b.json"
    file.write_text(STRIP)
    assert cli.main(["bracket", str(file), "--upto", "1.5", "--json", str(out)]) == 0
    assert "carries the load up to the factor 1.5, the largest that was tried" in capsys.readouterr().out
    assert json.loads(out.read_text())["not_carried"] is None
    assert cli.main(["bracket", str(file), "--upto", "nan"]) == 2


def test_a_column_carries_the_load_at_which_it_buckles() -> None:
    """With stress stiffening: Euler's load, less the shear of a rectangle, lies in the bracket; tension has no end."""
    young, length = 1000.0, 20.0
    euler = np.pi**2 * young / 12.0 / (4.0 * length**2)
    buckles = euler / (1.0 + euler / (5.0 / 6.0 * 0.5 * young))
    column = hv.ContactProblem(
        hv.rectangle((length, 1.0), (20, 1)), hv.Material.young(young, 0.0), {}, {"left": hv.Clamped()},
        tractions={"right": (-0.4 * buckles, 1e-6)}, order=2, stiffening=True,
    )  # fmt: skip
    found = load_bracket(column, upto=5.0)
    assert found.not_carried is not None
    assert found.carried <= 2.5 <= 1.001 * found.not_carried
    assert found.not_carried - found.carried <= 0.01 * found.not_carried
    assert found.solution.displacement[:, 1].max() > 0.0
    pulled = load_bracket(replace(column, tractions={"right": (0.4 * buckles, 1e-6)}), upto=5.0)
    assert pulled.carried == 5.0


@pytest.mark.slow
def test_a_lap_joint_carries_more_than_small_strains_say() -> None:
    """Epoxy of 0.2 mm between plates of aluminium: tension straightens the joint, and its peel falls."""
    t, glue = 1.6, hv.laws.ModeDependentGlue(
        35.0, 25.0, 21008.0, hv.laws.BenzeggaghKenane(0.5, 1.2, 2.0), 4596.0, hv.Compliance(21008.0)
    )  # fmt: skip
    upper = hv.rectangle((100.0, t), (80, 2)).marked({"overlap": "y < 1e-6 and x > 87.49"})
    lower = hv.rectangle((100.0, t), (80, 2), origin=(87.5, -t)).marked({"overlap": "y > -1e-6 and x < 100.01"})
    joint = hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}), hv.Material.young(70e3, 0.33),
        {"upper:overlap": hv.Contact(glue, against="lower:overlap")},
        {"upper:left": hv.Clamped(), "lower:right": hv.Fixed(y=0.0)},
        tractions={"lower:right": (100.0 / t, 0.0)}, order=2,
    )  # fmt: skip
    small = load_bracket(joint, upto=4.0)
    large = load_bracket(replace(joint, stiffening=True), upto=4.0)
    assert 1.15 < large.carried / small.carried < 1.25
