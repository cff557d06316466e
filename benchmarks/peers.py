"""One contact problem, from its mesh to its answer, by hemivar and by the peers that are installed.

    pip install clarabel ngsolve osqp pypardiso        # and, on Debian: apt install calculix-ccx python3-getfem
    python benchmarks/peers.py
    python benchmarks/peers.py --only "plane tresca" --sizes 64 --json rows.json

A square (cube) with lambda = mu = 4, clamped on the left and pressed on a rigid foundation by a body force, with
Tresca's or Coulomb's friction; and two such blocks, one upon the other, whose nodes meet.  All take the same nodes,
cells and contact points, so that all but NGSolve, CalculiX and GetFEM under Tresca's law (they integrate, or penalise)
pose the same discrete problem.  ``difference`` is the distance to hemivar's answer in the energy norm, relative.
``seconds`` are those of the processor, one thread, from the arrays of the mesh to the displacement: assembly, set-up,
all steps.  Each run is a process of its own, which has solved a case of four cells first, so that imports are left out.
What is not installed, cannot state the problem, runs over the limit or ends elsewhere is named at the end.

The peers: *scikit-fem* assembles and Newton's method on Alart and Curnier's equations solves with PARDISO; *NGSolve*
has a penalty and a smoothed modulus, Newton's method and a direct solver; *GetFEM* its own bricks of contact and its
own Newton; *Clarabel* (interior points, cones) and *OSQP* (operator splitting, plane only) minimise the energy that
scikit-fem assembles, for Coulomb's law once for each of the bounds that a fixed point asks; *CalculiX* is its own
program, with a penalty.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp

__all__ = ["CASES", "PEERS"]

_LAME = 4.0
#: Body force aside and down, Tresca's bound, Coulomb's coefficient, by the number of bodies: points stick, slip, open.
_DATA = {1: (0.8, 0.2, 0.2, 0.6), 2: (0.8, 0.8, 0.05, 0.3)}
_TOLERANCE = 1e-8
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "HEMIVAR_THREADS"), "1")


class SkippedError(Exception):
    """Why a peer does not run on a case."""


# ---------------------------------------------------------------------------------------------------------------
# The statement: arrays for all, an object for hemivar


def _meshes(dim: int, bodies: int, n: int) -> Any:
    import hemivar as hv

    if bodies == 1:
        return hv.rectangle((1.0, 1.0), n) if dim == 2 else hv.box((1.0, 1.0, 1.0), n)
    sides, cells = (1.0,) * (dim - 1) + (0.5,), (n,) * (dim - 1) + (n // 2,)
    origin = (0.0,) * (dim - 1) + (-0.5,)
    make: Callable[..., Any] = hv.rectangle if dim == 2 else hv.box
    return hv.Mesh.assembled({"upper": make(sides, cells), "lower": make(sides, cells, origin=origin)})


def _problem(dim: int, bodies: int, friction: str, mesh: Any) -> Any:
    import hemivar as hv

    aside, down, tresca, coulomb = _DATA[bodies]
    law = hv.Contact(hv.Signorini(), hv.Tresca(tresca) if friction == "tresca" else hv.Coulomb(coulomb))
    force = (-aside, *((0.0,) * (dim - 2)), -down)
    if bodies == 1:
        contact, supports = {"bottom": law}, {"left": hv.Clamped()}
    else:
        import dataclasses

        contact = {"upper:bottom": dataclasses.replace(law, against="lower:top")}
        supports = {"upper:left": hv.Clamped(), "lower:bottom": hv.Clamped()}
    return hv.ContactProblem(mesh, hv.Material.lame(_LAME, _LAME), contact, supports, body_force=force)


def statement(dim: int, bodies: int, friction: str, n: int) -> dict[str, Any]:
    """What every peer is given: nodes, cells, held nodes, contact points with both nodes and their areas."""
    mesh = _meshes(dim, bodies, n)
    points, cells = np.asarray(mesh.points), np.asarray(mesh.cells)
    held = points[:, 0] == 0.0
    floor = points[:, -1] == 0.0
    if bodies == 2:
        upper = np.zeros(len(points), bool)
        upper[cells[points[cells].mean(axis=1)[:, -1] > 0.0]] = True
        held = (held & upper) | (points[:, -1] == -0.5)
        over, under = np.flatnonzero(floor & upper), np.flatnonzero(floor & ~upper)
        over, under = (k[np.lexsort(points[k].T)] for k in (over, under))
    else:
        over = np.flatnonzero(floor)
        under = np.full(over.size, -1)
    free = ~held[over] | ((under >= 0) & ~held[under])
    facets = _facets(cells, np.isin(np.arange(len(points)), over))
    areas = np.zeros(len(points))
    corners = points[facets]
    size = (
        np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
        if dim == 2
        else 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    )
    np.add.at(areas, facets.ravel(), np.repeat(size / dim, dim))
    force = np.zeros(dim)
    force[[0, -1]] = np.negative(_DATA[bodies][:2])
    return {
        "points": points,
        "cells": cells,
        "held": np.flatnonzero(held),
        "over": over[free],
        "under": under[free],
        "areas": areas[over[free]],
        "facets": facets,
        "force": force,
        "friction": friction,
        "bound": _DATA[bodies][2],
        "coefficient": _DATA[bodies][3],
        "bodies": bodies,
        "n": n,
    }


def _facets(cells: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Facets of cells whose nodes are all chosen, (k, d)."""
    sides = [np.delete(cells, k, axis=1) for k in range(cells.shape[1])]
    facets = np.concatenate(sides)
    return facets[chosen[facets].all(axis=1)]


