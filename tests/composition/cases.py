"""The levels of each factor, and the problem that a combination of them states."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import skfem
from skfem.helpers import ddot, div, dot, sym_grad, trace

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import Quadratic
from hemivar.fem import FormBody, FormProblem
from hemivar.laws import (
    BenzeggaghKenane,
    BilinearCohesion,
    CoupledFormulaLaw,
    CoupledFunctionLaw,
    ExponentialCohesion,
    FinitePenetration,
    Friction,
    FunctionLaw,
    MixedMode,
    ModeDependentGlue,
    NoContact,
    NoFriction,
    OrthotropicFriction,
    PenetrationBound,
    PenetrationMemory,
    PlasticBond,
    SawTooth,
    Secant,
    SlipSum,
    Superpotential,
    VectorLaw,
    ViscousFoundation,
    Wear,
)
from hemivar.laws.named import LawEntry
from hemivar.laws.registry import COUPLED_LAWS, MEMORIES, NORMAL_LAWS
from hemivar.mechanics import ContactProblem, ScalarContact
from hemivar.mesh import Mesh

__all__ = [
    "BESIDE",
    "BODIES",
    "COUPLED",
    "FORMS",
    "FRICTIONS",
    "GLUES",
    "NORMALS",
    "SCALAR",
    "TIMED",
    "Problem",
    "Row",
    "at_rest",
    "problem_of_row",
]

Problem = ContactProblem | hv.DiscreteProblem | FormProblem


def _spring(r: Array) -> Array:
    return np.asarray(10.0 * np.maximum(r, 0.0) ** 2 + 20.0 * np.maximum(r, 0.0))


def _slope(r: Array) -> Array:
    return np.asarray(np.where(r > 0.0, 20.0 * np.maximum(r, 0.0) + 20.0, 0.0))


def _tied(r: Array, s: Array) -> Array:
    return np.asarray(10.0 * r**2 + 5.0 * s**2 + 2.0 * r**2 * s**2)


def _tied_slopes(r: Array, s: Array) -> tuple[Array, Array]:
    return 20.0 * r + 4.0 * r * s**2, 10.0 * s + 4.0 * r**2 * s


#: Normal laws, each family once, with stiffness well below that of the bodies where they soften: one solution.
NORMALS: dict[str, Superpotential | VectorLaw] = {
    "signorini": hv.Signorini(),
    "compliance": hv.Compliance(20.0, 2.0),
    "softening": hv.Softening(20.0, 0.02, 2.0),
    "adhesive": hv.Adhesive(20.0, 0.4, 2.0, compression=50.0),
    "cohesion": ExponentialCohesion(0.4, 0.05, 20.0),
    "saw-tooth": SawTooth([20.0], [0.02]),
    "table": hv.table_law([0.0, 0.02, 0.1], [0.0, 0.4, 0.5]),
    "formula": hv.FormulaLaw("10 * max(r, 0)^2 + max(r, 0)^3", reach=1.0),
    "function": FunctionLaw(derivative=_spring, curvature=_slope),
    "mixed-mode": MixedMode(BilinearCohesion(0.4, 0.05, 20.0), 1.5),
    "mode-dependent": ModeDependentGlue(0.4, 1.5, 20.0, BenzeggaghKenane(0.05, 0.1, 2.0)),
    "coupled-formula": CoupledFormulaLaw("10*r^2 + 5*s^2 + 2*r^2*s^2", reach=1.0),
    "coupled-function": CoupledFunctionLaw(_tied, _tied_slopes, reach=1.0),
    "finite": FinitePenetration(20.0, 0.05),
    "bilateral": hv.laws.Bilateral(),
    "none": NoContact(),
}
#: Laws and memories by name that another family stands for.
LIKE = {
    "survey": "compliance", "capped": "saw-tooth", "layered": "saw-tooth", "pressure-table": "table",
    "bolt": "bilateral", "bonding": "bond", "rate-and-state": "slip sum",
}  # fmt: skip


def _others(entries: Mapping[str, LawEntry], known: Collection[str]) -> dict[str, Any]:
    """Those by name that stand in no level, with the values that they are shown with."""
    more = [entry for name, entry in entries.items() if name not in LIKE and name not in known]
    return {
        entry.name: entry.make(**entry.example).at(np.zeros((1, 2)))  # type: ignore[attr-defined]
        for entry in more
        if entry.example is not None
    }


#: Those of the opening and the slip together, and those that hold a body that is drawn off.
COUPLED = ("mixed-mode", "mode-dependent", "coupled-formula", "coupled-function", *_others(COUPLED_LAWS, NORMALS))
NORMALS |= _others(NORMAL_LAWS | COUPLED_LAWS, {*NORMALS, *(law.name for law in NORMALS.values())})
GLUES = ("adhesive", "cohesion", "saw-tooth", *COUPLED)

FRICTIONS: Mapping[str, Friction] = {
    "none": NoFriction(),
    "tresca": hv.Tresca(0.05),
    "coulomb": hv.Coulomb(0.2),
    "weakening": hv.SlipWeakening(0.05, 0.02, 5.0, of="rate"),
    "bound": Friction(PenetrationBound("min(2*s, 0.1)")),
    "orthotropic": OrthotropicFriction(0.05, ratio=0.5),
}

#: What stands beside the laws in time: memory and damping.
BESIDE: dict[str, Mapping[str, Any]] = {
    "none": {},
    "wear": {"memory": (Wear(0.1),)},
    "creep": {"memory": (ViscousFoundation(20.0),)},
    "penetration": {"memory": (PenetrationMemory(2.0, 0.3),)},
    "slip sum": {"memory": (SlipSum(),)},
    "secant": {"memory": (Secant(),)},
    "rubbing": {"memory": (Secant(friction=0.2),)},
    "bond": {"memory": (PlasticBond(20.0, 20.0, 1e-3, 0.1, 10.0),)},
    "damping": {"damping": hv.Compliance(0.4)},
}
_REMEMBERED = {one.name for beside in BESIDE.values() for one in beside.get("memory", ())}
BESIDE |= {name: {"memory": (memory,)} for name, memory in _others(MEMORIES, _REMEMBERED).items()}
TIMED = tuple(name for name in BESIDE if name != "none")


@dataclass(frozen=True)
class Row:
    """A combination: a level of each factor, by name."""

    task: str
    body: str = "plane"
    normal: str = "compliance"
    friction: str = "none"
    beside: str = "none"

    def __str__(self) -> str:
        return f"{self.task}: {self.body}, {self.normal}, {self.friction}, {self.beside}"


def _plane(contact: hv.Contact, up: float, **more: Any) -> hv.ContactProblem:
    return hv.ContactProblem(
        more.pop("mesh", hv.rectangle((1.0, 1.0), 2)),
        more.pop("material", _steel()),
        {"bottom": contact},
        more.pop("supports", {"left": hv.Clamped()}),
        body_force=(0.1 * up, up),
        **more,
    )


def _steel() -> hv.Material:
    return hv.Material.lame(40.0, 40.0, density=1.0, viscosity=(4.0, 4.0))


def _nonlinear(contact: hv.Contact, up: float) -> hv.ContactProblem:
    softens = hv.Material.hencky(bulk=80.0, shear=40.0, softened=0.25, strain=0.05, density=1.0, viscosity=(4.0, 4.0))
    return _plane(contact, up, material=softens, mesh=hv.rectangle((1.0, 1.0), (2, 1)))


def _space(contact: hv.Contact, up: float, order: int = 1) -> hv.ContactProblem:
    force = (0.1 * up, 0.05 * up, up)
    return hv.ContactProblem(
        hv.box(cells=1), _steel(), {"bottom": contact}, {"left": hv.Clamped()}, body_force=force, order=order
    )


def _parts(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """Two blocks that do not touch each other, each of its own material."""
    one = hv.rectangle((1.0, 1.0), 2)
    points = np.concatenate([one.points, one.points + np.array([2.0, 0.0])])
    cells = np.concatenate([one.cells, one.cells + len(one.points)])
    both = {name: np.concatenate([f, f + len(one.points)]) for name, f in one.boundaries.items()}
    half = np.arange(len(one.cells))
    mesh = Mesh(points, cells, both, {"first": half, "second": half + len(half)})
    soft = hv.Material.lame(20.0, 20.0, density=1.0, viscosity=(2.0, 2.0))
    return _plane(contact, up, mesh=mesh, material=hv.Material.by_region({"first": _steel(), "second": soft}))


def _pair(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """Two blocks whose nodes do not match, the upper one on the lower one."""
    upper, lower = hv.rectangle((1.0, 1.0), (3, 2), origin=(0.0, 1.0)), hv.rectangle((1.0, 1.0), 2)
    return hv.ContactProblem(
        Mesh.assembled({"upper": upper, "lower": lower}),
        _steel(),
        {"upper:bottom": replace(contact, against="lower:top")},
        {"upper:left": hv.Clamped(), "lower:bottom": hv.Clamped()},
        tractions={"upper:top": (0.1 * up, up)},
    )


def _glued(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block that was cut in two, up to an end inside of it."""
    whole = hv.rectangle((1.0, 1.0), (4, 2))
    cut = np.flatnonzero(np.abs(whole.points[:, 1] - 0.5) < 1e-9)
    cut = cut[np.argsort(whole.points[cut, 0])][1:]
    mesh = whole.with_interfaces({"cut": np.column_stack([cut[:-1], cut[1:]])}).opened("cut")
    return hv.ContactProblem(
        mesh,
        _steel(),
        {"cut:1": replace(contact, against="cut:2")},
        {"bottom": hv.Clamped()},
        tractions={"top": (0.1 * up, up)},
    )


