"""Bounds of bodies on laws that couple opening and slip: closed forms, gaps by brute force, constants, what is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import solve_adaptive
from hemivar.bounds.adaptive_end import AdaptiveEnd
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import ContactTraces, contact_traces
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.fenchel import exact_gap, fenchel_gap
from hemivar.bounds.trace_bounds import TraceBounds, body_constants
from hemivar.gallery import survey
from hemivar.laws import (
    BenzeggaghKenane,
    BilinearCohesion,
    Compliance,
    CoulombBound,
    CoupledFormulaLaw,
    FormulaLaw,
    MixedMode,
    ModeDependentGlue,
    OrthotropicFriction,
    PenetrationBound,
    Softening,
    Superpotential,
    Tresca,
    VectorLaw,
)
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Prescribed
from hemivar.systems import Workspace

LAM, MU = 4.0, 3.0
STIFF, FIRST, LAST, RATIO = 3.0, 0.1, 0.9, 1.5
FALLS = STIFF * FIRST / (LAST - FIRST)
GLUE = MixedMode(BilinearCohesion(STIFF * FIRST, 0.5 * STIFF * FIRST * LAST, STIFF), RATIO)
WIDTH, ENERGY = 0.3, 0.02
#: Friction beside glue, with kinks at r = 0 and s = 0.
FORMULA = CoupledFormulaLaw(
    f"{ENERGY}*(1 - exp(-(min(r, 0)^2 + 4*s^2)/{WIDTH}^2)) + 2*max(r, 0)^2 + 0.1*max(r, 0) + 0.05*s", reach=2.0
)


def bound(problem: ContactProblem) -> ExactDistance:
    solution = hv.solve(problem, controls=hv.Controls(rtol=1e-11)).raise_for_status()
    return exact_distance(problem, solution.displacement, body_constants(solution.problem, Workspace()))


def coupled_square(
    law: VectorLaw | Superpotential = GLUE, n: int = 4, load: tuple[float, float] = (0.15, 0.2)
) -> ContactProblem:
    return ContactProblem(
        hv.rectangle((1.0, 1.0), n), Material.lame(LAM, MU), {"bottom": Contact(law)}, {"left": Clamped()},
        tractions={"top": load},
    )  # fmt: skip


def orthotropic_cube(friction: OrthotropicFriction, n: int = 2) -> ContactProblem:
    return ContactProblem(
        hv.box((1.0, 1.0, 1.0), n), Material.lame(LAM, MU), {"bottom": Contact(Compliance(5.0), friction)},
        {"top": Clamped()}, tractions={"right": (0.1, 0.3, -0.3)},
    )  # fmt: skip


# ---- a closed form ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("units", [1.0, 1e3])
@pytest.mark.parametrize("rho", [0.5 * FIRST, 3.0 * FIRST, 1.5 * LAST])
def test_a_strip_of_one_strain_is_in_the_space(rho: float, units: float) -> None:
    """Intact, softening and broken: opening and slip are the same everywhere, and so are stress and strain."""
    mode = 0.6
    opening, slip = rho * np.cos(mode), rho * np.sin(mode) / RATIO
    secant = STIFF if rho < FIRST else max(FALLS * (LAST - rho) / rho, 0.0)
    normal, shear = secant * opening, secant * RATIO**2 * slip  # of the foundation on the body: down, and back
    gradient = np.array([[0.0, -shear / MU], [0.0, normal / (LAM + 2.0 * MU)]])
    # u = (s, w) + gradient (x, y); the law's second component runs along the tangent of the facet
    height = 0.25
    stress = np.array([[LAM * gradient[1, 1], -shear], [-shear, normal]])
    start = np.array([-slip, opening])
    law = MixedMode(BilinearCohesion(STIFF * FIRST, 0.5 * STIFF * FIRST * LAST * units, STIFF / units), RATIO)
    problem = ContactProblem(
        mesh=hv.rectangle((units, height * units), (4, 2)),
        material=Material.lame(LAM, MU),
        contact={"bottom": Contact(law)},
        supports={"top": Prescribed(tuple(units * (start + height * gradient[:, 1])))},
        tractions={"right": tuple(stress[:, 0]), "left": tuple(-stress[:, 0])},
    )
    exact = units * start + problem.mesh.points @ gradient.T
    found = bound(problem)
    solved = hv.solve(problem, controls=hv.Controls(rtol=1e-12)).displacement
    assert solved == pytest.approx(exact, abs=1e-8 * units)
    assert found.guaranteed
    assert 0.0 < found.constant < 1.0
    assert found.distance <= 1e-7 * (found.energy_norm + FIRST * units)


# ---- the gap ------------------------------------------------------------------------------------------------------


def bent_off_ground(problem: ContactProblem, size: float = 0.6) -> Array:
    """A displacement that crosses kinks within facets, and leaves the ground."""
    x = problem.mesh.nodes(problem.order)
    d = x.shape[1]
    u = size * np.sin(7.0 * (x @ np.arange(1.0, d + 1.0)))[:, None] * np.arange(1.0, d + 1.0)[::-1] / d
    rigid = np.isfinite(problem.contact["bottom"].law.at(None).penetrations.upper).all()
    u[:, -1] = np.abs(u[:, -1]) if rigid else u[:, -1]
    return np.asarray(u)


def traces_of(law: VectorLaw, order: int = 1) -> ContactTraces:
    problem = replace(survey("5.1", 3), contact={"bottom": Contact(law)}, order=order)
    found = contact_traces(body_data(problem, bent_off_ground(problem)))
    assert found is not None
    return found


def forces_on(traces: ContactTraces, size: float, seed: int = 3) -> Array:
    """Linear on each facet."""
    nodal = size * np.random.default_rng(seed).normal(size=(len(traces.facets), 2, 2))
    return np.asarray(np.einsum("fqa,fac->fqc", traces.barycentric, nodal))


def summed_gap(traces: ContactTraces, law: VectorLaw, alpha: Array, zeta: Array) -> float:
    """The integral of ``jh(r) + jh*(y) - y . r`` by many points, jh* by the best of a grid: not above the true one."""
    t = ((np.arange(40) + 0.5) / 40)[:, None]
    grid = np.linspace(-1.5, 1.5, 241)
    p = np.stack([one.ravel() for one in np.meshgrid(grid, grid, indexing="ij")], axis=1)

    def raised(at: Array) -> Array:
        return np.asarray(law.at(at).value(at) + 0.5 * (alpha * at**2).sum(axis=1))

    known, whole = raised(p), 0.0
    known[~np.isfinite(known)] = np.inf
    parts = zip(*(values.reshape(-1, 4, 2) for values in (traces.local, zeta)), strict=True)
    for (r, z), size in zip(parts, traces.weights.reshape(-1, 4).sum(axis=1), strict=True):
        if size > 0.0:
            at, y = r[0] + t * (r[1] - r[0]), z[0] + t * (z[1] - z[0]) + alpha * (r[0] + t * (r[1] - r[0]))
            best = np.maximum((y @ p.T - known).max(axis=1) - (y * at).sum(axis=1), -raised(at))
            whole += size * float((best + raised(at)).mean())
    return whole


LAWS = {"glue": (GLUE, np.array([FALLS, RATIO**2 * FALLS])), "formula": (FORMULA, None)}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("weight", [0.05, 2.0, np.inf])
def test_the_gap_is_bounded_from_above_and_not_by_far(name: str, weight: float) -> None:
    law, alpha = LAWS[name]
    traces = traces_of(law)
    if alpha is None:
        alpha = np.array([float(part[0]) for part in law.weak_convexity])
    forces = forces_on(traces, 0.2)
    found = exact_gap(traces, forces) if weight == np.inf else fenchel_gap(traces, forces, weight)
    below = summed_gap(traces, law, alpha, found.multiplier)
    assert below <= float(found.normal_gap.sum())
    # what convexity adds between the corners of parts, by the largest bend of a law
    bend = float(np.abs(np.diff(traces.local, axis=1)).max()) ** 2 * (STIFF * RATIO**2 + float(alpha.max()))
    assert float(found.normal_gap.sum()) <= 1.05 * below + bend / 6.0 * float(traces.weights.sum())


def test_parts_end_at_the_kinks() -> None:
    for law in (GLUE, FORMULA):
        ends = traces_of(law).local.reshape(-1, 4, 2)[:, :2]
        sizes = np.hypot(np.maximum(-ends[..., 0], 0.0), RATIO * ends[..., 1])
        levels = [(ends[..., 0], 0.0)]
        levels += [(ends[..., 1], 0.0)] if law is FORMULA else [(sizes, FIRST), (sizes, LAST)]
        for values, level in levels:
            beyond = np.where(np.abs(values - level) < 1e-9, 0.0, np.sign(values - level))
            assert (beyond.min(axis=1) * beyond.max(axis=1) >= 0.0).all()
            assert (beyond < 0.0).any()
            assert (beyond > 0.0).any() or (law is GLUE and values is levels[0][0])  # it is rigid


@pytest.mark.parametrize("seed", range(4))
def test_quadratic_traces_lie_between_their_control_points(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Along parts that are long, so that the trace bends, against jh* by the best of a grid."""
    monkeypatch.setattr(f"{contact_traces.__module__}._MORE_PARTS", 1)
    traces = traces_of(GLUE, order=2)
    forces = forces_on(traces, 0.6, seed)
    found = fenchel_gap(traces, forces, 0.5)
    alpha = np.array([FALLS, RATIO**2 * FALLS])
    p = np.stack([one.ravel() for one in np.meshgrid(*[np.linspace(-2.5, 2.5, 301)] * 2, indexing="ij")], axis=1)
    p = p[p[:, 0] <= 0.0]
    known = GLUE.at(p).value(p) + 0.5 * (alpha * p**2).sum(axis=1)
    r, zeta = traces.local.reshape(-1, 2), found.multiplier.reshape(-1, 2)
    y, value = zeta + alpha * r, GLUE.at(r).value(r) + 0.5 * (alpha * r**2).sum(axis=1)
    conjugate = np.concatenate([(one @ p.T - known).max(axis=1) for one in np.array_split(y, 8)])
    gap = np.maximum(value + conjugate - (y * r).sum(axis=1), 0.0).reshape(traces.weights.shape)
    below = (traces.weights * gap).sum(axis=1)
    assert (below > 0.0).all()
    assert (below <= found.normal_gap * (1.0 + 1e-9)).all()
    assert (found.normal_gap <= 1.5 * below).all()