def _rows(s: SimpleNamespace) -> tuple[sp.csr_array, sp.csr_array]:
    """Jump of the last component and of the others, point by point, from nodal displacements."""
    dim, m = s.points.shape[1], s.over.size
    size = s.points.size

    def jump(component: int) -> sp.csr_array:
        point = np.arange(m)
        two = s.under >= 0
        row = np.concatenate([point, point[two]])
        column = dim * np.concatenate([s.over, s.under[two]]) + component
        value = np.concatenate([np.ones(m), -np.ones(two.sum())])
        return sp.csr_array((value, (row, column)), shape=(m, size))

    aside = sp.vstack([jump(k) for k in range(dim - 1)]).tocsr()
    order = np.arange(m * (dim - 1)).reshape(dim - 1, m).T.ravel()
    return jump(dim - 1), sp.csr_array(aside[order])


def _free(s: SimpleNamespace) -> np.ndarray:
    dim = s.points.shape[1]
    held = (dim * s.held[:, None] + np.arange(dim)).ravel()
    return np.setdiff1d(np.arange(s.points.size), held)


# ---------------------------------------------------------------------------------------------------------------
# The peers: arrays -> displacement of all nodes


def hemivar(s: SimpleNamespace) -> np.ndarray:
    import hemivar as hv

    mesh = _meshes(s.points.shape[1], s.bodies, s.n)
    solution = hv.solve(_problem(s.points.shape[1], s.bodies, s.friction, mesh), rtol=_TOLERANCE)
    return np.asarray(solution.raise_for_status().displacement)


def hemivar_arrays(s: SimpleNamespace) -> np.ndarray:
    """The same on a mesh that does not know how it was made."""
    import hemivar as hv

    if s.bodies == 2:
        raise SkippedError("its mesh of two bodies has no coarser one either way")
    made = _meshes(s.points.shape[1], 1, s.n)
    mesh = hv.Mesh(s.points, s.cells, boundaries={name: made.boundaries[name] for name in ("left", "bottom")})
    solution = hv.solve(_problem(s.points.shape[1], 1, s.friction, mesh), rtol=_TOLERANCE)
    return np.asarray(solution.raise_for_status().displacement)


def _elastic(s: SimpleNamespace) -> tuple[sp.csr_array, np.ndarray]:
    """Stiffness and load by scikit-fem, unknowns node by node."""
    import skfem
    from skfem.helpers import ddot, dot, sym_grad, trace

    dim = s.points.shape[1]
    kind = (skfem.MeshTri, skfem.ElementTriP1) if dim == 2 else (skfem.MeshTet, skfem.ElementTetP1)
    mesh = kind[0](np.ascontiguousarray(s.points.T), np.ascontiguousarray(s.cells.T))
    basis = skfem.Basis(mesh, skfem.ElementVector(kind[1]()))

    @skfem.BilinearForm
    def energy(u: Any, v: Any, _: Any) -> Any:
        strain = sym_grad(u)
        return 2.0 * _LAME * ddot(strain, sym_grad(v)) + _LAME * trace(strain) * trace(sym_grad(v))

    @skfem.LinearForm
    def load(v: Any, _: Any) -> Any:
        return dot(np.broadcast_to(s.force[:, None, None], v.shape), v)

    K, f = energy.assemble(basis), load.assemble(basis)
    order = basis.nodal_dofs.T.ravel()
    return sp.csr_array(K.tocsr()[order][:, order]), f[order]


