"""Continuation that keeps to minimisers: what a march follows until a fold or a bifurcation ends it."""

from __future__ import annotations

from itertools import pairwise

from hemivar.basics.types import Array, IntArray
from hemivar.branches.follower import Follower, Track, TrackPoint
from hemivar.branches.path import PathEnd
from hemivar.systems.chain import Chain

__all__ = ["follow_minimisers"]


def follow_minimisers(
    chain: Chain, force: Array, slope: Array, theta: Array, segment: IntArray, part: float
) -> tuple[float, Array, IntArray, bool]:
    """Along minimisers as far as they go: the load there, the point, and whether it is the end of the step."""
    follower = Follower(chain, force, slope, part, 1.0, max_points=5000, largest_step=0.02)
    track = Track([TrackPoint(part, theta)], [])
    for _ in follower.extend(track, theta, segment, part, 1.0):
        point, last = track.points[-1], track.stretches[-1]
        if not last.stable or point.t < track.points[-2].t:
            break
    good = 0
    for (before, after), stretch in zip(pairwise(track.points), track.stretches, strict=True):
        if not stretch.stable or after.t < before.t:
            break
        good += 1
    if not good:
        return part, theta, segment, False
    end, own = track.points[good], track.stretches[good - 1].segment
    whole = good == len(track.stretches) and track.ended is PathEnd.UPPER_END
    return end.t, end.theta, own, whole
