"""The likeliest mistakes in Python: each is understood, or answered by one sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import ContactLaw
from hemivar.solvers import transfer_solution
from tests.problems import square

PROBLEM = square(n=2)
DISCRETE = hv.discretize(PROBLEM)
SOLUTION = hv.solve(DISCRETE)
U, LAM = SOLUTION.unknowns, SOLUTION.multiplier
K, F, B, W, G = (
    DISCRETE.stiffness,
    DISCRETE.load,
    DISCRETE.contact.trace,
    DISCRETE.contact.weights,
    DISCRETE.gap,
)


def changed(**changes: Any) -> hv.ContactProblem:
    return replace(PROBLEM, **changes)


MISTAKES: list[tuple[Callable[[], object], str]] = [
    (lambda: hv.solve("problem.toml"), "solve: the problem is 'problem.toml'; give a ContactProblem.*read_problem"),
    (lambda: hv.solve(PROBLEM.mesh), "solve: the problem is a Mesh; give a ContactProblem"),
    (
        lambda: hv.solve(DISCRETE, "multgrid"),
        r"method 'multgrid' is not known; did you mean 'multigrid'\?",
    ),
    (lambda: hv.solve(DISCRETE, "newton", rtol=2.0), "Controls.rtol is 2; it must be at most 0.1"),
    (lambda: hv.solve(DISCRETE, rtol="small"), "Controls.rtol is 'small'; it must be a number >= 0"),
    (lambda: hv.solve(DISCRETE, hv.solvers.NonsmoothNewton), r"is the class NonsmoothNewton; .*NonsmoothNewton\(\)"),
    (lambda: hv.solve(DISCRETE, hv.Controls()), "controls are given instead of the method; pass them by name"),
    (lambda: hv.solve(DISCRETE, 1e-6), "the method is 1e-06; pass NonsmoothNewton"),
    (lambda: hv.solve(DISCRETE, None, {"rtol": 1e-6}), r"controls is a dict; pass Controls\(rtol"),
    (lambda: hv.solve(DISCRETE, None, 1e-6), r"controls is 1e-06; pass Controls\(rtol"),
    (
        lambda: hv.solve(DISCRETE, None, hv.Controls),
        r"controls is the class Controls; create an instance: Controls\(...\)",
    ),
    (lambda: hv.solve(DISCRETE, initial="zero"), "the initial guess is not an array of numbers: it is text"),
    (lambda: hv.solve(DISCRETE, initial=SOLUTION.displacement), "the initial guess has shape .*transfer_solution"),
    (
        lambda: hv.solve(DISCRETE, workspace=DISCRETE),
        "the workspace is a DiscreteProblem; make one",
    ),
    (lambda: hv.certify(DISCRETE), "certify: no displacement is given; give a solution"),
    (lambda: hv.certify(PROBLEM, U), "certify: the problem is a ContactProblem; give hemivar.discretize"),
    (lambda: hv.certify(SOLUTION, U), "certify: a solution already contains its unknowns"),
    (lambda: hv.certify(DISCRETE, SOLUTION.displacement[1:]), "the displacement has shape"),
    (lambda: hv.certify(DISCRETE, U, SOLUTION.pressure), "the multiplier has shape"),
    (lambda: hv.certify(DISCRETE, U, tolerance="x"), "the tolerance of a certificate is 'x'; give a real number"),
    (lambda: hv.certify(DISCRETE, U, tolerance=-1.0), "the tolerance of a certificate is -1.0; it must be"),
    (
        lambda: hv.certify(DISCRETE, U, factor=hv.systems.condense(DISCRETE)),
        "the factor is a CondensedProblem; .*energy_norm",
    ),
    (
        lambda: hv.discrete.residual(PROBLEM, U, LAM),
        "the problem of the residual is a ContactProblem; discretise it first",
    ),
    (lambda: hv.discrete.residual(DISCRETE, U, SOLUTION.pressure), "the multiplier has shape"),
    (lambda: hv.discrete.residual(DISCRETE, SOLUTION.displacement, LAM), "the displacement has shape"),
    (lambda: hv.find_solutions("p.toml"), "find_solutions: the problem is 'p.toml'"),
    (lambda: hv.find_solutions(DISCRETE, starts=1.5), "starts is 1.5; give a whole number >= 0"),
    (lambda: hv.find_solutions(DISCRETE, starts="many"), "starts is 'many'; give a whole number >= 0"),
    (lambda: hv.find_solutions(DISCRETE, max_solutions=0), "max_solutions is 0; it must be at least 1"),
    (lambda: hv.find_solutions(DISCRETE, seed=-1), "seed is -1; it must be at least 0"),
    (lambda: hv.find_solutions(DISCRETE, controls={}), r"controls is a dict; pass Controls"),
    (lambda: hv.follow_path(DISCRETE, 1.0), r"load_factor must be a pair \(low, high\), such as \(0.0, 1.0\)"),
    (lambda: hv.follow_path(DISCRETE, (0.0, 1j)), "a load factor is 1j; give a real number"),
    (lambda: hv.follow_path(DISCRETE, unloaded=PROBLEM), "the unloaded problem is a ContactProblem; discretise"),
    (lambda: hv.follow_path(DISCRETE, max_points="many"), "max_points is 'many'; give a whole number >= 2"),
    (lambda: hv.follow_path(DISCRETE, largest_step="big"), "largest_step is 'big'; give a real number"),
    (lambda: hv.systems.condense(SOLUTION), "condense: the problem is a Solution; give a ContactProblem"),
    (lambda: hv.solvers.solve_nested(DISCRETE), "the problems are a DiscreteProblem; give a list of them"),
    (lambda: transfer_solution(DISCRETE, DISCRETE), "the solution is a DiscreteProblem; pass what hemivar.solve"),
    (lambda: transfer_solution(SOLUTION, PROBLEM), "the problem is a ContactProblem; discretise it first"),
    (lambda: hv.discretize("problem.toml"), r"what to discretize is 'problem.toml'; .*read_problem\(path\)"),
    (lambda: hv.discretize(DISCRETE), "this problem is already discrete; solve it"),
    (lambda: changed(supports={"left": "clampd"}), r"supports\['left'\] is 'clampd'; did you mean 'clamped'\?"),
    (lambda: changed(material=None), r"material is None; pass Material.lame\(...\)"),
    (lambda: changed(material=hv.Material), "material is the class Material; pass Material.lame"),
    (lambda: changed(material=hv.Material()), "material is a Material; pass Material.lame"),
    (lambda: changed(mesh="mesh.msh"), "mesh is 'mesh.msh'; pass a hemivar Mesh, from read_mesh"),
    (lambda: changed(supports={"left": 1.0}), r"supports\['left'\] is 1.0; pass Clamped\(\)"),
    (lambda: changed(supports={"left": hv.Clamped}), r"supports\['left'\] is the class Clamped; pass Clamped\(\)"),
    (lambda: changed(supports=["left"]), r"supports must map boundary names to conditions, .*; it is a list"),
    (lambda: changed(supports=None), "supports must map boundary names .*; it is None"),
    (lambda: changed(supports={"lefft": hv.Clamped()}), "did you mean 'left'"),
    (lambda: changed(supports={0: hv.Clamped()}), "supports names boundary '0', which the mesh does not have"),
    (lambda: changed(contact={"bottom": hv.Signorini()}), r"contact\['bottom'\] is a Signorini; wrap the law"),
    (lambda: changed(contact=hv.Contact(hv.Signorini())), "contact must map boundary names .*; it is a Contact"),
    (lambda: changed(tractions={"top": 1.0}), r"tractions\['top'\] has shape \(\); on this mesh it needs 2"),
    (lambda: changed(order="2"), "order = '2'; give 1 or 2"),
    (lambda: hv.Contact(hv.Tresca(0.5), hv.Signorini()), "the normal law and the friction law are swapped"),
    (lambda: hv.Contact(hv.Tresca(0.5)), "the normal law must be a superpotential .*, not a Friction"),
    (lambda: hv.Contact(hv.Signorini), "the normal law must be a superpotential .*, not the class Signorini"),
    (lambda: hv.Contact(hv.Signorini(), 0.5), r"must be a Friction such as Tresca\(0.5\), not 0.5"),
    (lambda: hv.Contact(hv.Signorini(), gap="wide"), "gap: formula .*: 'wide' is not known"),
    (lambda: hv.Contact(hv.Signorini(), obstacle=hv.Plane), "obstacle is the class Plane; pass Plane"),
    (lambda: hv.Controls(rtol="1e-9"), "Controls.rtol is '1e-9'; it must be a number >= 0"),
    (lambda: hv.Controls(rtol=None), "Controls.rtol is None; it must be a number >= 0"),
    (lambda: hv.Controls(atol=float("nan")), "Controls.atol is nan; it must be a number >= 0"),
    (lambda: hv.Controls(max_steps=1.5), "Controls.max_steps is 1.5; give a whole number >= 1"),
    (lambda: hv.Controls(callback="print"), "Controls.callback is 'print'; give a function"),
    (
        lambda: hv.solvers.FixedPoint("newton"),
        r"FixedPoint.inner is 'newton'; pass a method such as NonsmoothNewton\(\)",
    ),
    (
        lambda: hv.solvers.FixedPoint(hv.solvers.NonsmoothNewton),
        "FixedPoint.inner is the class NonsmoothNewton; create an instance",
    ),
    (lambda: hv.solvers.LoadStepping(inner="newton"), "LoadStepping.inner is 'newton'; pass a method"),
    (lambda: hv.solvers.LoadStepping(steps="many"), "LoadStepping.steps is 'many'; give a whole number >= 1"),
    (lambda: hv.survey.PrimalDualActiveSet("exact"), r"PrimalDualActiveSet.inner is 'exact'; pass ExactInner\(\)"),
    (lambda: DISCRETE.with_(law=hv.Signorini()), r"the law of a discrete problem is a Signorini; pass ContactLaw"),
    (lambda: hv.DiscreteProblem.of_arrays(K, F, B, W, G, hv.Contact(hv.Signorini())), "is a Contact; pass ContactLaw"),
    (lambda: DISCRETE.energy(SOLUTION.displacement), r"the unknowns have shape \(13, 2\); this problem has \(20,\)"),
    (lambda: DISCRETE.contact_force(SOLUTION.pressure), "the multiplier has shape"),
    (lambda: hv.Material.by_region([hv.Material.lame(1.0, 1.0)]), "by_region takes a mapping .*, not a list"),
    (lambda: hv.Material.young(0.3, 210e3), "material constant nu = 210000; it must lie between -1 and 0.5"),
]


@pytest.mark.parametrize(("mistake", "words"), MISTAKES, ids=[words[:40] for _, words in MISTAKES])
def test_a_mistake_is_answered_by_a_sentence(mistake: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words) as caught:
        mistake()
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 400
    assert not re.search(r"object at 0x|array\(", text)


def test_a_statement_is_discretised_where_a_discrete_problem_is_asked_for() -> None:
    np.testing.assert_array_equal(hv.solve(PROBLEM).unknowns, U)
    np.testing.assert_array_equal(hv.systems.condense(PROBLEM).matrix, hv.systems.condense(DISCRETE).matrix)
    assert hv.certificates.smallness(PROBLEM) == hv.certificates.smallness(DISCRETE)
    np.testing.assert_array_equal(hv.find_solutions(PROBLEM).energies, hv.find_solutions(DISCRETE).energies)
    np.testing.assert_array_equal(hv.follow_path(PROBLEM).load_factor, hv.follow_path(DISCRETE).load_factor)
    np.testing.assert_array_equal(hv.solvers.solve_nested([PROBLEM])[0].unknowns, U)


def test_a_solution_is_certified() -> None:
    expected = hv.certify(DISCRETE, U, LAM).record()
    for found in (hv.certify(SOLUTION), hv.certify(DISCRETE, SOLUTION), hv.certify(DISCRETE, SOLUTION, LAM)):
        record = found.record()
        assert {**record, "seconds": 0.0} == {**expected, "seconds": 0.0}


def test_numbers_of_numpy_are_numbers() -> None:
    assert hv.Controls(rtol=np.float32(1e-6), max_steps=np.int64(3)).max_steps == 3
    assert hv.solvers.LoadStepping(steps=np.int32(2)).steps == 2
    assert len(hv.find_solutions(DISCRETE, starts=np.int64(1), enumerate_up_to=np.int64(0))) >= 1


def test_a_method_by_its_name_is_the_method_with_its_standard_options() -> None:
    named = hv.solve(PROBLEM, method="multigrid", rtol=1e-11)
    made = hv.solve(PROBLEM, hv.solvers.NonsmoothMultigrid(), hv.Controls(rtol=1e-11))
    assert named.method == made.method == "multigrid"
    np.testing.assert_array_equal(named.unknowns, made.unknowns)
    loose = hv.solve(
        PROBLEM, method="multigrid", controls=hv.Controls(rtol=1e-11, max_steps=1), max_steps=40, rtol=1e-2
    )
    assert (loose.status, loose.steps) == (hv.Status.CONVERGED, 2)


def test_a_method_by_its_name_is_suited_to_a_bound_that_depends_on_the_solution() -> None:
    coulomb = changed(contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3))})
    assert hv.solve(coulomb, method="newton").status is hv.Status.CONVERGED
    with pytest.raises(hv.errors.MethodError, match="wrap the method"):
        hv.solve(coulomb, hv.solvers.NonsmoothNewton())


def test_supports_in_words_are_those_of_the_file() -> None:
    words = changed(supports={"left": "clamped", "right": "roller"})
    assert words.supports == {"left": hv.Clamped(), "right": hv.Roller()}


def test_the_right_arguments_pass() -> None:
    law = ContactLaw(hv.Signorini(), hv.Tresca(0.5))
    assert DISCRETE.with_(law=law).law is law
    assert (
        hv.solve(DISCRETE, hv.solvers.METHODS["newton"], hv.Controls(), initial=SOLUTION).status is hv.Status.CONVERGED
    )
