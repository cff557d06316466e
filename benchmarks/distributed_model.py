"""A paper model of the contact solve over ranks, from what `benchmarks/distributed.py --cells 64 --log` counts.

    python benchmarks/distributed_model.py

Measured on one core: seconds for an unknown in one iteration and in one set-up. Counted: messages to a neighbour and
reductions in one cycle, in one iteration and in one set-up. Assumed: a network.
"""

from __future__ import annotations

import math

ITERATION = 0.31e-6  # s for an unknown of the finest mesh, cycle included, on one core
SETUP = 1.15e-6  # s for an unknown
SLOWDOWN = 2.0  # all cores of a node at work, against one alone: memory bandwidth
ITERATIONS, SETUPS = 20, 4  # on the finest mesh
MESSAGES, SETUP_MESSAGES = 5.1, 33.0  # to each neighbour: in a cycle over four levels, in a set-up
CYCLE_REDUCTIONS, SETUP_REDUCTIONS = 3.4, 125.0
NEIGHBOURS = 14.0
LATENCY, BANDWIDTH = 2e-6, 10e9  # s, bytes/s


def seconds(unknowns: float, ranks: int) -> tuple[float, float, float]:
    """Work, messages and reductions of a contact solve; coarser meshes count a seventh more of the work."""
    own = unknowns / ranks
    levels = max(math.log2(max(own / 240.0, 2.0)) / 3.0 + 1.0, 1.0)
    work = 8 / 7 * SLOWDOWN * own * (ITERATIONS * ITERATION + SETUPS * SETUP)
    face = 24.0 * (own / 3.0) ** (2 / 3)  # bytes of a layer of nodes towards one neighbour
    each = NEIGHBOURS * levels / 4.0
    messages = each * (ITERATIONS * MESSAGES + SETUPS * SETUP_MESSAGES) * LATENCY
    messages += 6 * (ITERATIONS * MESSAGES / 4.0 * face * 4 / 3 + SETUPS * 15 * 3 * face * 4 / 3) / BANDWIDTH
    tree = 2.0 * LATENCY * math.log2(ranks)
    # the coarser meshes take a few iterations and set-ups each before the finest one
    rounds = ITERATIONS + 5 * levels, SETUPS + 3 * levels
    reductions = (rounds[0] * CYCLE_REDUCTIONS + rounds[1] * SETUP_REDUCTIONS) * tree
    return work, messages, reductions


def main() -> None:
    print("unknowns     ranks   unknowns/rank   work s   messages s   reductions s   start mesh, cells on rank 0")
    for unknowns in (1e8, 1e9, 1e10):
        for ranks in (64, 1024, 16384):
            work, messages, reductions = seconds(unknowns, ranks)
            print(
                f"{unknowns:8.0e}  {ranks:8d}  {unknowns / ranks:14.3g} {work:8.3g} {messages:12.2g} {reductions:14.2g}"
                f" {400 * ranks:12.2g}"
            )


if __name__ == "__main__":
    main()
