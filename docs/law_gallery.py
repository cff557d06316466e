"""The pictures of laws-gallery.md: ``python docs/law_gallery.py`` writes images/laws-*.png."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hemivar.basics.stated import Form
from hemivar.laws import Friction, Superpotential
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS, LawEntry
from hemivar.report import plot_laws, save

IMAGES = Path(__file__).parent / "images"


def example(entry: LawEntry) -> Superpotential:
    """A law with the values that ``hemivar laws`` shows it with."""
    law = entry.make(**{one.key: one.shown for one in entry.parameters if one.shown is not None})
    if isinstance(law, Friction):
        return law.profile
    assert isinstance(law, Superpotential)
    return law.at(np.zeros((1, 2)))


def own(entry: LawEntry) -> bool:
    """Whether a law is read from a file or a formula of the user's."""
    said = [one.said for one in entry.parameters]
    return any(one.form is Form.FILE or (one.form is Form.TEXT and not one.choices) for one in said)


if __name__ == "__main__":
    for name, laws, x, y in (
        ("normal", NORMAL_LAWS, "penetration r (length)", "pressure (force per area)"),
        ("friction", FRICTION_LAWS, "slip (length)", "friction over its bound"),
    ):
        shown = {key: example(entry) for key, entry in laws.items() if key != "none" and not own(entry)}
        save(plot_laws(shown, labels=(x, y)), IMAGES / f"laws-{name}.png", dpi=120)