def scikit_fem(s: SimpleNamespace) -> np.ndarray:
    """Newton's method on Alart and Curnier's equations, each step by PARDISO."""
    K, f = _elastic(s)
    free = _free(s)
    K, f = sp.csr_array(K[free][:, free]), f[free]
    n_rows, t_rows = (sp.csr_array(rows[:, free]) for rows in _rows(s))
    for r in float(K.diagonal().mean()) * np.array([1.0, 0.1, 10.0]):
        u = _alart_curnier(s, K, f, n_rows, t_rows, r)
        if u is not None:
            return _whole(s, free, u)
    raise SkippedError("Newton's method did not converge in 60 steps for three values of its parameter")


def _alart_curnier(s: SimpleNamespace, K: Any, f: np.ndarray, n_rows: Any, t_rows: Any, r: float) -> np.ndarray | None:
    from pypardiso import spsolve

    m = s.over.size
    aside = t_rows.shape[0] // m
    u, p, q = np.zeros(f.size), np.zeros(m), np.zeros((m, aside))
    for _ in range(60):
        push, pull = p - r * (n_rows @ u), q - r * (t_rows @ u).reshape(m, aside)
        touch = push > 0.0
        bound = s.bound * s.areas if s.friction == "tresca" else s.coefficient * np.maximum(push, 0.0)
        length = np.linalg.norm(pull, axis=1)
        stick = length <= bound
        unit = pull / np.where(length > 0.0, length, 1.0)[:, None]
        factor = np.where(stick, 1.0, bound / np.where(length > 0.0, length, 1.0))
        slip = np.eye(aside) - np.where(stick, 0.0, 1.0)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        slip = factor[:, None, None] * slip
        by_p = np.where(stick | ~touch, 0.0, s.coefficient)[:, None] * unit if s.friction == "coulomb" else 0.0 * unit
        value_n = np.maximum(push, 0.0) - p
        value_t = np.where(stick[:, None], pull, bound[:, None] * unit) - q
        balance = K @ u - f - n_rows.T @ p - t_rows.T @ q.ravel()
        if np.linalg.norm(np.concatenate([balance, value_n, value_t.ravel()])) <= _TOLERANCE * np.linalg.norm(f):
            return u
        on = sp.diags_array(touch.astype(float))
        turn = sp.block_diag(list(slip), format="csr") if aside > 1 else sp.diags_array(slip.ravel())
        lean = sp.csr_array(
            (by_p.ravel(), (np.arange(m * aside), np.repeat(np.arange(m), aside))), shape=(m * aside, m)
        )
        J = sp.block_array(
            [
                [K, -n_rows.T, -t_rows.T],
                [-r * (on @ n_rows), on - sp.eye_array(m), None],
                [-r * (turn @ t_rows) - r * (lean @ n_rows), lean, turn - sp.eye_array(m * aside)],
            ],
            format="csr",
        )
        step = spsolve(sp.csr_matrix(J), -np.concatenate([balance, value_n, value_t.ravel()]))
        u, p, q = u + step[: u.size], p + step[u.size : u.size + m], q + step[u.size + m :].reshape(m, aside)
    return None


def _whole(s: SimpleNamespace, free: np.ndarray, u: np.ndarray) -> np.ndarray:
    whole = np.zeros(s.points.size)
    whole[free] = u
    return whole.reshape(s.points.shape)