@pytest.mark.parametrize("first", [5.0, 0.05])
def test_the_bound_is_that_of_its_parts(first: float) -> None:
    """Glue that stays intact, whose multiplier follows the trace, and glue that softens a little."""
    law = MixedMode(BilinearCohesion(STIFF * first, 0.5 * STIFF * first * (first + 40.0 * STIFF * first), STIFF), 1.0)
    for load in ((0.15, 0.2), (0.02, -0.05), (0.0, 0.4)):
        found = bound(coupled_square(law, load=load))
        parts, left = found.parts, 1.0 - found.constant
        whole = parts.misfit + parts.oscillation + parts.algebraic + parts.contact
        assert found.constant < 0.15
        expected = (whole + np.sqrt(whole**2 + 4.0 * left * parts.gap)) / (2.0 * left)
        assert found.distance == pytest.approx(expected, rel=1e-12)
        assert parts.gap > 0.0


def test_a_multiplier_of_the_law_pays_its_gap() -> None:
    """With constants so large that a force that is off costs nothing, the gap is all that is added."""
    problem = orthotropic_cube(OrthotropicFriction(0.05, ratio=2.0))
    u = hv.solve(problem).displacement
    free = TraceBounds(np.inf, np.inf, np.inf, 1.0, True, "for this test")
    found = exact_distance(problem, u, free)
    whole = found.parts.misfit + found.parts.algebraic
    assert found.parts.gap > 1e-6 * whole**2
    assert found.distance == pytest.approx(0.5 * (whole + np.sqrt(whole**2 + 4.0 * found.parts.gap)), rel=1e-12)


