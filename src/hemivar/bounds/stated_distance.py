"""What a certificate says of the distance to the exact solution: a bound, an estimate with its reasons, or why none."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hemivar.basics.rounding import rounded_up
from hemivar.basics.types import Record

__all__ = ["DistanceToExact"]

#: What a reason may begin with, and the line says already.
_NONE = "there is no bound: "
#: How many times the error a bound may be without a word.
_FAR = 20.0
#: What to do about the part that is most of a bound.
_REMEDIES = {
    "misfit": "refine the mesh, as adaptive refinement does where it is needed",
    "contact": "refine the mesh along the contact boundary, as adaptive refinement does",
    "oscillation": "refine the mesh where the loads vary, or state smoother loads",
    "algebraic": "solve more accurately, with a smaller rtol of [solver]",
    "correction": "put nodes where supports hold them, refine along the contact boundary, or take linear elements",
}
#: What to do where softening makes most of a bound.
_MARGIN = "take a law that softens less, more supports or a stiffer body"


@dataclass(frozen=True)
class DistanceToExact:
    """The distance of a displacement to every solution of the continuous problem, in the energy norm.

    Computed by :func:`hemivar.bounds.exact_certificate.distance_to_exact`.  All but the ratios are in the unit of
    ``|u|_K``.

    Attributes
    ----------
    bound : float
        inf where there is none.
    relative : float
        The same over ``|u_h|_a``.
    guaranteed : bool
        Whether it is a bound, up to rounding and the rules of integration.
    reasons : tuple of str
        Why it is an estimate, or why there is none, one sentence each.
    misfit, contact, oscillation, algebraic : float
        Parts of the bound before the margin divides their sum: what the elements do not resolve, the contact force,
        the loads, and what the displacement lacks for equilibrium.
    gap : float
        The part of contact points that change between pieces of the law, a work.
    constant : float
        c; bounds grow by ``1 / (1 - c)``.
    seconds : float
        Spent on it.
    correction : float
        Added after that division: by how much a quadratic trace had to be moved to keep to a rigid law between nodes.
    geometry : str
        What the body is taken for, such as "a polygon with 4 straight sides": the exact solution is that of this body.
    conditions : tuple of str
        Those under which it is a bound, if nothing else stands between; they are among the reasons.
    unique : bool
        Whether the continuous problem is shown to have exactly one solution.
    unseen : str
        Rigid motions that supports leave to the body, in words.  The bound is one in the seminorm of the energy, which
        does not see them; the laws are convex, and solutions differ by no more than such motions.
    loose : str
        Those of them by which solutions may differ, in words.
    above : float
        How many times the error the bound may be, about, where cells are flat; 0 where they are not.
    """

    bound: float
    relative: float
    guaranteed: bool
    reasons: tuple[str, ...]
    misfit: float = math.nan
    contact: float = math.nan
    oscillation: float = math.nan
    algebraic: float = math.nan
    gap: float = math.nan
    constant: float = math.nan
    seconds: float = 0.0
    correction: float = 0.0
    geometry: str = ""
    conditions: tuple[str, ...] = ()
    unique: bool = False
    unseen: str = ""
    loose: str = ""
    above: float = 0.0

    @classmethod
    def none(cls, reason: str, seconds: float = 0.0) -> DistanceToExact:
        """Nothing is known, for a reason."""
        return cls(math.inf, math.inf, False, (reason,), seconds=seconds)

    @property
    def known(self) -> bool:
        """Whether there is a bound or an estimate."""
        return math.isfinite(self.bound)

    @property
    def why(self) -> str:
        """The reasons in one line."""
        return "; ".join(self.reasons)

    def brief(self) -> str:
        """In a few words; none where nothing is known."""
        if not self.known:
            return ""
        size = f"{rounded_up(100.0 * self.relative)} % from the exact solution"
        if self.conditions:
            return f"at most {size}, on a condition"
        return f"at most {size}" if self.guaranteed else f"about {size}"

    def lines(self) -> list[str]:
        """In lines of text: the bound, what it is made of, and what it rests on."""
        label = f"{'exact solution':<18}"
        blank = " " * len(label)
        if not self.known:
            why = self.why.replace(_NONE, "") or "its numbers are not finite"
            return [f"{label}no bound of the distance: {why}"]
        size = f"{rounded_up(self.bound)} away, relative {_percent(self.relative)}"
        parts = [
            f"{name} {_percent(part / self.bound * self.relative if self.bound > 0.0 else 0.0)}"
            for name, part in self.parts.items()
            if part > 1e-6 * self.bound or name in ("misfit", "contact")
        ]
        if self.constant > 0.0:
            parts.append(f"c = {self.constant:.3g}")
        took = f"; in {self.seconds:.2g} s" if self.seconds > 0.0 else ""
        made = [f"{blank}made of {', '.join(parts)}{took}"]
        if self.unseen:
            made.append(f"{blank}but for rigid motions, which the energy does not see: {self.unseen}")
            made += [f"{blank}{self._left}"] if self.guaranteed else []
        if self.unique and self.constant > 0.0:
            made.append(f"{blank}the continuous problem has exactly one solution, for c < 1")
        if self.advice:
            made.append(f"{blank}{self.advice}")
        if self.above > _FAR:
            made.append(
                f"{blank}cells are flat: it may be {self.above:.2g} times the error; take cells of better shape"
            )
        if self.geometry:
            made.append(f"{blank}the body is {self.geometry}")
        if self.guaranteed:
            return [f"{label}at most {size}: guaranteed up to rounding and quadrature", *made]
        if self.conditions:
            return [
                f"{label}at most {size}: conditional, no guarantee",
                *made,
                f"{blank}if {' and '.join(self.conditions)}",
            ]
        return [f"{label}about {size}: an estimate, not a bound", *made, f"{blank}because {self.why}"]

    @property
    def parts(self) -> dict[str, float]:
        """The parts in the unit of the bound, by name."""
        names = ("misfit", "contact", "oscillation", "algebraic", "correction")
        return {name: getattr(self, name) for name in names if math.isfinite(getattr(self, name))}

    @property
    def _left(self) -> str:
        """By what the solutions of a convex problem differ, of a body that moves without energy."""
        if self.unique:
            return "the continuous problem has exactly one solution: contact leaves no rigid motion"
        return f"solutions of the continuous problem differ at most by: {self.loose}"

    def _shares(self) -> tuple[dict[str, float], float]:
        """What the parts make of a bound without softening, the gap counted as contact, and by what that multiplies."""
        parts = self.parts
        moved = parts.pop("correction", 0.0)
        whole = sum(parts.values())
        if self.gap > 0.0:
            parts["contact"] = parts.get("contact", 0.0) + 0.5 * (math.sqrt(whole**2 + 4.0 * self.gap) - whole)
        whole = sum(parts.values())
        factor = (self.bound - moved) / whole if whole > 0.0 else 1.0
        return parts | {"correction": moved / factor if factor > 0.0 else moved}, factor

    @property
    def advice(self) -> str:
        """Which part is most of the bound, and what to do about it; empty where nothing is known."""
        if not (self.known and self.bound > 0.0):
            return ""
        shares, factor = self._shares()
        name = max(shares, key=lambda one: shares[one])
        part = shares[name] / sum(shares.values())
        words = f"of it is {name}: {_REMEDIES[name]}"
        if factor <= 2.0:  # softening makes less than half of the bound
            return f"{100.0 * part:.0f} % {words}"
        soft = f"softening (c) multiplies it by {factor:.2g}, which a finer mesh does not change"
        margin = 1.0 - 1.0 / factor
        if margin > part:
            rest = f"{100.0 * part:.0f} % of the rest {words.removeprefix('of it ')}"
            return f"{100.0 * margin:.0f} % of it is margin: {soft}; {_MARGIN}; {rest}"
        return f"{100.0 * part:.0f} % {words}; {soft}"

    def record(self) -> Record:
        """Plain numbers and strings for JSON; numbers that are not finite become null."""
        values = {"bound": self.bound, "relative": self.relative, "guaranteed": self.guaranteed}
        values |= {
            **self.parts,
            "gap": self.gap,
            "constant": self.constant,
            "seconds": self.seconds,
            "above": self.above,
        }
        finite = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}
        return {
            **finite,
            "geometry": self.geometry,
            "advice": self.advice,
            "reasons": list(self.reasons),
            "conditions": list(self.conditions),
            "unique": self.unique,
            "unseen": self.unseen,
            "loose": self.loose,
        }


def _percent(ratio: float) -> str:
    """A part of a whole, in words, rounded up."""
    return f"{rounded_up(100.0 * ratio)} %"