def _bounds(s: SimpleNamespace, least: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The answer under Tresca's bound, or the fixed point of the bounds that Coulomb's law asks."""
    if s.friction == "tresca":
        return least(s.bound * s.areas)[0]
    bound = np.zeros(s.areas.size)
    for _ in range(60):
        u, force = least(bound)
        before, bound = bound, s.coefficient * np.maximum(force, 0.0)
        if np.linalg.norm(bound - before) <= 1e-6 * np.linalg.norm(bound):
            return u
    raise SkippedError("the fixed point of Coulomb's bounds did not settle in 60 rounds")


def clarabel(s: SimpleNamespace) -> np.ndarray:
    """Displacement and moduli of the slip as unknowns; the modulus is a second-order cone."""
    import clarabel as cl

    K, f = _elastic(s)
    free, aside, m = _free(s), s.points.shape[1] - 1, s.over.size
    n_rows, t_rows = (sp.csr_array(rows[:, free]) for rows in _rows(s))
    P = sp.block_diag([sp.triu(K[free][:, free]), sp.csc_array((m, m))], format="csc")
    rows = [sp.hstack([-n_rows, sp.csr_array((m, m))])]
    cones = [cl.NonnegativeConeT(m)]
    above = sp.eye_array(m, format="csr")
    for k in range(m):
        rows.append(sp.hstack([sp.csr_array((1, free.size)), -above[[k]]]))
        rows.append(sp.hstack([-t_rows[aside * k : aside * (k + 1)], sp.csr_array((aside, m))]))
        cones.append(cl.SecondOrderConeT(1 + aside))
    A = sp.csc_matrix(sp.vstack(rows))
    settings = cl.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_rel = settings.tol_feas = settings.tol_gap_abs = _TOLERANCE

    def least(bound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cost = np.concatenate([-f[free], bound])
        found = cl.DefaultSolver(sp.csc_matrix(P), cost, A, np.zeros(A.shape[0]), cones, settings).solve()
        if str(found.status) not in ("Solved", "AlmostSolved"):
            raise SkippedError(f"it ended with {found.status}")
        return _whole(s, free, np.array(found.x)[: free.size]), np.array(found.z)[:m]

    return _bounds(s, least)


def osqp(s: SimpleNamespace) -> np.ndarray:
    """As Clarabel, in the plane, where the modulus is two inequalities."""
    import osqp as oq

    if s.points.shape[1] == 3:
        raise SkippedError("it has no cones")
    K, f = _elastic(s)
    free, m = _free(s), s.over.size
    n_rows, t_rows = (sp.csr_array(rows[:, free]) for rows in _rows(s))
    P = sp.block_diag([sp.triu(K[free][:, free]), sp.csc_array((m, m))], format="csc")
    one = sp.eye_array(m)
    A = sp.csc_matrix(sp.block_array([[n_rows, sp.csr_array((m, m))], [t_rows, one], [-t_rows, one]]))
    solver = oq.OSQP()
    solver.setup(
        sp.csc_matrix(P),
        np.zeros(free.size + m),
        A,
        np.zeros(3 * m),
        np.full(3 * m, np.inf),
        verbose=False,
        eps_abs=1e-7,
        eps_rel=1e-7,
        max_iter=200_000,
    )

    def least(bound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        solver.update(q=np.concatenate([-f[free], bound]))
        found = solver.solve()
        if found.info.status != "solved":
            raise SkippedError(f"it ended with {found.info.status}")
        return _whole(s, free, found.x[: free.size]), -found.y[:m]

    return _bounds(s, least)


def ngsolve(s: SimpleNamespace) -> np.ndarray:
    """A penalty of the penetration, a modulus smoothed over a millionth of the size, Newton's method."""
    import ngsolve as ng
    from netgen import meshing

    if s.bodies == 2:
        raise SkippedError("not written: its contact of two boundaries searches for pairs")
    dim = s.points.shape[1]
    mesh = meshing.Mesh(dim=dim)
    ids = [mesh.Add(meshing.MeshPoint(meshing.Pnt(*p, *((0.0,) * (3 - dim))))) for p in s.points]
    if dim == 2:
        mesh.Add(meshing.FaceDescriptor(bc=1, domin=1, surfnr=1))
        for cell in s.cells:
            mesh.Add(meshing.Element2D(1, [ids[k] for k in cell]))
        for facet in s.facets:
            mesh.Add(meshing.Element1D([ids[k] for k in facet], index=1))
    else:
        mesh.Add(meshing.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
        for cell in s.cells:
            mesh.Add(meshing.Element3D(1, [ids[k] for k in cell]))
        for facet in s.facets:
            mesh.Add(meshing.Element2D(1, [ids[k] for k in facet]))
    mesh.SetBCName(0, "floor")
    mesh = ng.Mesh(mesh)
    space = ng.VectorH1(mesh, order=1)
    u, v = space.TnT()
    free = ng.BitArray(space.ndof)
    free.Set()
    for node in s.held:
        for component in range(dim):
            free.Clear(component * len(s.points) + int(node))
    cells = 1.0 / s.n
    stiff, smooth = 1e3 * _LAME / cells, 1e-6
    depth = ng.IfPos(-u[dim - 1], -u[dim - 1], 0.0)
    slip = [u[k] for k in range(dim - 1)]
    modulus = ng.sqrt(sum(k * k for k in slip) + smooth**2)
    bound = s.bound if s.friction == "tresca" else s.coefficient * stiff * depth
    a = ng.BilinearForm(space, symmetric=s.friction == "tresca")
    strain = ng.Sym(ng.Grad(u))
    a += (2.0 * _LAME * ng.InnerProduct(strain, ng.Grad(v)) + _LAME * ng.div(u) * ng.div(v)) * ng.dx
    a += -ng.InnerProduct(ng.CF(tuple(s.force)), v) * ng.dx
    traction = -stiff * depth * v[dim - 1] + bound / modulus * sum(k * v[i] for i, k in enumerate(slip))
    a += traction * ng.ds("floor")
    answer = ng.GridFunction(space)
    rest, step, trial = (answer.vec.CreateVector() for _ in range(3))

    def norm(vector: Any) -> float:
        array = vector.FV().NumPy()
        return float(np.linalg.norm(array[mask]))

    mask = np.array(list(free), bool)
    a.Apply(answer.vec, rest)
    first = size = norm(rest)
    for _ in range(100):
        if size <= _TOLERANCE * first:
            break
        a.AssembleLinearization(answer.vec)
        step.data = a.mat.Inverse(free, inverse="pardiso") * rest
        length = 1.0
        while length > 1e-4:
            trial.data = answer.vec - length * step
            a.Apply(trial, rest)
            if norm(rest) < size:
                break
            length *= 0.5
        answer.vec.data = trial
        size = norm(rest)
    else:
        raise SkippedError("Newton's method did not converge in 100 steps")
    return np.asarray(answer.vec.FV().NumPy()).reshape(dim, -1).T.copy()


def getfem(s: SimpleNamespace) -> np.ndarray:
    """Bricks of elasticity and contact: nodal for Coulomb's law, integrated for Tresca's."""
    import getfem as gf
    from scipy.spatial import cKDTree

    dim = s.points.shape[1]
    if s.friction == "tresca" and s.bodies == 2:
        raise SkippedError("its brick of Tresca's law by an integral is not written for two bodies")
    mesh = gf.Mesh("empty", dim)
    placed = s.points.copy()  # points in one place become one here, so the lower body is moved away
    placed[np.unique(s.cells[s.points[s.cells].mean(axis=1)[:, -1] < 0.0]), -1] -= 1.0
    mesh.add_convex(gf.GeoTrans(f"GT_PK({dim},1)"), np.asfortranarray(placed[s.cells].transpose(2, 1, 0)))
    space = gf.MeshFem(mesh, dim)
    space.set_fem(gf.Fem(f"FEM_PK({dim},1)"))
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(2)" if dim == 2 else "IM_TETRAHEDRON(2)"))
    nodes = space.basic_dof_nodes()[:, ::dim].T
    where = cKDTree(nodes).query(placed)[1]
    model = gf.Model("real")
    model.add_fem_variable("u", space)
    model.add_initialized_data("la", _LAME)
    model.add_initialized_data("mu", _LAME)
    model.add_isotropic_linearized_elasticity_brick(rule, "u", "la", "mu")
    model.add_initialized_data("force", s.force)
    model.add_source_term_brick(rule, "u", "force")
    faces, points = mesh.outer_faces(), mesh.pts()
    corner = [mesh.pid_in_faces(faces[:, k]) for k in range(faces.shape[1])]
    held = np.zeros(points.shape[1], bool)
    held[cKDTree(points.T).query(placed[s.held])[1]] = True
    mesh.set_region(2, faces[:, [k for k, of in enumerate(corner) if held[of].all()]])
    model.add_Dirichlet_condition_with_simplification("u", 2)
    if s.friction == "coulomb":
        over, under = s.over, s.under
        m = over.size
        rows_n, rows_t = _rows(SimpleNamespace(points=s.points, over=over, under=under))
        move = np.empty(s.points.size, int)
        move[(dim * np.arange(len(s.points))[:, None] + np.arange(dim)).ravel()] = (
            dim * where[:, None] + np.arange(dim)
        ).ravel()
        normal, aside = (_moved(-rows_n, move, space.nbdof()), _moved(rows_t, move, space.nbdof()))
        model.add_variable("pn", m)
        model.add_variable("pt", m * (dim - 1))
        model.add_initialized_data("r", [_LAME])
        model.add_initialized_data("friction", [s.coefficient])
        model.add_initialized_data("gap", np.zeros(m))
        model.add_initialized_data("alpha", np.ones(m))
        model.add_basic_contact_brick(
            "u", "pn", "pt", "r", _gf_matrix(gf, normal), _gf_matrix(gf, aside), "friction", "gap", "alpha", 1
        )
    else:
        mesh.set_region(1, faces[:, [k for k, of in enumerate(corner) if np.all(points[-1, of] == 0.0)]])
        pressure = gf.MeshFem(mesh, dim)
        pressure.set_fem(gf.Fem(f"FEM_PK({dim},1)"))
        model.add_filtered_fem_variable("p", pressure, 1)
        model.add_initialized_data("r", [_LAME * s.n])
        model.add_initialized_data("f", [0.0, s.bound, s.bound])
        n = "[0,-1]" if dim == 2 else "[0,0,-1]"
        fine = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)" if dim == 2 else "IM_TETRAHEDRON(5)"))
        model.add_nonlinear_term(fine, "-p.Test_u", 1)
        model.add_nonlinear_term(fine, f"(1/r)*(p-Coulomb_friction_coupled_projection(p,{n},u,-u.{n},f,r)).Test_p", 1)
    r = model.variable("r").copy()
    for factor in (1.0, 10.0, 0.1):
        model.set_variable("r", factor * r)
        for name in ("u", *(("pn", "pt") if s.friction == "coulomb" else ("p",))):
            model.set_variable(name, 0.0 * model.variable(name))
        _, converged = model.solve("max_res", 1e-9, "max_iter", 60, "lsearch", "simplest")
        if converged:
            return np.asarray(model.variable("u")).reshape(-1, dim)[where]
    raise SkippedError("Newton's method did not converge in 60 steps for three values of its parameter")


def _moved(rows: Any, move: np.ndarray, size: int) -> sp.csc_matrix:
    entries = sp.coo_matrix(rows)
    return sp.csc_matrix((entries.data, (entries.row, move[entries.col])), shape=(rows.shape[0], size))


def _gf_matrix(gf: Any, matrix: sp.csc_matrix) -> Any:
    given, rows = gf.Spmat("empty", *matrix.shape), sp.csr_matrix(matrix)
    for k in range(rows.shape[0]):
        part = slice(rows.indptr[k], rows.indptr[k + 1])
        given.add([k], rows.indices[part], rows.data[part][None, :])
    return given


def calculix(s: SimpleNamespace) -> np.ndarray:
    """Nodes against a surface, with a penalty; the foundation is a stiff layer whose nodes are held."""
    program = shutil.which("ccx")
    if program is None:
        raise SkippedError("the program ccx is not installed")
    if s.friction == "tresca":
        raise SkippedError("it has Coulomb's friction only")
    dim, count = s.points.shape[1], len(s.points)
    lines = ["*NODE, NSET=ALL"]
    points = np.hstack([s.points, np.zeros((count, 3 - dim))])
    lines += [f"{k + 1},{x:.15g},{y:.15g},{z:.15g}" for k, (x, y, z) in enumerate(points)]
    lines += [f"*ELEMENT, TYPE={'CPE3' if dim == 2 else 'C3D4'}, ELSET=BODY"]
    lines += [",".join(map(str, [k + 1, *(cell + 1)])) for k, cell in enumerate(s.cells)]
    E, nu = _LAME * 5.0 / 2.0, 0.25
    stiff = 50.0 * E  # the upper end of what its manual advises
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{E},{nu}", "*SOLID SECTION, ELSET=BODY, MATERIAL=M"]
    if s.bodies == 1:
        a, b, low = -1.0, 2.0, -0.5
        if dim == 2:
            layer = [(a, low, 0.0), (b, low, 0.0), (b, 0.0, 0.0), (a, 0.0, 0.0)]
            face, kind = "S3", "CPE4"
        else:
            layer = [(a, a, low), (b, a, low), (b, b, low), (a, b, low), (a, a, 0), (b, a, 0), (b, b, 0), (a, b, 0)]
            face, kind = "S2", "C3D8"
        lines += ["*NODE, NSET=LAYER"]
        lines += [f"{count + k + 1},{x},{y},{z}" for k, (x, y, z) in enumerate(layer)]
        lines += [
            f"*ELEMENT, TYPE={kind}, ELSET=GROUND",
            ",".join(map(str, [len(s.cells) + 1, *range(count + 1, count + 1 + len(layer))])),
        ]
        lines += ["*SOLID SECTION, ELSET=GROUND, MATERIAL=M", "*SURFACE, NAME=MASTER", f"GROUND,{face}"]
        extra = ["*BOUNDARY", "LAYER,1,3"]
    else:
        lower = np.isin(np.arange(count), s.cells[s.points[s.cells].mean(axis=1)[:, -1] < 0.0])
        under = lower & (s.points[:, -1] == 0.0)
        lines += ["*SURFACE, NAME=MASTER"]
        # CalculiX numbers the sides of a triangle 12, 23, 31 and of a tetrahedron 123, 124, 234, 134.
        sides = [(0, 1), (1, 2), (2, 0)] if dim == 2 else [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)]
        for number, side in enumerate(sides, 1):
            lines += [f"{k + 1},S{number}" for k in np.flatnonzero(under[s.cells[:, side]].all(axis=1))]
        extra = []
    lines += ["*SURFACE, NAME=SLAVE, TYPE=NODE", *(str(k + 1) for k in s.over)]
    lines += ["*SURFACE INTERACTION, NAME=I", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiff}"]
    lines += [
        "*FRICTION",
        f"{s.coefficient},{stiff}",
        "*CONTACT PAIR, INTERACTION=I, TYPE=NODE TO SURFACE",
        "SLAVE,MASTER",
    ]
    lines += extra
    lines += ["*BOUNDARY", *(f"{k + 1},1,{dim}" for k in s.held)]
    share = _volumes(s) / (dim + 1)
    nodal = np.bincount(s.cells.ravel(), np.repeat(share, dim + 1), count)
    lines += ["*STEP, INC=1000", "*STATIC", "1.,1.,1e-5,1.", "*CLOAD"]
    lines += [f"{k + 1},{i + 1},{w * s.force[i]:.15g}" for k, w in enumerate(nodal) for i in (0, dim - 1)]
    lines += ["*NODE PRINT, NSET=ALL", "U", "*END STEP", ""]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text("\n".join(lines))
        done = subprocess.run([program, "job"], cwd=folder, capture_output=True, text=True, check=False)
        text = (Path(folder) / "job.dat").read_text() if (Path(folder) / "job.dat").exists() else ""
        if done.returncode or "displacements" not in text:
            raise SkippedError(
                "it ended without an answer: " + (done.stdout.strip().splitlines() or ["no message"])[-1]
            )
    last = text.rsplit("displacements", 1)[1].splitlines()[1:]
    values = np.array([line.split() for line in last if len(line.split()) == 4], dtype=float)
    u = np.zeros((count, dim))
    ours = values[:, 0] <= count
    u[values[ours, 0].astype(int) - 1] = values[ours, 1 : 1 + dim]
    return u


