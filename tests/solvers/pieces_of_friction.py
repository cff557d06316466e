"""Coulomb's law in the plane by brute force: every point open, sticking, or slipping to either side.

On such a choice the law is linear, so that one dense system for r and lambda gives the only candidate; it is a solution
where all signs agree.  Nothing here asks the library for anything but to state the problem.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, CoulombBound, Signorini, Tresca

_FITS = 1e-9


@dataclass(frozen=True, eq=False)
class Points:
    """``A r + W lambda = b`` for r = (penetration, slip) of each point, under ``|lam_t| <= mu max(lam_n, 0)``.

    ``stiffness`` is that of the foundation along the normal, None for a rigid one.
    """

    A: Array
    b: Array
    weights: Array
    mu: Array
    stiffness: float | None

    def solutions(self) -> list[Array]:
        """All of them, (m, 2) each."""
        found: list[Array] = []
        for choice in itertools.product(("open", "stick", "ahead", "back"), repeat=self.weights.size):
            r = self._at(choice)
            if r is not None and not any(np.abs(r - one).max() <= 1e-6 * (1e-3 + np.abs(r).max()) for one in found):
                found.append(r)
        return found

    def _at(self, choice: tuple[str, ...]) -> Array | None:
        n, none = self.b.size, np.zeros((self.b.size, self.b.size))
        on_r, on_lam = none.copy(), none.copy()
        for j, kind in enumerate(choice):
            i, t = 2 * j, 2 * j + 1
            if kind == "open":
                on_lam[i, i] = on_lam[t, t] = 1.0
                continue
            if self.stiffness is None:
                on_r[i, i] = 1.0
            else:
                on_lam[i, i], on_r[i, i] = 1.0, -self.stiffness
            if kind == "stick":
                on_r[t, t] = 1.0
            else:
                on_lam[t, t], on_lam[t, i] = 1.0, -self.mu[j] * (1.0 if kind == "ahead" else -1.0)
        whole = np.block([[self.A, np.diag(np.repeat(self.weights, 2))], [on_r, on_lam]])
        if np.linalg.cond(whole) > 1e13:
            return None
        x = np.linalg.solve(whole, np.concatenate([self.b, np.zeros(n)]))
        r, lam = x[:n].reshape(-1, 2), x[n:].reshape(-1, 2)
        length, force = _FITS * np.abs(r).max(), _FITS * (np.abs(lam).max() + np.abs(self.b).max())
        for j, kind in enumerate(choice):
            fits = r[j, 0] <= length if kind == "open" else lam[j, 0] >= -force
            if kind == "stick":
                fits &= abs(lam[j, 1]) <= self.mu[j] * lam[j, 0] + force
            elif kind != "open":
                fits &= (r[j, 1] if kind == "ahead" else -r[j, 1]) >= -length
            if not fits:
                return None
        return r


def random_points(seed: int, most: int = 3) -> tuple[DiscreteProblem, Points]:
    """Up to ``most`` points on any elastic body: one with B = 1."""
    random = np.random.default_rng(seed)
    m = int(random.integers(1, most + 1))
    n = 2 * m
    root = random.normal(size=(n, n))
    A = root @ root.T / n * random.choice([0.3, 1.0]) + np.diag(random.uniform(0.02, 1.5, size=n))
    load = random.normal(size=n) * random.choice([0.1, 1.0, 3.0])
    load[::2] += random.choice([0.0, 1.0])
    gap, weights = random.normal(size=m) * random.choice([0.0, 0.3]), random.uniform(0.5, 2.0, size=m)
    mu = float(random.choice([0.1, 0.3, 0.6, 1.0, 2.0]) * random.uniform(0.7, 1.3))
    stiffness = None if random.integers(0, 2) else float(random.choice([1.0, 10.0, 100.0]))
    law = ContactLaw(Signorini() if stiffness is None else Compliance(stiffness), Tresca(CoulombBound(mu)))
    problem = DiscreteProblem.of_arrays(A, load, np.eye(n), weights, gap, law)
    offset = np.stack([gap, np.zeros(m)], axis=1).ravel()
    return problem, Points(A, load - A @ offset, weights, np.full(m, mu), stiffness)


def points_of(problem: DiscreteProblem, mu: float, stiffness: float | None) -> Points:
    """Those of a discrete problem whose contact points are all free to move, by dense algebra."""
    K, B = problem.stiffness.toarray(), problem.contact.trace.toarray()
    flexible = B @ np.linalg.solve(K, B.T)
    A = np.linalg.inv(flexible)
    free = B @ np.linalg.solve(K, problem.load) - problem.offset.ravel()
    weights = problem.contact.weights
    return Points(A, A @ free, weights, np.full(weights.size, mu), stiffness)
