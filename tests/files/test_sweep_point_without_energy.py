"""Laws that have no energy: nothing that is said of their solutions may speak of minimisers or of stability."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.files.sweep_point import SweepPoint
from tests.certificates.test_wording_without_energy import FIXED


def test_a_sweep_counts_minima_of_energies_only() -> None:
    fixed = SweepPoint((0,), energies=(1.0, 2.0), kinds=("saddle" + FIXED, "local minimiser" + FIXED))
    assert fixed.minima is None
    assert replace(fixed, kinds=("saddle", "local minimiser")).minima == 1
    assert np.isnan(fixed.margin)