def test_places_of_the_gap_are_within_the_reach() -> None:
    """Beyond it nothing is known of the convexity: the multiplier is that of the law at the displacement."""
    near = replace(FORMULA, reach=0.61)  # of a displacement of up to 0.6
    forces = forces_on(traces_of(FORMULA), 5.0)
    far, kept, own = (
        fenchel_gap(traces_of(FORMULA), forces, 0.1), fenchel_gap(traces_of(near), forces, 0.1),
        exact_gap(traces_of(near), forces),
    )  # fmt: skip
    assert (np.abs(far.multiplier - own.multiplier) > 0.1).any()
    beyond = np.abs(far.multiplier - kept.multiplier).max(axis=2) > 1e-9
    assert beyond.any()
    corners = np.tile([True, True, False, False], beyond.shape[1] // 4)
    assert np.abs(kept.multiplier - own.multiplier)[beyond & corners].max() < 0.1


# ---- the constants ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.4, 1.0, 2.5])
def test_c_takes_the_constant_of_each_component(ratio: float) -> None:
    """Between the eigenvalue of a discrete problem, with its alphas written here, and a little more."""
    falls = FALLS / max(ratio, 1.0) ** 2
    law = MixedMode(
        BilinearCohesion(STIFF * FIRST, 0.5 * STIFF * FIRST * (FIRST + STIFF * FIRST / falls), STIFF), ratio
    )
    found = bound(coupled_square(law))
    fine = hv.discretize(coupled_square(law, 20))
    B, weights = fine.contact.trace, fine.contact.weights
    rows = (weights[:, None] * np.array([falls, ratio**2 * falls])).ravel()
    K, M = fine.stiffness.toarray(), (B.T @ (rows[:, None] * B.toarray()))
    held = np.linalg.inv(np.linalg.cholesky(K))
    least = float(np.linalg.eigvalsh(held @ M @ held.T)[-1])
    assert least * 0.999 <= found.constant <= 1.15 * least
    assert found.unique


def test_one_solution_is_shown_by_the_constant_for_any_two() -> None:
    """At rest the one-sided constant of a law that falls later is small; another solution there may be all the same."""
    for falls, expected in ((0.5, True), (30.0, False)):
        problem = coupled_square(Softening(4.0, 0.5, falls), load=(0.0, -1e-3))
        found = bound(problem)
        assert found.guaranteed == (found.constant < 1.0)
        assert found.guaranteed or not found.unique
        assert found.unique == expected, (falls, found.constant, found.reasons)


# ---- what is told -------------------------------------------------------------------------------------------------


def test_constants_within_a_reach_make_a_condition() -> None:
    found = hv.solve(coupled_square(FORMULA)).certify(exact=True).exact
    assert found is not None
    assert not found.guaranteed
    assert found.conditions == found.reasons
    assert found.conditions == (
        "penetrations of the exact solution are within the reach 2 of the law",
        "slips of the exact solution are within the reach 2 of the law",
    )
    assert "on a condition" in found.brief()
    words = "\n".join(found.lines())
    assert "conditional, no guarantee" in words
    assert "if penetrations of the exact solution are within the reach 2 of the law and slips" in words
    assert "guaranteed" not in words


def test_a_displacement_beyond_the_reach_has_none() -> None:
    near = replace(FORMULA, reach=0.02)
    found = bound(coupled_square(near))
    assert not found.conditions
    assert any("may lie outside of the reach 0.02 of its law" in one for one in found.reasons)


def test_a_mode_that_decides_gives_an_estimate() -> None:
    """c grows by the Lipschitz constant of the tractions over that of the trace."""
    law = ModeDependentGlue(0.2, 0.21, 2.0, BenzeggaghKenane(0.5, 0.51, 2.0))
    problem = coupled_square(law)
    found = bound(problem)
    frozen = bound(coupled_square(law.at_mode(0.5)))
    constants = body_constants(hv.discretize(problem), Workspace())
    state = float(law.at(None).lipschitz[0]) / constants.both
    assert found.constant == pytest.approx(frozen.constant + state, abs=0.02)
    assert np.isfinite(found.distance)
    assert found.reasons == ("how the tractions of the law depend on the mode is known from samples only",)


def test_tractions_that_jump_with_the_mode_have_no_bound() -> None:
    law = ModeDependentGlue(0.2, 0.21, 2.0, BenzeggaghKenane(0.5, 0.51, 0.5))
    problem = coupled_square(law, 2)
    u = np.zeros(problem.mesh.points.shape)
    found = exact_distance(problem, u, body_constants(hv.discretize(problem), Workspace()))
    assert found.distance == np.inf
    assert "the tractions of the law jump with the mode: there is no bound" in found.reasons


def test_friction_in_an_ellipse() -> None:
    """A disc is an ellipse: the bound is nearly that of the law that splits, and grows with neither axis alone."""
    disc = bound(orthotropic_cube(OrthotropicFriction(0.05)))
    split = bound(
        replace(orthotropic_cube(OrthotropicFriction(0.05)), contact={"bottom": Contact(Compliance(5.0), Tresca(0.05))})
    )
    assert disc.guaranteed
    assert disc.distance == pytest.approx(split.distance, rel=0.02)
    turned = bound(orthotropic_cube(OrthotropicFriction(0.05, ratio=2.0, axis=(1.0, 0.0, 0.0))))
    same = bound(orthotropic_cube(OrthotropicFriction(0.1, ratio=0.5, axis=(0.0, 1.0, 0.0))))
    assert turned.guaranteed
    assert turned.distance == pytest.approx(same.distance, rel=1e-9)
    assert turned.distance != pytest.approx(disc.distance, rel=1e-4)


@pytest.mark.parametrize(
    ("friction", "words"),
    [
        (OrthotropicFriction(CoulombBound(0.3), ratio=2.0), "depends on the pressure"),
        (
            OrthotropicFriction(PenetrationBound(([0.0, 1.0], [0.0, 0.1])), ratio=2.0),
            "how the friction bound depends on the penetration is evaluated at quadrature points",
        ),
        (OrthotropicFriction(0.05, ratio=lambda x: 1.0 + x[:, 0]), "varies along the boundary (ratio)"),
    ],
)
def test_why_it_is_no_bound(friction: OrthotropicFriction, words: str) -> None:
    found = bound(orthotropic_cube(friction))
    assert not found.guaranteed
    assert sum(words in one for one in found.reasons) == 1
    assert len(found.reasons) == 1


def test_glue_that_varies_is_an_estimate() -> None:
    varying = MixedMode(BilinearCohesion(0.2, 0.1, 2.0), ratio=lambda x: 1.0 + x[:, 0])
    found = bound(coupled_square(varying))
    assert np.isfinite(found.distance)
    assert any("varies along the boundary (ratio)" in one for one in found.reasons)


# ---- tasks --------------------------------------------------------------------------------------------------------


def test_meshes_are_refined_until_a_bound_is_as_asked() -> None:
    found = solve_adaptive(coupled_square(), rtol=0.1)
    assert found.reached
    assert len(found.levels) > 1
    assert found.distance.guaranteed
    conditional = solve_adaptive(coupled_square(FORMULA), rtol=0.3)
    assert conditional.ended is AdaptiveEnd.ESTIMATED
    assert "it is at most that if penetrations of the exact solution are within the reach 2" in conditional.remedy


def test_quantities_of_interest_have_intervals() -> None:
    problem = coupled_square(replace(GLUE, compression=Compliance(5.0)), 6)  # what is rigid has no bound at the support
    for goal in ("contact.bottom.force", "boundary.top.displacement"):
        found = solve_adaptive(problem, rtol=1e-9, goal=goal, max_unknowns=50).goal
        fine = solve_adaptive(problem, rtol=1e-9, goal=goal, max_unknowns=1000).goal
        assert found is not None
        assert fine is not None
        assert found.guaranteed
        assert (found.lower <= fine.corrected).all()
        assert (fine.corrected <= found.upper).all()
        assert (np.abs(found.corrected - fine.corrected) <= found.spread).all()


def test_a_study_has_bounds() -> None:
    found = hv.study(coupled_square(), 2, exact=True)
    assert np.isfinite(found.bounds).all()
    assert found.kind_of_bound == "guaranteed bound"
    assert (found.errors("energy")[:-1] <= found.bounds[:-1]).all()
    conditional = hv.study(coupled_square(FORMULA), 1, exact=True)
    assert conditional.kind_of_bound == "conditional bound"
    assert conditional.levels[0].conditions
    assert "conditional bound: if penetrations" in repr(conditional)
    assert (conditional.errors("energy")[:-1] <= conditional.bounds[:-1]).all()


def test_scalar_laws_that_are_known_within_a_reach_have_conditions_too() -> None:
    """``r^2 - exp(r)`` falls ever faster; a gap at places beyond the reach is none."""
    law = FormulaLaw("r^2 - exp(r)", reach=1.0)
    found = bound(coupled_square(law, load=(0.01, -0.05)))
    assert found.conditions == ("penetrations of the exact solution are within the reach 1 of the law",)
    assert np.isfinite(found.distance)
    problem = coupled_square(law, 3)
    traces = contact_traces(body_data(problem, bent_off_ground(problem)))
    assert traces is not None
    for size, weight, within in ((0.01, 1e3, True), (50.0, 0.1, False)):
        forces = np.full(traces.local.shape, size)
        assert np.isfinite(fenchel_gap(traces, forces, weight).normal_gap).all() == within
