"""Thousands of wrong arrays for the compiled kernels: each is refused, or harmless, and none ends the process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from hemivar.kernels import kernels
from tests.samples import slow

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")

_SPOILED = """
import sys, warnings
import numpy as np
from hemivar.kernels import kernels

warnings.simplefilter("ignore")
rng, library = np.random.default_rng(int(sys.argv[1])), kernels()

def spoiled(x):
    \"\"\"Another array of what looks alike.\"\"\"
    x = np.array(x)
    flat, far = x.size > 0, [-1, -(2**31), 2**31 - 1, 2**31, 2**40, 10**6, x.size, x.size + 1]
    kinds = [
        lambda: x.astype(rng.choice(["i1", "i2", "i8", "u4", "f4", "f8", "c16", ">i4", ">f8", "O", "U8", "?"])),
        lambda: np.repeat(x, 2, axis=0)[::2], lambda: x[::-1], lambda: x[:-1], lambda: x[:0],
        lambda: np.append(x, x[:1]),
        lambda: x[:, None], lambda: x[None], lambda: np.asarray(0), lambda: x.astype("i8") + 2**32, lambda: -x,
        lambda: np.frombuffer(b"1" + x.tobytes(), dtype=np.uint8)[1:].view(x.dtype), lambda: rng.permutation(x),
        lambda: np.where(rng.uniform(size=x.shape) < 0.3, np.nan, x), lambda: np.full_like(x, 2**31 - 1, subok=False),
    ]
    if flat and x.dtype.kind in "iu":
        def moved():
            y = x.astype("i8") if rng.uniform() < 0.3 else x.copy()
            number = int(rng.choice(far))
            y.ravel()[rng.integers(y.size)] = number if y.dtype.itemsize == 8 else np.int64(number).astype(y.dtype)
            return y
        kinds += [moved] * 8
    return kinds[rng.integers(len(kinds))]()
"""

_FUZZ = """
import scipy.sparse as sp
from hemivar.linear.compiled import CompiledLevels, CompiledTruncation, NodeSlots
from hemivar.linear.levels import Transfer

N = 12

