"""The trace constant c_gamma and the discrete constant c, converging in h, on the survey's square and on (0,2)x(0,1).

    python benchmarks/trace_constant.py --sizes 8 16 32 64 128

Both bodies are clamped at x = 0 and touch their foundation at y = 0; ``lam = mu = 4``, P1, n cells per unit of length.
``c_gamma`` is the norm of the trace V -> L2(contact)^2, with its normal and tangential components alone beside it.
``alpha_survey`` is the largest alpha that the survey's (H_s) allows, ``m_A / c_gamma^2``; ``alpha_discrete`` is the
largest one with a positive discrete margin if the laws of both components soften alike, ``alpha_normal`` and
``alpha_tangential`` if only one does.
"""

from __future__ import annotations

import time

import numpy as np
from common import arguments, show

import hemivar as hv
from hemivar.certificates import EnergyNorm, smallness
from hemivar.certificates.smallness import ellipticity, trace_constants


def _problem(length: float, n: int) -> hv.DiscreteProblem:
    return hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((length, 1.0), (int(length * n), n)),
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()},
            contact={"bottom": hv.Contact(hv.laws.NoContact())},
            body_force=(0.0, -1.0),
        )
    )


def _soft(sign: float) -> hv.laws.PiecewiseQuadratic:
    """Curvature ``sign`` everywhere."""
    return hv.laws.PiecewiseQuadratic(np.zeros((1, 1)), np.full((1, 2), sign), np.zeros((1, 1)))


def main() -> None:
    options = arguments(__doc__ or "", (8, 16, 32, 64, 128))
    rows = []
    for length in (1.0, 2.0):
        for n in options.sizes:
            problem = _problem(length, n)
            assert problem.field is not None
            began = time.perf_counter()
            traces = trace_constants(problem)
            seconds = time.perf_counter() - began
            law = hv.laws.ContactLaw(_soft(-1.0), hv.laws.Friction(1.0, _soft(-1.0)))
            found = smallness(problem.with_(law=law), factor=EnergyNorm(problem.stiffness), trace_constant=False)
            rows.append(
                {
                    "body": f"(0,{length:g})x(0,1)",
                    "n": n,
                    "c_gamma": f"{traces.both:.6f}",
                    "normal": f"{traces.normal:.6f}",
                    "tangential": f"{traces.tangential:.6f}",
                    "m_A": ellipticity(problem.field),
                    "alpha_survey": f"{ellipticity(problem.field) / traces.both**2:.5f}",
                    "alpha_discrete": f"{1.0 / found.constant:.5f}",
                    "alpha_normal": f"{1.0 / found.constant_normal:.5f}",
                    "alpha_tangential": f"{1.0 / found.constant_tangential:.5f}",
                    "seconds": seconds,
                }
            )
    show(rows, options.json)


if __name__ == "__main__":
    main()
