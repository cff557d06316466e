"""Run by mpirun: certificates of one solution under several conditions, as JSON.  ``claims.py PROBLEM.toml``."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hemivar.cli.end_on_ranks import all_or_none
from hemivar.cli.on_ranks import read_on_ranks
from hemivar.engines.petsc import certificate, solve_distributed, world
from hemivar.engines.petsc.time_limit import Alarm

ranks = world()
with all_or_none(ranks):
    body = read_on_ranks(Path(sys.argv[1]), ranks).bodies[-1]
    solution = solve_distributed(body)
    said: dict[str, Any] = {"shown": certificate.certify_on_ranks(solution).record()}

    sizes, certificate._FACTORISED = certificate._FACTORISED, ((0, 0), (0, 0))
    said["large"] = certificate.certify_on_ranks(solution).record()
    certificate._FACTORISED = sizes

    alphas, ratio = certificate._alphas, certificate.largest_ratio
    certificate._alphas = lambda body: (*alphas(body)[:3], True)
    said["sampled"] = certificate.certify_on_ranks(solution).record()
    certificate._alphas = alphas

    # as if the iteration had met a lesser eigenvalue, and the margin lay in between
    certificate.largest_ratio = lambda *_: 1e-6
    definite, certificate._definite = (
        certificate._definite,
        lambda body, factor, less, scaled=0.0: definite(body, min(factor, 1e-5), less, scaled),
    )
    said["too small"] = certificate.certify_on_ranks(solution).record()
    certificate.largest_ratio, certificate._definite = ratio, definite

    late = Alarm()
    late.ring()
    said["no time"] = certificate.certify_on_ranks(solution, alarm=late).record()
    bad = replace(solution, residual=replace(solution.residual, equilibrium=float("nan")))
    said["nan"] = certificate.certify_on_ranks(bad).record()

    # 3 on the first rank, 4 on the last: with more ranks zeros between
    ends = {0: 3.0, ranks.size - 1: 4.0}
    mine = np.array([ends.get(ranks.rank, 0.0)])
    one = np.array([1.0 if ranks.rank in ends else 0.0])
    wrong = np.array([np.nan if ranks.rank == ranks.size - 1 else 0.0])
    said["norms"] = ranks.norms(1e200 * mine, 1e-200 * mine, 0.0 * mine, one, wrong).tolist()
    if ranks.rank == 0:
        print(json.dumps(said))
