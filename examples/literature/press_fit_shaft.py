"""A press fit of two bodies of revolution.

Rings of the radii 10 to 20 and 20 to 30, with an interference of 0.02 mm, between rigid plates: E = 210000, nu =
0.3. Lame's formulas give the pressure. The statement is the problem file of the examples.
"""

from dataclasses import replace
from pathlib import Path

import hemivar as hv

SOURCE = "Lame"
PRINTED = {"mean pressure": 54.08653846}
REASON = "linear elements, of second order (fine: quadratic)"
WITHIN = 5e-3
FILE = Path(__file__).parents[1] / "problems" / "press_fit.toml"


def computed(fine: bool = False) -> dict[str, float]:
    """The file as it is, or with quadratic elements."""
    problem = replace(hv.read_problem(FILE), order=2 if fine else 1)
    solution = hv.solve(problem).raise_for_status()
    return {"mean pressure": solution.normal_force / solution.contact.weights.sum()}
