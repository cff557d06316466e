"""Largest strain and rotation, and what is said where they are not small."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.fem import LoadLine
from hemivar.fem.small_strain import SMALL


def shelf(load: float, **changes: object) -> hv.ContactProblem:
    stated: dict[str, object] = {
        "supports": {"left": hv.Clamped()},
        "contact": {"bottom": hv.Contact(hv.Compliance(0.01))},
        "body_force": (0.0, -load),
    }
    return hv.ContactProblem(hv.rectangle((4.0, 0.5), (16, 2)), hv.Material.lame(40.0, 40.0), **(stated | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("prescribed", [True, False])
def test_paths(prescribed: bool, named: bool) -> None:
    """Where supports move, too, half of the load is half of the strain; the foundation hardly matters."""
    changes: dict[str, object] = {}
    if prescribed:
        changes = {"supports": {"left": hv.Clamped(), "right": hv.Fixed(y=-0.3)}, "body_force": (0.0, 0.0)}
    line = LoadLine.of(shelf(0.1, **changes))

    def followed(*ends: float) -> hv.branches.Path:
        return hv.follow_path(line.loaded, ends or (0.0, 1.0), unloaded=line.unloaded if named else None)  # type: ignore[arg-type]

    path, whole = followed(), hv.solve(line.loaded).raise_for_status()
    assert whole.deformation is not None
    assert whole.deformation.large
    (warning,) = path.warnings
    assert warning == f"at load factor 1 {whole.deformation.warning}"
    assert path.record()["warnings"] == [warning]
    part = SMALL / max(whole.deformation.strain, whole.deformation.rotation)
    assert not followed(0.0, 0.95 * part).warnings
    assert followed(0.0, 1.02 * part).warnings
