"""Tolerances for rounding that several modules share, and how many cells they take at a time."""

from __future__ import annotations

from hemivar.basics.arrays import CACHED

__all__ = ["CELLS", "CONSTANT", "FREE", "KINK"]

#: Cells whose numbers are held at a time, of which a cell has 60 at most.
CELLS = CACHED // 64
#: Part of a modulus by which it may vary and count as constant. A turned tensor is a sum of 81 products of five, whose
#: sizes add up to nine times the largest modulus at most: 85 roundings of 1.1e-16, nine times, are 8.5e-14.
#: 3000 isotropic tensors of all ratios, turned at random, were off by 2.3e-15.
CONSTANT = 1e-13
#: Part of a unit vector, or of a projection made of some, that counts as none. Two directions of supports at an angle
#: of t (radians) were found to leave 9e-16 / t of what they hold: it serves down to 1e-5.
FREE = 1e-10
#: Distance to a kink of a law, over the largest displacement or gap, that is rounding: a sum of a few products, good to
#: 1e-15. On turned plates 300 sizes from the origin, by LU factors and by multigrid, what rests on a rigid foundation
#: was off by nothing, and no other point nearer than 8e-3.
KINK = 1e-11