def levels_of(d):
    n, m = N * d, N * d // 2
    A = sp.csr_array(sp.diags_array([-np.ones(n - d), 4.0 * np.ones(n), -np.ones(n - d)], offsets=[-d, 0, d]))
    P = sp.csr_array(np.kron(np.kron(np.eye(N // 2), np.ones((2, 1))), np.eye(d)))
    coarse = sp.csr_array(P.T @ A @ P)
    coarse.sort_indices()
    for matrix in (A, coarse):
        matrix.indices, matrix.indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
    slots = [NodeSlots(np.arange(m), d, m // d), NodeSlots(np.arange(n), d, N)]
    return [coarse, A], [Transfer.of(P)], [np.zeros(0, dtype=int), np.array([0, 1, 5])], slots

raised = done = 0
for turn in range(int(sys.argv[2])):
    d = int(rng.choice([1, 2, 3, 6]))
    matrices, transfers, contacts, slots = levels_of(d)
    n = N * d
    try:
        k = int(rng.integers(2))
        for _ in range(rng.integers(3)):
            what = rng.integers(9)
            if what < 3:
                matrix = (matrices[k], transfers[0].prolongation)[rng.integers(2)]
                name = ("indptr", "indices", "data")[what]
                setattr(matrix, name, spoiled(getattr(matrix, name)))
            elif what == 3:
                contacts[k] = spoiled(contacts[k] if k else np.array([0, 2], dtype=int))
            elif what == 4:
                slots[k] = NodeSlots(spoiled(slots[k].places), d, slots[k].nodes)
            elif what == 5:
                slots[k] = NodeSlots(slots[k].places, int(rng.choice([0, 1, 2, 3, 4, 6, -1])), slots[k].nodes)
            elif what == 6:
                slots[k] = NodeSlots(slots[k].places, d, int(rng.choice([-1, 0, 1, N - 1, N + 1, 1000])))
            elif what == 7:
                slots[k] = NodeSlots(slots[k].places, d, slots[k].nodes, signs=spoiled(np.ones(slots[k].places.size)))
            else:
                transfers = [transfers * 2, [], transfers][rng.integers(3)]
        levels = CompiledLevels(library, matrices, transfers, contacts, slots)
        truncation = CompiledTruncation(levels)
        count, entries = levels.entries[1]
        x, y = rng.standard_normal(n), np.ones(n)
        for _ in range(4):
            level = int(rng.choice([1, 1, 1, 0, 2, -1, -2, 2**40]))
            def maybe(array):
                return spoiled(array) if rng.uniform() < 0.4 else array
            try:
                what = rng.integers(9)
                if what == 0:
                    truncation.change(level, maybe(rng.uniform(size=count) < 0.5), maybe(rng.standard_normal(entries)))
                elif what == 1:
                    A = matrices[0].copy()
                    A.indices = maybe(A.indices)
                    out = maybe(A.indptr), maybe(A.indices), maybe(A.data.copy())
                    library.add_product(matrices[0], A, out, levels.sizes[0])
                elif what == 2:
                    truncation.set_root(maybe(np.eye(levels.sizes[0])))
                elif what == 3:
                    truncation.cycle(level, maybe(x))
                elif what == 4:
                    levels.multiply(level, maybe(x))
                elif what == 5:
                    library.curvature(maybe(x), maybe(x), maybe(y))
                elif what == 6:
                    library.products(maybe(x), maybe(x), maybe(y))
                elif what == 7:
                    library.turn(0.5, maybe(x), maybe(y.copy()))
                else:
                    library.advance(0.5, maybe(x), maybe(x), maybe(y), maybe(y.copy()))
                done += 1
            except (ValueError, TypeError, OverflowError, IndexError, MemoryError):
                raised += 1
        truncation.set_root(np.eye(levels.sizes[0]))
        assert truncation.cycle(1, np.ones(n)).shape == (n,)
        done += 1
    except (ValueError, TypeError, OverflowError, IndexError, MemoryError):
        raised += 1
print(raised, done)
"""

_FUZZ_SUMS = """
import contextlib
from hemivar import box, rectangle
from hemivar.kernels.mesh_sums import BlockGraph, mesh_edges

raised = done = 0
for turn in range(int(sys.argv[2])):
    mesh = rectangle(cells=2) if rng.uniform() < 0.5 else box(cells=1)
    c, E, N, M = int(rng.choice([1, mesh.dim])), len(mesh.edges), mesh.number_of_nodes, mesh.number_of_cells
    size = mesh.dim if c == 1 else mesh.dim * (mesh.dim + 1) // 2
    strains = np.arange(mesh.dim)[None] if c == 1 else rng.integers(size, size=(c, c))
    first = int(rng.integers(M))
    given = {
        "cells": mesh.cells, "edges": mesh.edges, "points": mesh.points, "volumes": mesh.volumes[first:],
        "strains": strains, "matrices": rng.uniform(size=(M - first, size, size)), "upper": np.zeros((E, c, c)),
        "diagonal": np.zeros((N, c, c)), "free": rng.uniform(size=(N, c)) < 0.7,
    }
    given = {name: np.array(one) for name, one in given.items()}
    for _ in range(rng.integers(3)):
        name = str(rng.choice(list(given)))
        with contextlib.suppress(Exception):
            given[name] = spoiled(given[name])
    part, nodes = slice(first, M), int(rng.choice([N, N, N, N, N - 1, 0, -1, N + 1, 2**40]))
    part = [part, part, part, slice(first, M + 9), slice(None, None, -1), slice(-3, 2)][rng.integers(6)]

    def made():
        graph = BlockGraph(library, given["edges"], nodes)
        graph.add(*(given[name] for name in ("points", "cells")), part, *(given[name] for name in ("volumes", "strains",
                  "matrices", "upper")))
        data, indices, indptr = graph.rows(graph.close(given["upper"]), given["upper"], given["free"])
        assert indptr[-1] == len(data) and np.all(np.diff(indptr) >= 0) and (indices < indptr.size).all()

    for work in (made, lambda: mesh_edges(given["cells"], nodes),
                 lambda: BlockGraph(library, mesh.edges, N).rows(given["diagonal"], given["upper"], given["free"])):
        try:
            work()
            done += 1
        except (ValueError, TypeError, OverflowError, IndexError, MemoryError, AttributeError):
            raised += 1
print(raised, done)
"""


@built
@pytest.mark.parametrize("seed", [1, slow(2)])
@pytest.mark.parametrize(
    ("script", "turns"),
    [(_FUZZ, 1500), (_FUZZ_SUMS, 1500)],
    ids=["levels", "sums"],
)
def test_no_wrong_array_ends_the_process(script: str, turns: int, seed: int) -> None:
    environment = os.environ | {"HEMIVAR_KERNELS": "auto", "HEMIVAR_NUM_THREADS": "2", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-X", "faulthandler", "-c", _SPOILED + script, str(seed), str(turns)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    raised, done = map(int, run.stdout.split())
    assert raised > 500
    assert done > 500