def _volumes(s: SimpleNamespace) -> np.ndarray:
    corners = s.points[s.cells]
    edges = corners[:, 1:] - corners[:, :1]
    return np.abs(np.linalg.det(edges)) / (2.0 if s.points.shape[1] == 2 else 6.0)


#: Name, what is called, the module that shows whether it is installed, whether Debian's Python has it.
PEERS: dict[str, tuple[Callable[[SimpleNamespace], np.ndarray], str | None, bool]] = {
    "hemivar": (hemivar, None, False),
    "hemivar, mesh as arrays": (hemivar_arrays, None, False),
    "scikit-fem, PARDISO": (scikit_fem, "pypardiso", False),
    "NGSolve": (ngsolve, "ngsolve", False),
    "GetFEM": (getfem, "getfem", True),
    "Clarabel": (clarabel, "clarabel", False),
    "OSQP": (osqp, "osqp", False),
    "CalculiX": (calculix, None, False),
}

#: Dimension, bodies, friction.
CASES: dict[str, tuple[int, int, str]] = {
    f"{'plane' if dim == 2 else 'space'} {'two bodies ' if bodies == 2 else ''}{friction}": (dim, bodies, friction)
    for dim in (2, 3)
    for bodies in (1, 2)
    for friction in ("tresca", "coulomb")
}


