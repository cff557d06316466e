"""A path of equilibria: its points, folds (limit points), bifurcations and jumps, and why it ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.display import ReprMixin
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.rows import Claim, Column, ResultRows, plain
from hemivar.basics.types import Array, BoolArray, Record
from hemivar.branches.path_quantities import QUANTITIES
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine
from hemivar.fem.contact_basis import nodal_depths
from hemivar.linear.factorisation import factorise
from hemivar.solvers.boundary_result import friction_of
from hemivar.solvers.numbers_by_name import parted

__all__ = ["SAME_LOAD", "Bifurcation", "Fold", "Path", "PathEnd", "PathJump"]


#: Part of the loads by which two load factors may differ and be the same. 1e-8 and 1e-10 give the same paths in
#: tests/branches.
SAME_LOAD = 1e-9
#: Folds, and jumps, up to which all are main ones: so many can be read in a line.
_FEW = 4
#: Part of the span of all fold loads by which the load turns at a main fold. It is a choice, which
#: :attr:`Path.main_folds` states: a front that passes one node after the other turns the load by less.
_TOOTH = 0.1


class PathEnd(StrEnum):
    """Why a path ends where it does; the value is the sentence."""

    UPPER_END = "the upper end of the load factors was reached"
    LOWER_END = "the lower end of the load factors was reached"
    UNTIL = "a quantity reached the value at which the path was to end"
    MAX_POINTS = "the limit of points was reached"
    MAX_TIME = "the time limit was reached"
    INTERRUPTED = "interrupted"
    NOT_UNIQUE = "the path is not unique beyond this point"
    NOT_CORRECTED = "the corrector did not converge"
    UNBOUNDED = "beyond this load no equilibrium was found"


@dataclass(frozen=True)
class Fold:
    """A point where the load turns.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path.
    snaps : bool
        Whether a single contact point lets go there: the slope alpha by which its law falls exceeds the stiffness of
        the body at that point.  Such folds depend on the mesh; see :attr:`Path.snap_size`.
    """

    load_factor: float
    index: int
    snaps: bool = False


@dataclass(frozen=True)
class Bifurcation:
    """A point where other equilibria branch off: a direction in which the energy falls comes or goes, without a fold.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path.
    """

    load_factor: float
    index: int


@dataclass(frozen=True, eq=False)
class PathJump:
    """Where the body leaves a branch when the load is prescribed.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path from which it jumps.
    loading : bool
        Whether it happens while the load grows (else while it falls).
    local : array (m, d) or None
        Local displacement on the stable branch of this path that is met at the same load; None if there is none.
    snaps : bool
        Whether a single contact point lets go there, as in :class:`Fold`.
    interpolated : bool
        Whether ``local`` lies between two points of a curved path and could not be corrected: no solution then.
    """

    load_factor: float
    index: int
    loading: bool
    local: Array | None
    snaps: bool = False
    interpolated: bool = False

    @property
    def words(self) -> str:
        """Where it is, and where it leads."""
        where = ", to no stable branch of this path" if self.local is None else ""
        where = ", to a place that is interpolated" if self.interpolated else where
        how = "loading" if self.loading else "unloading"
        return f"load factor {self.load_factor:.10g} while {how}, point {self.index}{where}"


@dataclass(frozen=True, eq=False)
class Path(PickleMixin, ReprMixin):
    """Equilibria in the order in which they are met.

    Attributes
    ----------
    line : LoadLine
        The problem at each load factor.
    load_factor : array (k,)
    local, multiplier : arrays (k, m, d)
        Local displacement r; force per area of the body on the foundation: pressure (column 0), and minus the friction.
    energy : array (k,)
        E(u) at the load of the point.
    stable : bool array (k - 1,)
        Whether the equilibria between a point and the next are local minimisers.
    curved : bool array (k - 1,)
        Whether the path between them is curved; otherwise r is exactly linear there.
    folds : tuple of Fold
    jumps : tuple of PathJump
    bifurcations : tuple of Bifurcation
        Where the number of negative eigenvalues of the tangent changes though the load does not turn, or by more than
        the fold explains.  The branch that is followed goes on; others are not.
    ended : PathEnd
        Why the path ends where it does, in a sentence.
    perturbed : bool
        Whether several components met an event at once, so that the load was perturbed by 1e-9 of itself to order them;
        the path is then one of several that meet.
    snap_size : float or None
        Weight of a contact point (length of boundary) up to which none lets go alone: the least stiffness of the body
        at a point that does, over the slope by which its law falls.  0 where a law falls at once, None where no point
        lets go alone on this path.
    warnings : tuple of str
        What the numbers do not show by themselves; one sentence each.  Strains and rotations are looked at where the
        load and the contact displacements are largest, and at the end.
    """

    line: LoadLine
    load_factor: Array
    local: Array
    multiplier: Array
    energy: Array
    stable: BoolArray
    curved: BoolArray
    folds: tuple[Fold, ...]
    jumps: tuple[PathJump, ...]
    ended: PathEnd
    bifurcations: tuple[Bifurcation, ...] = ()
    perturbed: bool = False
    snap_size: float | None = None
    warnings: tuple[str, ...] = ()

    @cached_property
    def limit_load(self) -> float | None:
        """The largest load factor of a stable equilibrium of this path; None if it is not known to be the largest.

        That is so where the path leaves the range at its upper end, or was not followed to its end.
        """
        if self.ended not in (PathEnd.LOWER_END, PathEnd.UNBOUNDED) or not self.stable.any():
            return None
        t = self.load_factor
        return float(np.maximum(t[:-1], t[1:])[self.stable].max())

    @cached_property
    def first_instability(self) -> float | None:
        """The load factor at which the body first loses stability while its load grows; None if it does not."""
        lost = np.flatnonzero(self.stable[:-1] & ~self.stable[1:]) + 1
        return float(self.load_factor[lost[0]]) if lost.size and self.stable[0] else None

    @property
    def reached_end(self) -> bool:
        """Whether the path was followed until it left the range of load factors, or to the value asked for."""
        return self.ended in (PathEnd.UPPER_END, PathEnd.LOWER_END, PathEnd.UNTIL)

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped from the keyboard; the points until then are here."""
        return self.ended is PathEnd.INTERRUPTED

    def __repr__(self) -> str:
        t, folds, jumps = self.load_factor, len(self.folds), len(self.jumps)
        size = f"{len(self)} points from load factor {t[0]:.6g} to {t[-1]:.6g}, {folds} folds, {jumps} jumps"
        size += f", {len(self.bifurcations)} bifurcations" if self.bifurcations else ""
        return f"Path({self.failure}; {size}; {self.ended})"

    @cached_property
    def main_folds(self) -> tuple[Fold, ...]:
        """All folds if there are few; else those at limit load and first instability, and the large turns of the load.

        A front that passes one point of the mesh after the other gives a tooth for each of them: turns by less than a
        tenth of the span of all fold loads are such teeth.  So is a fold where a single contact point debonds.
        """
        return self.folds if len(self.folds) <= _FEW else tuple(fold for fold in self.folds if self._matters(fold))

    @cached_property
    def main_jumps(self) -> tuple[PathJump, ...]:
        """The same of the jumps."""
        return self.jumps if len(self.jumps) <= _FEW else tuple(jump for jump in self.jumps if self._matters(jump))

    def _matters(self, event: Fold | PathJump) -> bool:
        tooth = event.snaps or event.index in self._teeth
        return not tooth or event.load_factor in (self.limit_load, self.first_instability)

    @cached_property
    def _teeth(self) -> set[int]:
        """Numbers of the points at which the load turns by little until it turns back."""
        index = np.array([fold.index for fold in self.folds], dtype=np.int64)
        large = _large_turns(self.load_factor[index], _TOOTH)
        return set(index[~large].tolist())

    @property
    def snapping(self) -> str | None:
        """How many folds are those of single contact points, and at which mesh size there are none; None for none."""
        count = sum(fold.snaps for fold in self.folds)
        if not count or self.snap_size is None:
            return None
        limit = self.limit_load
        too = any(fold.snaps and fold.load_factor == limit for fold in self.folds)
        words = f"{count} fold{'s' if count > 1 else ''} where a single contact point debonds: their number and loads"
        words += f"{', and the limit load,' if too else ''} depend on the mesh"
        if self.snap_size == 0.0:
            return f"{words}, however fine, because a law drops discontinuously; give its drop a slope"
        return f"{words}; with cells of at most about {self.snap_size:.2g} along the boundary no point debonds alone"

    @property
    def failure(self) -> str:
        """Limit load and first instability in words, rounded to four digits."""
        limit, first = self.limit_load, self.first_instability
        if limit is not None:
            same = first is None or abs(first - limit) <= SAME_LOAD * abs(limit)
            return f"limit load factor {limit:.4g}" + ("" if same else f" (first instability {first:.4g})")
        own = (
            "not reached"
            if self.ended is PathEnd.UPPER_END
            else "not known, because the path was not followed to its end"
        )
        return f"limit load factor {own}" + ("" if first is None else f" (first instability {first:.4g})")

    def __len__(self) -> int:
        return self.load_factor.size

    @property
    def problem(self) -> DiscreteProblem:
        """The problem at load factor 1."""
        return self.line.loaded

    @cached_property
    def max_penetration(self) -> Array:
        """Largest penetration, (k,)."""
        return np.asarray(nodal_depths(self.problem, self.local[:, :, 0].T).max(axis=0, initial=-np.inf))

    @cached_property
    def normal_force(self) -> Array:
        """Resultant of the pressure, positive in compression, (k,)."""
        return np.asarray(self.multiplier[:, :, 0] @ self.problem.contact.weights)

    @cached_property
    def friction_force(self) -> Array:
        """Resultant of the friction on the body in local components, (k, d - 1)."""
        return np.asarray(np.einsum("m,kmc->kc", self.problem.contact.weights, friction_of(self.multiplier)))

    def reactions(self, support: str) -> Array:
        """Force of a support on the body at each point, (k, d).

        Raises
        ------
        ProblemError
            There is no such support, or the body is not linear.
        """
        problem, line = self.problem, self.line
        named = () if problem.origin is None else problem.origin.supports
        if support not in named:
            raise ProblemError(f"the problem has no support '{support}'{suggest(support, list(named))}")
        if not isinstance(problem.bulk, Quadratic):
            raise ProblemError("forces of supports along a path are those of a linear body; solve at one load instead")
        factor, forces = factorise(problem.bulk.stiffness, np.zeros(0, dtype=np.int64)), []
        if not factor.interior_positive:
            raise ProblemError("forces of supports along a path need supports that hold the body without its contact")
        for t, lam in zip(self.load_factor.tolist(), self.multiplier, strict=True):
            here = line.at(t)
            assert here.field is not None
            u = factor.solve_interior(here.load - here.contact.force(lam))
            forces.append(line.reactions(t, here.field.full(u), lam)[support])
        return np.array(forces)

    def rows(self) -> ResultRows:
        """A row for each point; ``stable`` is of the stretch that begins there, at the last point of the one before."""
        columns = (
            Column("load factor", self.load_factor, "load_factor"),
            Column("energy", self.energy, "energy", unit="energy"),
            Column("stable", np.append(self.stable, self.stable[-1:]), "stable"),
            Column("normal force", self.normal_force, "normal_force", unit="force"),
            Column(None, self.friction_force, "friction_force"),
            Column("max penetration", self.max_penetration, "max_penetration", unit="length"),
        )
        return ResultRows(columns)

    def along(self, quantity: str, local: Array | None = None, multiplier: Array | None = None) -> Array:
        """A quantity by its name, such as ``"max-opening"``, at the points (k,); or at other places and forces.

        ``"support.NAME.force"`` is the size of the force of a support, ``"support.NAME.force.x"`` a component.

        Raises
        ------
        ProblemError
            The quantity is not known.
        """
        if (parts := parted(quantity)) is not None and parts[0] == "support":
            forces, axis = self.reactions(parts[1]), parts[2]
            if axis is not None and axis >= forces.shape[1]:
                raise ProblemError(f"quantity '{quantity}': forces have {forces.shape[1]} components; leave it out")
            return np.asarray(np.linalg.norm(forces, axis=1) if axis is None else forces[:, axis])
        if quantity not in QUANTITIES:
            raise ProblemError(f"quantity '{quantity}' is not known; the quantities are {', '.join(QUANTITIES)}")
        local = self.local if local is None else local
        depth = nodal_depths(self.problem, local[:, :, 0].T).T
        seen = np.concatenate([depth[:, :, None], local[:, :, 1:]], 2)
        pressed = self.multiplier if multiplier is None else multiplier
        return QUANTITIES[quantity].evaluate(self.problem.contact.weights, seen, pressed)

    def record(self, quantity: str = "max-penetration") -> Record:
        """Plain numbers and lists for JSON.

        ``points`` holds for each point its row and ``value``, the chosen ``quantity``. ``folds``, ``bifurcations`` and
        ``jumps`` name points by number; ``single_point`` tells where one contact point lets go alone,
        ``single_point_size`` up to which weight of a point none does; ``interpolated`` that the place after a jump is
        none of a solution.
        """
        values = self.along(quantity).tolist()
        jumps = [
            {
                "load_factor": jump.load_factor,
                "point": jump.index,
                "loading": jump.loading,
                "max_penetration_after": None
                if jump.local is None
                else float(nodal_depths(self.problem, jump.local[:, 0]).max()),
                "interpolated": jump.interpolated,
                "single_point": jump.snaps,
            }
            for jump in self.jumps
        ]
        turns = self.bifurcations
        return {
            "limit_load": self.limit_load,
            "first_instability": self.first_instability,
            "quantity": quantity,
            "points": plain([{**row, "value": value} for row, value in zip(self.rows(), values, strict=True)]),
            "folds": [{"load_factor": f.load_factor, "point": f.index, "single_point": f.snaps} for f in self.folds],
            "bifurcations": [{"load_factor": point.load_factor, "point": point.index} for point in turns],
            "jumps": jumps,
            "single_point_size": self.snap_size,
            "ended": self.ended,
            "perturbed": self.perturbed,
            "warnings": list(self.warnings),
        }

    def claims(self) -> list[Claim]:
        """Its points, folds, branch points, jumps and warnings; :attr:`failure` says where the body fails."""
        count, folds, jumps, depths = len(self.folds), self.main_folds, self.main_jumps, self.max_penetration
        claims = [Claim("path", f"{len(self)} points, {count} folds; {self.ended}")]
        if self.perturbed:
            why = "several contact points changed state at the same load: this is one of several branches"
            claims.append(Claim("", why))
        for label, turns in (("fold", folds), ("bifurcation", self.bifurcations)):
            claims += [Claim(label, f"load factor {t.load_factor:.10g}, point {t.index}", t.load_factor) for t in turns]
        claims += [Claim("jump", jump.words, jump.load_factor) for jump in jumps]
        if self.snapping is not None:
            claims.append(Claim("single points", self.snapping))
        if len(folds) + len(jumps) < count + len(self.jumps):
            claims.append(Claim("", f"(of {count} folds and {len(self.jumps)} jumps in all)"))
        if len(self):
            rounding = 1e-12 * np.abs(depths).max()
            low, high = (0.0 if abs(end) <= rounding else end for end in (depths.min(), depths.max()))
            claims.append(Claim("max penetration", f"{low:.6g} to {high:.6g}"))
        return claims + [Claim("warning", warning) for warning in self.warnings]

    def at(self, load_factor: float) -> list[tuple[Array, bool]]:
        """Local displacements (m, d) where the path crosses a load, in order, and whether they are stable.

        Interpolated linearly: exact where the path is not curved.
        """
        crossings: list[tuple[Array, bool]] = []
        t = self.load_factor
        for i in range(len(self) - 1):
            first = i == 0 or t[i] != load_factor
            between = (t[i] - load_factor) * (t[i + 1] - load_factor) <= 0.0 and t[i] != t[i + 1]
            if between and first:
                part = (load_factor - t[i]) / (t[i + 1] - t[i])
                crossings.append((self.local[i] + part * (self.local[i + 1] - self.local[i]), bool(self.stable[i])))
        return crossings


def _large_turns(loads: Array, part: float) -> BoolArray:
    """Which turning points (k,) are left where neighbours that differ by less than this part of the span go."""
    left = np.arange(loads.size)
    while left.size > 2:
        turns = np.abs(np.diff(loads[left]))
        least = int(np.argmin(turns))
        if turns[least] >= part * np.ptp(loads):
            break
        left = np.delete(left, [least, least + 1])
    return np.isin(np.arange(loads.size), left)
