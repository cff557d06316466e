"""What a solve returns: displacement, multiplier, status, residual, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.defined_above import above
from hemivar.basics.display import ReprMixin
from hemivar.basics.first_use import cached_property
from hemivar.basics.pandas_frame import data_frame
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, Record
from hemivar.basics.units import Units
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import ProblemError
from hemivar.fem.contact_basis import nodal_depths
from hemivar.fem.fields import strain, stress, von_mises
from hemivar.fem.reactions import plate_motions, support_reactions
from hemivar.fem.small_strain import Deformation, deformation_of, slid_beyond
from hemivar.fem.stress_stiffness import stiffens, works_of_stress
from hemivar.laws.vector_law import splits
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers.boundary_result import BoundaryResult, ContactValues, contact_table, table_columns
from hemivar.solvers.contact_states import ContactStates, contact_states, state_words
from hemivar.solvers.controls import Progress
from hemivar.solvers.status import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from hemivar.certificates.certificate import Certificate
    from hemivar.report.summary import Summary
    from hemivar.systems.workspace import Workspace

__all__ = ["Solution"]


@dataclass(frozen=True, eq=False)
class Solution(ContactValues, PickleMixin, ReprMixin):
    """Displacement and multiplier of a discrete problem, with how they were obtained.

    Attributes
    ----------
    problem : DiscreteProblem
        What was solved.
    unknowns : array (n,)
        The unknowns u of ``problem``.
    multiplier : array (m, d)
        Force per area of the body on the foundation at each contact point: pressure (column 0), and minus the friction.
    status : Status
        How the solve ended; ``status.remedy`` says what to do.
    residual : Residual
        The residual, evaluated at this pair on the full problem.
    method : str
        Name of the method.
    steps, evaluations : int
        Steps of the method, and evaluations of energy, gradient or system that they took.
    history : tuple of Progress
        One entry for each step.
    timings : mapping
        Seconds for each stage: ``condense``, ``iterate``, ``recover``.
    error_bound : float or None
        Where the method certifies its end point: bound of the distance to the exact discrete solution in the
        energy norm ``sqrt(v'Kv)``.
    contraction : float or None
        Contraction factor measured by the outer fixed point, where the law depends on the solution.
    kind : PointKind or None
        What kind of stationary point it is, where it was determined.
    fallbacks : int
        Steps that were not full Newton steps, in the method :class:`hemivar.solvers.SemismoothNewton`: it damped them,
        or froze the friction bound. 0 for other methods; a large number beside ``steps`` tells of a hard problem.
    carried : (float, float) or None
        Where the foundation does not carry the load: the part of it up to which equilibria were found while it grew
        from zero, and the next part, at which none was found.
    remarks : tuple of str
        Which method took over from which, and why; and that a state with less energy exists.  Part of :attr:`warnings`.

    Examples
    --------
    >>> import hemivar as hv
    >>> solution = hv.solve(hv.gallery.survey("5.1", 8)).raise_for_status()
    >>> solution.displacement.shape, solution.pressure.shape
    ((145, 2), (8,))
    """

    problem: DiscreteProblem
    unknowns: Array
    multiplier: Array
    status: Status
    residual: Residual
    method: str
    steps: int = 0
    evaluations: int = 0
    history: tuple[Progress, ...] = ()
    timings: Mapping[str, float] = field(default_factory=dict)
    error_bound: float | None = None
    contraction: float | None = None
    kind: PointKind | None = None
    fallbacks: int = 0
    carried: tuple[float, float] | None = None
    remarks: tuple[str, ...] = ()

    @cached_property
    def displacement(self) -> Array:
        """Nodal displacement (nodes, d) of the mesh, or the unknowns (n,) of a problem made of arrays."""
        return self.unknowns if self.problem.field is None else self.problem.field.full(self.unknowns)

    @cached_property
    def deformation(self) -> Deformation | None:
        """Largest strain and rotation, see :func:`hemivar.fem.deformation`; None for arrays and scalar problems."""
        return deformation_of(self.problem, self.unknowns)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the numbers do not show by themselves, such as locking or large strains; one sentence each."""
        strained = None if self.deformation is None else self.deformation.warning
        slid = slid_beyond(self.problem, self.unknowns)
        return tuple(message for message in (*self.problem.notes, *self.remarks, strained, slid) if message is not None)

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try: that of the status, with what is known of this problem."""
        if self.carried is None:
            return self.status.remedy
        low, high = self.carried
        message = f"while the load grew from zero equilibria were found up to {low:.4g} of it, and none at {high:.4g}"
        advice = f"apply a part of it, `hemivar solve --load-factor {low:.4g}`"
        if stiffens(self.problem):
            return f"the stress of the load and the answer do not settle: {message}; {advice}"
        law = self.problem.law
        if self.contact.components > 2 or law.state_dependent or not splits(law):
            return f"{message}; {advice}"
        return f"{message}; {advice}, or follow the path beyond, `hemivar path` (hemivar.follow_path)"

    @cached_property
    def energy(self) -> float:
        """E(u), in units of work; a friction bound that depends on the state is taken at this very pair, and so is the
        stress that stiffens a body."""
        energy, stated = self.problem.energy(self.unknowns, self.multiplier), self.problem.origin
        if stated is None or not stiffens(self.problem):
            return energy
        return energy + 0.5 * works_of_stress(stated, self.displacement)[0]

    @property
    def contact(self) -> ContactPoints:  # type: ignore[override]
        """The contact points of the problem."""
        return self.problem.contact

    @property
    def gap(self) -> Array:  # type: ignore[override]
        """Distance between body and foundation along the normal at each contact point, (m,)."""
        return nodal_depths(self.problem, self.problem.gap)

    @cached_property
    def penetration(self) -> Array:  # type: ignore[override]
        """u_nu - g at each contact point, (m,); positive into the foundation."""
        return nodal_depths(self.problem, self.local[:, 0])

    @cached_property
    def local(self) -> Array:  # type: ignore[override]
        """Local displacement r = B u - g, shape (m, d): penetration and slip, as contact sees them."""
        return self.problem.local(self.unknowns)

    @cached_property
    def states(self) -> ContactStates:  # type: ignore[override]
        """The normal and the tangential state of the contact points, see :func:`hemivar.solvers.contact_states`."""
        sizes = (float(np.abs(values).max(initial=0.0)) for values in (self.local, self.multiplier))
        moved, pressed = self.problem.vectors.largest(*sizes).tolist()
        return contact_states(
            self.problem.law, self.local, self.multiplier, (moved, pressed),
            without_friction=self.contact.without_friction,
        )  # fmt: skip

    def strain(self) -> Array:
        """Linearised strain of each cell, shape (M, d, d), at the centroid for order 2.

        Raises
        ------
        ProblemError
            The problem was not discretised from a :class:`hemivar.ContactProblem`.
        """
        return strain(self._elastic("strain"), self.displacement)

    def stress(self) -> Array:
        """Stress of each cell, shape (M, d, d), at the centroid for order 2; in the plane for plane models.

        :func:`hemivar.fem.nodal_average` makes values at the nodes of it.

        Raises
        ------
        ProblemError
            As :meth:`strain`.
        """
        return stress(self._elastic("stress"), self.displacement)

    def von_mises(self) -> Array:
        """Von Mises stress of each cell, shape (M,), the stress out of the plane included.

        Raises
        ------
        ProblemError
            As :meth:`strain`.
        """
        return von_mises(self._elastic("von Mises stress"), self.displacement)

    def _elastic(self, what: str) -> ContactProblem:
        """What the problem was made of, if it has a material."""
        origin = self.problem.origin
        if origin is not None and not origin.kind:
            return origin
        made = "made of arrays" if origin is None else "a scalar problem"
        raise ProblemError(f"there is no {what}: the problem is {made}; state a ContactProblem with a material")

    def summary(self, certificate: Certificate | None = None, units: Units | None = None) -> Summary:
        """What ``hemivar solve`` prints: status, energy, forces and states; with a certificate also what it says.

        Units stand behind the numbers, those of the statement by default; the numbers are not converted.
        """
        summary: Summary = above("Solution.summary")(self, certificate, units)
        return summary

    @property
    def measured(self) -> str:
        """What :attr:`contact_length` is: a "length", an "area" or a "volume"; a "measure" where it is a sum of two."""
        stated = self.problem.origin
        if stated is not None and 0 < len(stated.areas) < len(stated.contact):
            return "measure"
        if stated is not None:
            further = bool(stated.areas) or stated.kinematics.ring
            return ("length", "area", "volume")[stated.mesh.dim - 2 + further]
        return "area" if self.problem.contact.components == 3 else "length"

    def certify(
        self,
        *,
        tolerance: float = 1e-8,
        trace_constant: bool = True,
        max_time: float = math.inf,
        workspace: Workspace | None = None,
        exact: bool = False,
    ) -> Certificate:
        """What is known about this solution, see :func:`hemivar.certify`."""
        certificate: Certificate = above("Solution.certify")(
            self,
            tolerance=tolerance,
            trace_constant=trace_constant,
            max_time=max_time,
            workspace=workspace,
            exact=exact,
        )
        return certificate

    def __repr__(self) -> str:
        problem = self.problem
        ended = f"{self.status.value} after {self.steps} steps, relative residual {self.residual.relative:.1e}"
        lines = [f"Solution of {problem.unknowns} unknowns by {self.method}", f"status      {ended}"]
        lines.append(f"energy      {self.energy:.10g}" + (f", {self.kind.value}" if self.kind else ""))
        if problem.contact_points:
            lines.append(f"contact     {problem.contact_points} points: {state_words(*self.states.counts)}")
            lines.append(f"            {_depth(self)}, normal force {self.normal_force:.6g}")
        return "\n  ".join([*lines, *(f"warning     {sentence}" for sentence in self.warnings)])

    @cached_property
    def debonding(self) -> Mapping[str, Array]:  # type: ignore[override]
        """``damage``, ``dissipated`` and, of mixed-mode glue, ``mode_ratio`` of each contact point; else empty."""
        own = self.problem.law.debonding(self.local) if self.problem.contact_points else {}
        unknown = np.full(self.problem.contact_points, np.nan)
        return {name: own.get(name, unknown) for name in self.problem.vectors.named(own)}

    def on(self, boundary: str) -> BoundaryResult:
        """Displacements and forces on one contact boundary.

        Raises
        ------
        ProblemError
            There is no contact boundary of that name, or the problem was made of arrays without names.
        """
        index = self.contact.on(boundary)
        points = self.contact.take(index)
        return BoundaryResult(
            boundary,
            index,
            points,
            self.gap[index],
            self.penetration[index],
            self.local[index],
            self.multiplier[index],
            self.states.take(index),
            {name: values[index] for name, values in self.debonding.items()},
        )

    @cached_property
    def contact_forces(self) -> Mapping[str, Array]:
        """Force on each boundary by what it touches, by name, in the coordinates of the mesh.

        Of two bodies that touch each other, both sides are there, with opposite forces.
        """
        return MappingProxyType(self.contact.forces(self.contact.weights[:, None] * self.tractions))

    @cached_property
    def reactions(self) -> Mapping[str, Array]:
        """Force of each support on the body, by name, in the coordinates of the mesh.

        Loads, contact forces and reactions add up to zero; see :func:`.support_reactions`, also for nodes of
        several supports.

        Raises
        ------
        ProblemError
            The problem was made of arrays, or its load is not the one that was stated.
        """
        return MappingProxyType(support_reactions(self.problem, self.displacement, self.multiplier))

    @cached_property
    def plates(self) -> Mapping[str, Mapping[str, float]]:
        """Motions of the rigid plates, and force and moment with which they act on the body; see
        :func:`.plate_motions`."""
        return MappingProxyType(plate_motions(self.problem, self.displacement, self.multiplier))

    @cached_property
    def contact_table(self) -> NDArray[np.void]:
        """One row for each contact point, a structured array (m,).

        Fields: ``boundary`` (name), ``x`` and ``normal`` (vectors), ``weight``, ``gap``, ``penetration``, ``slip``,
        ``pressure``, ``friction`` (it and ``slip`` in local components: numbers in 2D), ``normal_state`` ("open",
        "contact", "bonded", "softening", "debonded"), ``tangential_state`` ("free", "stick", "slip") and ``force``
        (vector; of the foundation on the body).  What is not known of a problem made of arrays, and what a law of one
        component lacks, is left out.
        """
        return contact_table(self)

    def to_dataframe(self) -> DataFrame:
        """The :attr:`contact_table` as a pandas DataFrame, a column for each component of a vector.

        Raises
        ------
        ProblemError
            pandas is not installed.
        """
        return data_frame(table_columns(self.contact_table), "solution.contact_table, which needs numpy only")

    def to_dict(self) -> Record:
        """Plain numbers, lists and strings, see :func:`hemivar.files.solution_record`."""
        record: Record = above("Solution.to_dict")(self)
        return record

    def to_json(self, path: str | Path, arrays: str | Path | None = None) -> Path:
        """Write :meth:`to_dict` to a file; returns its path.  :func:`hemivar.files.read_solution` reads it back.

        ``arrays``: a second file ``.npz`` for the arrays, which a large solution has no place for in a text.
        """
        written: Path = above("Solution.to_json")(self, path, arrays=arrays)
        return written

    def to_vtu(self, path: str | Path) -> Path:
        """Write the body, and its contact boundaries to a second file; see :func:`hemivar.files.write_vtu`."""
        written: tuple[Path, ...] = above("Solution.to_vtu")(self, path)
        return written[0]

    def plot(
        self, *, scale: float | Literal["auto"] = 1.0, title: str | None = None, unit: str = "", stress_unit: str = ""
    ) -> Figure:
        """The figure of the deformed body, see :func:`hemivar.report.plot_solution`, which has more options.

        Of a problem without a mesh it is that of the contact points, :func:`hemivar.report.plot_contact`.
        """
        figure: Figure = above("Solution.plot")(self, scale=scale, title=title, unit=unit, stress_unit=stress_unit)
        return figure

    def raise_for_status(self) -> Solution:
        """This solution, or an error with the remedy if the solve did not converge."""
        if self.status is not Status.CONVERGED:
            raise ProblemError(
                f"{self.method}: {self.status.value} after {self.steps} steps, relative residual "
                f"{self.residual.relative:.1e}: {self.remedy}"
            )
        return self


def _depth(solution: Solution) -> str:
    """The largest penetration, or of glue the largest opening."""
    r = solution.penetration
    return f"opening at most {-r.min():.4g}" if solution.debonding else f"penetration at most {r.max():.4g}"