def _read(data: Any, prefix: str) -> SimpleNamespace:
    s = SimpleNamespace(**{key: data[prefix + key] for key in data.files if prefix + key in data.files})
    s.friction, s.bodies, s.n = str(s.friction), int(s.bodies), int(s.n)
    s.bound, s.coefficient = float(s.bound), float(s.coefficient)
    return s


def _run_one(peer: str, given: Path, found: Path) -> None:
    """In the process of one peer: read the arrays, import, measure, write the displacement."""
    data = np.load(given)
    small, s = (_read(data, prefix) for prefix in ("small ", ""))
    solve, module, _ = PEERS[peer]
    try:
        for name in (module, *(("skfem",) if peer in ("scikit-fem, PARDISO", "Clarabel", "OSQP") else ())):
            if name is not None:
                __import__(name)
    except Exception as error:
        print(json.dumps({"skipped": f"not installed ({type(error).__name__}: {error})"}))
        return

    def used() -> float:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return time.process_time() + children.ru_utime + children.ru_stime

    try:
        if peer != "CalculiX":
            solve(small)  # what is loaded at first use
    except Exception:  # the measured run says what is wrong
        pass
    began = used()
    try:
        u = solve(s)
    except SkippedError as reason:
        print(json.dumps({"skipped": str(reason)}))
        return
    except Exception as error:
        print(json.dumps({"skipped": f"{type(error).__name__}: {error}"}))
        return
    seconds = used() - began
    np.save(found, u)
    print(json.dumps({"seconds": seconds}))


