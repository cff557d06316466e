"""Run by mpirun: certificates of one solution under several conditions, as JSON.  ``claims.py PROBLEM.toml``."""

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np

from hemivar.laws import ContactLaw
from hemivar.ranks import certificate, solve_distributed, world
from hemivar.ranks.petsc_engine import all_or_none
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import Solution
from tests.ranks.stated import body_of_file

ranks = world()


def record(solution: Solution, alarm: TimeLimit | None = None) -> Any:
    """What is claimed."""
    found = certificate.certify_on_ranks(solution, alarm=alarm)
    return None if found is None else found.record()


with all_or_none(ranks):
    body = body_of_file(sys.argv[1])
    solution = solve_distributed(body)
    said: dict[str, Any] = {"shown": record(solution)}

    sizes, certificate._FACTORISED = certificate._FACTORISED, ((0, 0), (0, 0))
    said["large"] = record(solution)
    certificate._FACTORISED = sizes

    known = ContactLaw.proof
    ContactLaw.proof = lambda law, constant: replace(known(law, constant), reach=(0.0, 0.0))  # type: ignore[method-assign]
    said["sampled"] = record(solution)
    ContactLaw.proof = known  # type: ignore[method-assign]

    # as if the iteration had met a lesser eigenvalue, and the margin lay in between
    started, definite = certificate.CyclesOnRanks._started, certificate._definite
    certificate._definite = lambda body, factor, *more: definite(body, min(factor, 1e-5), *more)
    certificate.CyclesOnRanks._started = lambda self, part: started(self, 1e-3 * part)  # type: ignore[method-assign]
    said["too small"] = record(solution)
    certificate.CyclesOnRanks._started = started  # type: ignore[method-assign]
    certificate._definite = definite

    late = TimeLimit()
    late.ring()
    said["no time"] = record(solution, late)
    said["off"] = record(replace(solution, unknowns=1.01 * solution.unknowns))
    wrong = np.where(np.arange(solution.unknowns.size) == ranks.rank, np.nan, solution.unknowns)
    said["nan"] = record(replace(solution, unknowns=wrong if ranks.rank == ranks.size - 1 else solution.unknowns))

    # 3 on the first rank, 4 on the last: with more ranks zeros between
    ends = {0: 3.0, ranks.size - 1: 4.0}
    mine = np.array([ends.get(ranks.rank, 0.0)])
    one = np.array([1.0 if ranks.rank in ends else 0.0])
    wrong = np.array([np.nan if ranks.rank == ranks.size - 1 else 0.0])
    said["norms"] = ranks.norms(1e200 * mine, 1e-200 * mine, 0.0 * mine, one, wrong).tolist()
    if ranks.rank == 0:
        print(json.dumps(said))
