"""Laws shared by the tests: nonmonotone ones, and every law by name that nothing here is about."""

from __future__ import annotations

from typing import cast

import numpy as np

from hemivar.laws import (
    Adhesive,
    Capped,
    FinitePenetration,
    FormulaLaw,
    Friction,
    FunctionLaw,
    Layered,
    Logarithmic,
    SawTooth,
    SlipTable,
    SlipWeakening,
    Softening,
    StaticKinetic,
    Superpotential,
    table_law,
)
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS

LAWS: dict[str, Superpotential] = {
    "softening": Softening(2.0, 0.1, 0.5),
    "softening at once flat": Softening(2.0, 0.1, 0.0),
    "capped": Capped(20.0, 0.1),
    "capped, part left": Capped(300.0, 0.1, 0.4),
    "yielding": Capped(300.0, 0.1, 1.0),
    "finite": FinitePenetration(3.0, 0.2),
    "brittle glue on rigid ground": Adhesive(5.0, 1.0),
    "softening glue": Adhesive(5.0, 1.0, 2.0),
    "brittle glue on springs": Adhesive(5.0, 1.0, compression=30.0),
    "layers on rigid ground": Layered([0.1, 0.2], [3.0, 10.0], [0.1, 0.5]),
    "layers on springs": Layered([0.1, 0.2], [3.0, -1.0], [0.1, 0.05], base=2.0),
    "saw-tooth": SawTooth([0.5, 1.0, 2.0], [6.0, 2.0, 1.0], [0.0, 1.0, 0.5]),
    "saw-tooth on springs": SawTooth([0.5, 1.0], [6.0, 2.0], compression=9.0),
    "slip weakening": SlipWeakening(0.5).radial,
    "slip strengthening": SlipWeakening(0.5, 0.7, 1.0, 3.0).radial,
    "logarithmic": Logarithmic(0.5, 0.2).radial,
    "static-kinetic": StaticKinetic(0.5, 0.1).radial,
    "slip table": SlipTable(1.0, [0.0, 0.1, 0.1, 0.4], [1.0, 0.8, 0.5, 0.2]).radial,
    "table": table_law([-1.0, 0.0, 0.0, 1.0, 2.0, 2.0], [0.0, 0.0, -1.0, 3.0, 1.0, -1.0]),
    "table, extended": table_law([0.0, 0.5, 0.5, 1.0], [0.0, 2.0, -1.0, 2.0], extend="linear"),
    "survey's friction": FormulaLaw("7/10*abs(r) - 3/10*exp(-abs(r))"),
    "broken springs": FormulaLaw("piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))"),
    "waves": FormulaLaw("0.3*cos(5*r) + 0.1*r^2/2", reach=4.0),
    "slopes of two formulas": FormulaLaw("max(r^2 - 1, 0, r/2)", reach=4.0),
    "logarithm": FormulaLaw("log(1 + r)", even=True),
    "own potential": FunctionLaw(lambda r: np.log1p(np.abs(r)), lambda r: np.sign(r) / (1.0 + np.abs(r)), kinks=[0.0]),
    "own derivative": FunctionLaw(derivative=lambda r: np.where(r > 0, 2 * np.exp(-r), 0.0) + 0.1 * r, kinks=[0.0]),
}


def _others() -> dict[str, Superpotential]:
    """Laws by name that are not above, with the values that they are shown with."""
    known, more = MONOTONE | {law.name for law in LAWS.values()}, {}
    for entry in (*NORMAL_LAWS.values(), *FRICTION_LAWS.values()):
        if entry.example is not None and entry.name not in known:
            law = entry.make(**entry.example)
            more[entry.name] = (law.profile if isinstance(law, Friction) else cast(Superpotential, law)).at(
                np.zeros((1, 2))
            )
    return more


#: Laws whose tests stand in files of their own.
MONOTONE = {
    "signorini",
    "bilateral",
    "compliance",
    "survey",
    "none",
    "pressure-table",
    "tresca",
    "coulomb",
    "orthotropic",
}

LAWS |= _others()

#: Half width on which a law is checked, where it is not three times its largest knot.
REACH = {"waves": 3.5, "slopes of two formulas": 3.5}