def _measure(peer: str, interpreter: str, given: Path, folder: Path, limit: float) -> dict[str, Any]:
    found = folder / "u.npy"
    found.unlink(missing_ok=True)
    command = [interpreter, __file__, "--one", peer, str(given), str(found)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=limit, env=os.environ | _ONE_THREAD, check=False
        )
    except subprocess.TimeoutExpired:
        return {"skipped": f"no answer in {limit:g} s"}
    except OSError as error:
        return {"skipped": f"{interpreter}: {error.strerror}"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        return {"skipped": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    answer: dict[str, Any] = json.loads(lines[-1])
    if "seconds" in answer:
        answer["u"] = np.load(found)
    return answer


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        _run_one(sys.argv[2], Path(sys.argv[3]), Path(sys.argv[4]))
        return
    from common import show

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=None, metavar="CASE", help=f"of {', '.join(CASES)}")
    parser.add_argument("--peers", nargs="+", default=list(PEERS), metavar="PEER", help=f"of {', '.join(PEERS)}")
    parser.add_argument("--sizes", type=int, nargs=2, default=(128, 16), help="cells along a side, plane and space")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for one run")
    parser.add_argument("--debian-python", default="/usr/bin/python3", help="a Python that has GetFEM")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    rows, skipped = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case in options.only or CASES:
            dim, bodies, friction = CASES[case]
            n = options.sizes[dim - 2]
            given = folder / "given.npz"
            data = statement(dim, bodies, friction, n)
            small = {f"small {key}": value for key, value in statement(dim, bodies, friction, 4).items()}
            np.savez(given, **data, **small)
            K = _elastic(SimpleNamespace(**data))[0]
            ours: dict[str, Any] = {}
            for peer in options.peers:
                interpreter = options.debian_python if PEERS[peer][2] else sys.executable
                answer = _measure(peer, interpreter, given, folder, options.limit)
                if "skipped" in answer:
                    skipped.append(f"{case}, {peer}: {answer['skipped']}")
                    continue
                ours = ours or answer
                gap = (answer["u"] - ours["u"]).ravel()
                whole = ours["u"].ravel()
                difference = float(np.sqrt(max(gap @ (K @ gap), 0.0) / (whole @ (K @ whole))))
                if difference > 0.1:
                    skipped.append(f"{case}, {peer}: its answer is {difference:.2g} away from the others'")
                    continue
                rows.append(
                    {
                        "case": case,
                        "n": n,
                        "unknowns": data["points"].size,
                        "peer": peer,
                        "seconds": answer["seconds"],
                        "times hemivar": answer["seconds"] / ours["seconds"],
                        "difference": difference,
                    }
                )
                print(f"{case}, {peer}: {answer['seconds']:.2f} s", file=sys.stderr, flush=True)
    if rows:
        show(rows, options.json)
    for line in skipped:
        print("skipped:", line)


if __name__ == "__main__":
    main()
