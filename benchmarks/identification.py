"""How often the intervals of ``hemivar identify`` hold the true parameters, and how far off the parameters are.

    python benchmarks/identification.py                     400 curves for each of three laws, 1 % of noise
    python benchmarks/identification.py --draws 40 --laws bilinear

A block on glue is pulled off.  Its curve, 20 forces over displacements, gets normal noise of 1 % of the largest force.
The laws: bilinear (three parameters), trilinear (two), exponential (two).  Printed are, for each parameter, the share
of the 95 % intervals that hold it, and the root of the mean square and the largest of the relative errors.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.identification import FitOptions, Measurements

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.identification.experiments import CASES, FORCE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=400)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--laws", nargs="+", choices=list(CASES), default=list(CASES))
    options = parser.parse_args()
    print("| law | parameter | held by 95 % intervals | error, rms | error, largest |\n|---|---|---|---|---|")
    for name in options.laws:
        case, began = CASES[name], time.perf_counter()
        exact, truth = case.exact(), np.array(list(case.truth.values()))
        held, off = np.zeros(truth.size), np.empty((options.draws, truth.size))
        for draw in range(options.draws):
            normal = np.random.default_rng(draw).standard_normal(exact.size)
            curve = exact + options.noise * np.abs(exact).max() * normal
            measured = Measurements({"pull": case.pulled}, {FORCE: curve})
            found = hv.identification.identify(case.state, measured, case.ranges, FitOptions(starts=1))
            low, high = found.intervals.T
            held += (low <= truth) & (truth <= high)
            off[draw] = found.values / truth - 1.0
        for place, key in enumerate(case.truth):
            rms, most = np.sqrt((off[:, place] ** 2).mean()), np.abs(off[:, place]).max()
            print(f"| {name} | {key} | {held[place] / options.draws:.1%} | {rms:.2%} | {most:.2%} |")
        print(f"{options.draws} curves in {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
