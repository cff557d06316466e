"""The pictures of laws-gallery.md: ``python docs/law_gallery.py`` writes images/laws-*.png."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np

from hemivar.laws import Friction, Superpotential
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS, LawEntry
from hemivar.report import plot_laws, save

IMAGES = Path(__file__).parent / "images"


def shown(entry: LawEntry) -> Superpotential | None:
    """A law with the values that ``hemivar laws`` shows it with; None where the user writes it."""
    if entry.example is None:
        return None
    law = entry.make(**entry.example)
    return law.profile if isinstance(law, Friction) else cast(Superpotential, law).at(np.zeros((1, 2)))


if __name__ == "__main__":
    for name, laws, x, y in (
        ("normal", NORMAL_LAWS, "penetration r (length)", "pressure (force per area)"),
        ("friction", FRICTION_LAWS, "slip (length)", "friction over its bound"),
    ):
        drawn = {key: law for key, entry in laws.items() if key != "none" and (law := shown(entry)) is not None}
        save(plot_laws(drawn, labels=(x, y)), IMAGES / f"laws-{name}.png", dpi=120)
