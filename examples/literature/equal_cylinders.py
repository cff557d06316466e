"""Two equal cylinders pressed together.

R = 10, E = 210000, nu = 0.3, plane strain, 1000 per length: Hertz's half width and pressure. The bodies are those
of the example of the gallery, nodes do not match.
"""

import runpy
from pathlib import Path

import hemivar as hv

SOURCE = "Hertz 1882"
PRINTED = {"half width": 0.2348908547, "largest pressure": 2710.279092}
REASON = "second order in the cells; a line is fitted to the squares of the pressures"
WITHIN = 0.01


def computed(fine: bool = False) -> dict[str, float]:
    """The gallery's meshes with 80 or 160 cells across."""
    example = runpy.run_path(str(Path(__file__).parents[1] / "two_cylinders.py"))
    found = example["fitted"](hv.solve(example["problem"](160 if fine else 80)).raise_for_status())
    return dict(zip(PRINTED, found, strict=True))
