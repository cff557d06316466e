"""What is known about a picture, as a badge: a word or two, and what they mean in a sentence."""

from __future__ import annotations

import math
from typing import NamedTuple

from hemivar.certificates import Certificate
from hemivar.discrete.point_kind import PointKind
from hemivar.evolution import History

__all__ = ["Badge", "badge_in_time", "badge_of"]


#: What the margins of a run say where they prove it without a condition.
_PROVED = "every step has one solution only"


class Badge(NamedTuple):
    """What stands on the page."""

    level: str  # "good", "fair" or "poor"
    title: str
    meaning: str  # in a sentence or two


def badge_of(certificate: Certificate) -> Badge:
    """The badge of a certificate: what it claims, and no more."""
    if not certificate.stationary:
        return Badge("poor", "not a solution", "The residual is above the tolerance: this is not an equilibrium.")
    kind = certificate.kind.value
    if certificate.unique is True:
        error = certificate.error_bound_relative
        off = (
            f" It is {certificate.claim('distance').size} {error:.1e} (relative) from the exact discrete solution."
            if math.isfinite(error)
            else ""
        )
        return Badge("good", "the only solution", f"No other equilibrium of this mesh exists at this load.{off}")
    if isinstance(certificate.unique, str):
        return Badge("good", kind, f"This equilibrium is {certificate.unique}.")
    if not certificate.kind.has_energy:
        return Badge(
            "fair" if certificate.kind in (PointKind.BOUND_FIXED_MINIMISER, PointKind.WITHOUT_ENERGY) else "poor",
            "an equilibrium",
            f"{kind[:1].upper()}{kind[1:]}. The law depends on the solution and has no energy, so stability is not "
            f"known; {certificate.uniqueness}.",
        )
    if certificate.kind in (PointKind.LOCAL_MINIMISER, PointKind.GLOBAL_MINIMISER):
        others = "Others exist" if certificate.unique is False else "Others may exist"
        return Badge(
            "fair", kind, f"A stable equilibrium: a local minimum of the energy. {others}; search for all solutions."
        )
    return Badge("poor", kind, f"An equilibrium, but not shown to be stable; {certificate.uniqueness}.")


def badge_in_time(history: History) -> Badge:
    """The badge of a run in time: what its margins say of the solutions of its steps."""
    words = history.uniqueness
    sentence = f"{words[:1].upper()}{words[1:]}."
    if words == _PROVED:
        return Badge("good", "each step unique", sentence)
    return Badge("fair", "steps perhaps not unique", sentence)
