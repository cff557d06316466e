"""Tolerances for rounding that several modules share, and how many cells they take at a time."""

from __future__ import annotations

from hemivar.basics.arrays import CACHED

__all__ = ["CELLS", "CONSTANT", "FREE", "KINK"]

#: Cells whose numbers are held at a time, of which a cell has 60 at most.
CELLS = CACHED // 64
#: Part of a modulus by which it may vary and count as constant: some 500 roundings. A tensor that is turned is a sum
#: of 81 products of five.
CONSTANT = 1e-13
#: Part of a unit vector, or of a projection made of some, that counts as none. They are good to 1e-15, but for
#: directions of supports that nearly coincide.
FREE = 1e-10
#: Distance to a kink of a law, over the largest displacement or gap, that is rounding. Either is a sum of a few
#: products, good to 1e-15 of the largest; of displacements of a solve, whose last digits are less good.
KINK = 1e-11