def _cracked(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block that was cut in two, in contact on one half of the cut, glued on the other and beside a foundation."""
    whole = hv.rectangle((1.0, 1.0), (4, 2))
    cut = np.flatnonzero(np.abs(whole.points[:, 1] - 0.5) < 1e-9)
    cut = cut[np.argsort(whole.points[cut, 0])]
    joint, crack = np.split(np.column_stack([cut[:-1], cut[1:]]), 2)
    mesh = whole.with_interfaces({"crack": crack, "joint": joint}).opened("crack").opened("joint")
    glue = hv.Contact(NORMALS["mode-dependent"], against="joint:2")
    return hv.ContactProblem(
        mesh,
        _steel(),
        {"crack:1": replace(contact, against="crack:2"), "joint:1": glue, "left": hv.Contact(hv.Compliance(20.0))},
        {"bottom": hv.Clamped()},
        tractions={"top": (0.01 * up, 0.1 * up)},
    )


def _revolved(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A disc whose rim is held; its left side is the axis, and nothing damps it."""
    steel = hv.Material.lame(40.0, 40.0, "axisymmetric", density=10.0)
    return _plane(contact, up, material=steel, supports={"right": hv.Clamped()})


def _resting(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block that nothing but its foundation holds against the load."""
    return _plane(contact, 0.25 * up, supports={"left": hv.Roller()})


def _sprung(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block on springs, one of whose corners is held."""
    supports = {"left": hv.mechanics.Spring(50.0, 50.0), "pin": hv.Fixed(x=0.0, at=(1.0, 1.0))}
    return _plane(contact, up, supports=supports)


def _tied_blocks(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block that is joined for good to another one, whose nodes do not match."""
    upper, lower = hv.rectangle((1.0, 0.5), (3, 1), origin=(0.0, 0.5)), hv.rectangle((1.0, 0.5), (2, 1))
    return hv.ContactProblem(
        Mesh.assembled({"upper": upper, "lower": lower}),
        _steel(),
        {"lower:bottom": contact, "upper:bottom": hv.Contact(hv.laws.Tie(), against="lower:top")},
        {"upper:left": hv.Clamped(), "lower:left": hv.Clamped()},
        body_force=(0.1 * up, up),
    )


def _plated(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """A block under a rigid plate that turns."""
    plate = hv.mechanics.RigidPlate(force=(0.1 * up, up), moment=0.05 * up)
    return _plane(contact, 0.1 * up, supports={"left": hv.Clamped(), "top": plate})


def _membrane(contact: hv.Contact, up: float) -> hv.ContactProblem:
    """On a foundation beneath its middle."""
    mesh = hv.rectangle((1.0, 1.0), 3)
    middle = np.abs(mesh.points[mesh.cells].mean(axis=1) - 0.5).max(axis=1) < 1.0 / 6.0
    regions = {"middle": np.flatnonzero(middle), "rim": np.flatnonzero(~middle)}
    return hv.ScalarProblem(
        replace(mesh, regions=regions),
        40.0,
        area={"middle": ScalarContact(contact.normal, level=0.001)},  # type: ignore[arg-type]
        supports=dict.fromkeys(("left", "right", "bottom", "top"), 0.0),
        source=-up,
        density=1.0,
        viscosity=4.0,
    )


def _antiplane(contact: hv.Contact, up: float) -> hv.ContactProblem:
    return hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 2),
        40.0,
        {"bottom": ScalarContact(contact.friction)},
        supports={"top": 0.0},
        source=up,
        kind="antiplane",  # type: ignore[arg-type]
        density=1.0,
        viscosity=4.0,
    )


def _arrays(contact: hv.Contact, up: float) -> hv.DiscreteProblem:
    found = hv.discretize(_plane(contact, up))
    points = found.contact
    assert isinstance(found.bulk, Quadratic)
    return hv.DiscreteProblem.of_arrays(
        found.bulk.stiffness,
        found.load,
        points.trace,
        points.weights,
        found.gap,
        found.law,
        constant=found.constant,
    )


def _elastic(u: Any, v: Any, w: Any) -> Any:
    return 40.0 * trace(sym_grad(u)) * div(v) + 80.0 * ddot(sym_grad(u), sym_grad(v))


def _viscous(u: Any, v: Any, w: Any) -> Any:
    return 0.1 * _elastic(u, v, w)


def _inert(u: Any, v: Any, w: Any) -> Any:
    return dot(u, v)


def _incompressible(u: Any, p: Any, v: Any, q: Any, w: Any) -> Any:
    return 80.0 * ddot(sym_grad(u), sym_grad(v)) - div(u) * q - div(v) * p


def _pulled(basis: Any, up: float) -> Array:
    return np.asarray(skfem.LinearForm(lambda v, *rest: up * (0.1 * v[0] + v[1])).assemble(basis))


def _form(contact: hv.Contact, up: float) -> FormProblem:
    """Quadrilaterals of scikit-fem."""
    grid = skfem.MeshQuad.init_tensor(*[np.linspace(0.0, 1.0, 3)] * 2)
    mesh = grid.with_boundaries({"left": lambda x: x[0] < 1e-9, "bottom": lambda x: x[1] < 1e-9})
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()))
    forms = {"mass": skfem.BilinearForm(_inert), "viscosity": skfem.BilinearForm(_viscous)}
    body = FormBody(basis, skfem.BilinearForm(_elastic), _pulled(basis, up), {"left": 0.0}, **forms)
    return FormProblem(body, {"bottom": contact})


def _mixed(contact: hv.Contact, up: float) -> FormProblem:
    """An incompressible body with its pressure."""
    grid = skfem.MeshTri.init_tensor(*[np.linspace(0.0, 1.0, 3)] * 2)
    mesh = grid.with_boundaries({"left": lambda x: x[0] < 1e-9, "bottom": lambda x: x[1] < 1e-9})
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP2()) * skfem.ElementTriP1(), intorder=4)
    held = {"left": {"u^1^1": 0.0, "u^2^1": 0.0}}
    return FormProblem(
        FormBody(basis, skfem.BilinearForm(_incompressible), _pulled(basis, up), held), {"bottom": contact}
    )


BODIES: Mapping[str, Callable[[hv.Contact, float], Problem]] = {
    "plane": _plane,
    "quadratic": lambda contact, up: _plane(contact, up, order=2),
    "axisymmetric": _revolved,
    "nonlinear": _nonlinear,
    "space": _space,
    "quadratic tetrahedra": partial(_space, order=2),
    "bedded": lambda contact, up: _plane(contact, up, supports={"left": hv.Roller()}, bedding=50.0),
    "stressed": lambda contact, up: _plane(contact, up, initial_stress=np.diag([0.4, 0.2]), initial_strain="1e-3*x"),
    "resting": _resting,
    "sprung": _sprung,
    "tied": _tied_blocks,
    "plated": _plated,
    "pair": _pair,
    "glued inside": _glued,
    "cracked": _cracked,
    "parts": _parts,
    "membrane": _membrane,
    "antiplane": _antiplane,
    "arrays": _arrays,
    "form": _form,
    "mixed": _mixed,
    "stiffened": lambda contact, up: _plane(contact, up, stiffening=True),
}
#: Bodies by forms of scikit-fem.
FORMS = ("form", "mixed")
SCALAR = ("membrane", "antiplane")


def problem_of_row(row: Row, factor: float = 1.0) -> Problem:
    """The problem of a combination, its load times a factor."""
    contact = hv.Contact(NORMALS[row.normal], FRICTIONS[row.friction], **BESIDE[row.beside])
    return BODIES[row.body](contact, factor * (1.0 if row.normal in GLUES else -1.0))


def at_rest(row: Row, factor: float = 1.0) -> ContactProblem | hv.DiscreteProblem:
    """What is solved."""
    found = problem_of_row(row, factor)
    return found.discrete if isinstance(found, FormProblem) else found
