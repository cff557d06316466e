"""Schemes by name: what the files of this package say of themselves, for problem files and the command."""

from __future__ import annotations

from typing import cast

from hemivar.evolution import schemes
from hemivar.evolution.schemes.scheme import Scheme
from hemivar.laws.named import LawKind, named_in

__all__ = ["SCHEMES", "SCHEME_ENTRIES"]

#: What schemes say of themselves, by name.
SCHEME_ENTRIES = named_in(LawKind.SCHEME, schemes)
#: Schemes with their standard options, by name.
SCHEMES = {name: cast(Scheme, entry.build()) for name, entry in SCHEME_ENTRIES.items()}
