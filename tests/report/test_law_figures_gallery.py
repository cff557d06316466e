"""Several laws in one picture."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import Capped, Signorini, Softening
from hemivar.report import plot_laws

AT = np.zeros((1, 2))


def test_each_law_has_a_graph_with_its_own_jumps() -> None:
    laws = {
        "rigid": Signorini().at(AT),
        "falls": Capped(20.0, 0.1, 0.0).at(AT),
        "soft": Softening(2.0, 0.1, 0.5).at(AT),
    }
    figure = plot_laws(laws, columns=2)
    shown = [panel for panel in figure.axes if panel.axison]
    assert [panel.get_title() for panel in shown] == list(laws)
    curves = [[line for line in panel.get_lines() if line.get_linewidth() > 1.0] for panel in shown]
    upright = [
        [line for line in drawn if np.ptp(line.get_xdata()) == 0.0 < np.ptp(line.get_ydata())] for drawn in curves
    ]
    assert [len(lines) for lines in upright] == [1, 1, 0]
    assert upright[0][0].get_linestyle() == "-"  # a rigid foundation holds
    assert upright[1][0].get_linestyle() != "-"  # a capped one gives way
    assert max(line.get_ydata().max() for line in curves[2]) == pytest.approx(0.2)


def test_no_law_is_refused() -> None:
    with pytest.raises(ProblemError, match="no law to draw"):
        plot_laws({})
