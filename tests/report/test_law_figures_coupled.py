"""What pictures of coupled laws refuse."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.report.law_figures import plot_coupled_law, plot_mode_dependent
from tests.laws.coupled.test_mode_dependent import soft
from tests.laws.coupled.test_own_coupled import LAWS


def test_a_reach_that_is_no_length_is_refused() -> None:
    for draw in (lambda: plot_coupled_law(LAWS["gauss"](), reach=-1.0), lambda: plot_mode_dependent(soft(), reach=0.0)):
        with pytest.raises(hv.HemivarError, match="positive length"):
            draw()
