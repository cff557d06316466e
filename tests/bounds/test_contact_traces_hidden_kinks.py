"""Laws whose kinks lie between the points at which bounds look: what is there counts, or is told."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import contact_traces, cut_triangle
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.laws import NoContact, PenetrationBound

MODULUS = 1e6
#: Steepest slope of the spikes, by which c is about a half.
STEEP = 2e5


def spikes(places: Array) -> tuple[Array, Array]:
    """A table that is zero at some places, with one spike between any two of them."""
    r = np.sort(np.unique(np.round(places, 12)))
    low, high = r[:-1], r[1:]
    half = 0.45 * (high - low)
    middle = 0.5 * (low + high)
    s = np.stack([middle - half, middle, middle + half], axis=1).ravel()
    return np.concatenate([[-3.0], s, [1.0]]), np.concatenate([[0.0], np.outer(half, [0.0, STEEP, 0.0]).ravel(), [0.0]])


def rule_points(dim: int) -> Array:
    """The places x at which rules on one square or cube look."""
    if dim == 2:
        gauss = 0.5 + np.sqrt(15.0) / 10.0 * np.array([-1.0, 0.0, 1.0])
        return np.concatenate([np.arange(5) / 4.0, (np.arange(4)[:, None] + gauss).ravel() / 4.0])
    points = cut_triangle(4, None)[0]
    return np.concatenate(
        [points[:, 0], 1.0 - points[:, 0], points[:, 1], 1.0 - points[:, 1], points[:, 2], 1.0 - points[:, 2]]
    )


def bound_and_least(dim: int, table: tuple[Array, Array] | str) -> tuple[DistanceToExact, float]:
    """A block above a plane that is oblique and dragged along, whose friction depends on the gap; all of it is far.

    And what the solution is at least, in the energy norm: by the field that shears the block.
    """
    mesh = hv.rectangle((1.0, 1.0), (1, 1)) if dim == 2 else hv.box((1.0, 1.0, 1.0), 1)
    down, up = np.zeros(dim), np.zeros(dim)
    down[-1], up[0], up[-1] = -0.1, np.sqrt(0.5), np.sqrt(0.5)
    contact = hv.Contact(
        NoContact(), hv.Tresca(PenetrationBound(table)), obstacle=hv.Plane(tuple(down), tuple(up)), normals="body",
        belt=(0.5, *[0.0] * (dim - 1)),
    )  # fmt: skip
    problem = hv.ContactProblem(mesh, hv.Material.young(MODULUS, 0.3), {"bottom": contact}, {"top": hv.Clamped()})
    found = hv.solve(problem).certify(exact=True).exact
    assert found is not None
    force, shear = 0.0 if isinstance(table, str) else float(np.trapezoid(table[1], table[0])), MODULUS / 2.6
    return found, force / np.sqrt(shear) / (1.0 + found.constant)


@pytest.mark.parametrize("dim", [2, 3])
def test_what_friction_does_between_the_points_counts(dim: int) -> None:
    """The gap is 0.1 + x; at the nodes, and where rules would look, there is no friction."""
    found, least = bound_and_least(dim, spikes(-0.1 - rule_points(dim)))
    assert found.guaranteed, found.why
    assert found.bound >= least > 0.0


def test_one_spike_in_space_is_cut_out() -> None:
    x = np.sort(np.unique(np.round(rule_points(3), 12)))
    widest = int(np.argmax(np.diff(x)))
    found, least = bound_and_least(3, spikes(-0.1 - x[widest : widest + 2]))
    assert found.guaranteed, found.why
    assert found.bound >= least > 0.0


@pytest.mark.parametrize("place", [0.31, 0.5003, 0.772])
def test_a_narrow_curve_counts(place: float) -> None:
    """A bell of the friction, so narrow that no point of the rule lies on it."""
    width, top = 2e-4, 40.0
    bell = f"{top}*exp(-((s + {0.1 + place})/{width})^2)"
    found, _ = bound_and_least(2, bell)
    least = top * width * np.sqrt(np.pi) / np.sqrt(MODULUS / 2.6) / (1.0 + found.constant)
    assert found.guaranteed, found.why
    assert found.bound >= least > 0.0


@pytest.mark.parametrize("factor", [0.95, 1.0, 1.2])
def test_a_spike_between_slips_that_are_seen_counts(factor: float) -> None:
    """The slip is x, and the friction one but for the spike."""
    x = np.sort(np.unique(np.round(rule_points(3), 12)))
    widest = int(np.argmax(np.diff(x)))
    slips = np.linspace(*x[widest : widest + 2], 5)[1:4]
    mesh = hv.box((1.0, 1.0, 1.0), 1)
    friction = hv.laws.SlipTable(1.0, (0.0, *slips, 2.0), (1.0, 1.0, factor, 1.0, 1.0))
    contact = {"bottom": hv.Contact(NoContact(), friction)}
    problem = hv.ContactProblem(mesh, hv.Material.young(MODULUS, 0.3), contact, {"top": hv.Clamped()})
    traces = contact_traces(body_data(problem, mesh.points * [1.0, 0.0, 0.0]))
    assert traces is not None
    height = abs(factor - 1.0)
    assert traces.unseen[:, 0].max() == 0.0
    assert (traces.unseen[:, 1] >= height).all()
    assert (traces.unseen[:, 1] <= 8.0 * height).all()
