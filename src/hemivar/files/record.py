"""Solutions as records of plain numbers and strings, and as JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from importlib import metadata
from pathlib import Path

import numpy as np

from hemivar.basics.disk import make_folder, path_of, read_bytes, read_text, shown, whole_file, write_text
from hemivar.basics.packed import read_arrays, write_arrays
from hemivar.basics.rows import plain
from hemivar.basics.types import Array, Record
from hemivar.certificates import Certificate
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.solvers import Solution
from hemivar.solvers.boundary_result import BoundaryResult

__all__ = [
    "MOST_BYTES",
    "boundary_names",
    "laid_out",
    "prepared",
    "read_json",
    "result_record",
    "solution_record",
    "version",
    "write_json",
]

#: Bytes of a file with a solution.
MOST_BYTES = 2**31
#: How names of arrays of contact points begin.
_CONTACT = "contact."


def solution_record(solution: Solution, certificate: Certificate | None = None) -> Record:
    """A solution as plain numbers, lists and strings, ready for JSON.

    Keys: ``hemivar`` (version), ``status``, ``remedy``, ``warnings`` (sentences), ``deformation`` (largest ``strain``,
    ``rotation`` in radians, and whether one of them is ``large``, 0.1 or more; null where there are none), ``method``,
    ``unknowns`` (their number), ``contact_points``, ``dim``, ``energy`` (a friction bound that depends on the state is
    taken at this pair), ``residual`` (relative), ``residual_parts`` (equilibrium, inclusion, scale, rounding; units of
    force), ``steps``, ``evaluations``, ``timings`` (seconds), ``history``, ``error_bound``, ``fallbacks`` (how
    often the method had to take another way), ``contact_length``,
    ``resultants``, ``boundaries``, ``reactions``, ``contact``, ``displacement`` (vectors of the nodes; the unknowns of
    a problem made of arrays) and, where one is given, ``certificate``, see
    :meth:`hemivar.certificates.Certificate.record`.

    ``resultants`` holds ``normal_force`` (resultant of the pressure), ``friction_force`` (resultant of the friction
    on the body in local components) and ``force``, the global vector of the force of the foundation on the body,
    ``-sum_j w_j (lam_nu nu + lam_tau)`` with the multiplier lam; null where the problem has no frames.  ``boundaries``
    holds for each contact boundary, by name, its ``normal_force``, ``force`` and ``contact_length``; ``reactions`` the
    force of each support on the body, by name, null where it is not known (:func:`.support_reactions`).
    Where there are rigid plates, ``plates`` holds by name how each moves, and its force and moment.
    Where bodies touch each other, ``contact_forces`` holds the force on each side by name.

    ``contact`` holds one entry for each contact point: ``x`` and ``normal`` (vectors; null without points or frames),
    ``boundary`` (name; null if unknown), ``weight``, ``gap`` (that of the obstacle where there is one, less what
    supports prescribe), ``penetration``, ``slip``, ``pressure``, ``friction``, ``normal_state`` ("open",
    "contact", "bonded", "softening", "debonded"), ``tangential_state`` ("free", "stick", "slip") and
    ``without_friction`` (whether friction of the law had to be left out there; null if unknown).
    Pressure is positive in compression; friction is that of the foundation on the body.  Slip and friction are numbers
    in 2D (along the normal turned by +90 degrees), vectors of two local components in 3D, and null in 1D. Numbers that
    are not finite become null.

    Parameters
    ----------
    solution : Solution
    certificate : Certificate, optional
        Written with it.

    Returns
    -------
    dict
    """
    record = result_record(solution, certificate)
    return record | {"displacement": plain(solution.displacement)}


def result_record(solution: Solution, certificate: Certificate | None = None) -> Record:
    """:func:`solution_record` without the displacement; its contact points are those of this process."""
    problem, residual, deformed = solution.problem, solution.residual, solution.deformation
    record = {
        "hemivar": version(),
        "status": solution.status.value,
        "remedy": solution.remedy,
        "warnings": solution.warnings,
        "deformation": None
        if deformed is None
        else {"strain": deformed.strain, "rotation": deformed.rotation, "large": deformed.large},
        "method": solution.method,
        "unknowns": problem.unknowns,
        "contact_points": int(problem.vectors.total(problem.contact_points)[0]),
        "dim": problem.contact.components,
        "energy": solution.energy,
        "residual": residual.relative,
        "residual_parts": {
            "equilibrium": residual.equilibrium,
            "inclusion": residual.inclusion,
            "scale": residual.scale,
            "rounding": residual.rounding,
        },
        "steps": solution.steps,
        "evaluations": solution.evaluations,
        "timings": dict(solution.timings),
        "history": [asdict(line) for line in solution.history],
        "error_bound": solution.error_bound,
        "fallbacks": solution.fallbacks,
        "contact_length": solution.contact_length,
        "resultants": {
            "normal_force": solution.normal_force,
            "friction_force": solution.friction_force,
            "force": None if problem.contact.frames is None else solution.force,
        },
        "boundaries": {name: _boundary_record(solution.on(name)) for name in problem.contact.names},
        **({"contact_forces": dict(solution.contact_forces)} if problem.contact.pairs else {}),
        "reactions": _reactions(solution),
        **_plates(solution),
        "contact": _contact_record(solution),
    }
    if certificate is not None:
        record["certificate"] = certificate.record()
    return {key: plain(value) for key, value in record.items()}


def _boundary_record(result: BoundaryResult) -> Record:
    force = None if result.contact.frames is None else result.force
    return {"normal_force": result.normal_force, "force": force, "contact_length": result.contact_length}


def _reactions(solution: Solution) -> dict[str, Array] | None:
    try:
        return dict(solution.reactions)
    except ProblemError:
        return None


def _plates(solution: Solution) -> Record:
    """How rigid plates move, where there are some and it is known."""
    try:
        return {"plates": {name: dict(plate) for name, plate in solution.plates.items()}} if solution.plates else {}
    except ProblemError:
        return {}


def _contact_record(solution: Solution) -> Record:
    problem = solution.problem
    normal, tangential = solution.states.names
    return {
        "x": problem.contact.points,
        "normal": None if problem.contact.frames is None else problem.contact.frames[:, 0],
        "boundary": boundary_names(problem),
        "weight": problem.contact.weights,
        "gap": solution.gap,
        "penetration": solution.penetration,
        "slip": _tangential(solution.slip),
        "pressure": solution.pressure,
        "friction": _tangential(solution.friction),
        "normal_state": normal,
        "tangential_state": tangential,
        "without_friction": problem.contact.without_friction,
        **solution.debonding,
    }


def _tangential(values: Array) -> Array | None:
    """Tangential components as numbers in 2D, vectors in 3D, and nothing in 1D."""
    if values.shape[1] == 1:
        return values[:, 0]
    return values if values.shape[1] > 1 else None


def laid_out(value: object, margin: str = "") -> str:
    """JSON of plain numbers, lists and strings, and of finite vectors (n, d); each key is on a line of its own."""
    if isinstance(value, np.ndarray):  # a list for each vector takes as long as the numbers
        row = ", ".join(["%r"] * value.shape[1])
        return "[" + ", ".join([f"[{row}]"] * len(value)) % tuple(value.ravel().tolist()) + "]"
    if not isinstance(value, dict) or not value:
        return json.dumps(value, allow_nan=False)
    inner = margin + " "
    lines = (f"{inner}{json.dumps(key)}: {laid_out(entry, inner)}" for key, entry in value.items())
    return "{\n" + ",\n".join(lines) + f"\n{margin}}}"


def write_json(
    solution: Solution,
    path: str | Path,
    certificate: Certificate | None = None,
    more: Mapping[str, object] | None = None,
    arrays: str | Path | None = None,
) -> Path:
    """Write :func:`solution_record`, and ``more`` keys, to a JSON file; returns its path.

    Parameters
    ----------
    solution : Solution
    path : str or Path
        Name of the file.
    certificate : Certificate, optional
        Written beside the solution.
    more : mapping of key to value, optional
        Keys and values, ready for JSON.
    arrays : str or Path, optional
        A file ``.npz`` in the same folder for the displacement and the numbers of the contact points, as
        ``displacement``, ``contact.pressure`` and so on; the JSON then names it under ``arrays`` in their place.

    Returns
    -------
    Path

    Raises
    ------
    ProblemError
        The name of a file does not fit.
    """
    path = prepared(path, ".json")
    if arrays is not None:
        return _with_arrays(solution, path, certificate, more or {}, prepared(arrays, ".npz"))
    record, moved = result_record(solution, certificate), solution.displacement
    record |= {key: plain(value) for key, value in ({} if more is None else more).items()}
    record["displacement"] = moved if moved.ndim == 2 and np.isfinite(moved).all() else plain(moved)
    write_text(path, laid_out(record) + "\n")
    return path


def _with_arrays(
    solution: Solution, path: Path, certificate: Certificate | None, more: Mapping[str, object], arrays: Path
) -> Path:
    """Write the arrays first: a JSON names what is there."""
    if os.path.realpath(arrays.parent) != os.path.realpath(path.parent):
        raise ProblemError(f"'{arrays}' must be in the folder of '{path}', which names it")
    beside = {"displacement": solution.displacement}
    beside |= {f"{_CONTACT}{key}": values for key, values in _contact_record(solution).items() if _numeric(values)}
    record = result_record(solution, certificate)
    record["contact"] = {key: values for key, values in _contact_record(solution).items() if not _numeric(values)}
    record |= {key: plain(value) for key, value in more.items()} | {"arrays": arrays.name}
    with whole_file(arrays) as name, name.open("wb") as stream:
        write_arrays(stream, beside)
    write_text(path, laid_out(plain(record)) + "\n")
    return path


def _numeric(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiub"


def _put_back(record: Record, path: Path) -> None:
    """The arrays that a record names, as its entries."""
    name = str(record["arrays"])
    if Path(name).name != name:
        raise ProblemError(f"result file '{path}' names arrays in another folder, '{name}'; write it again")
    try:
        arrays, sound = read_arrays(read_bytes(path.parent / name, "arrays of a result", MOST_BYTES))
    except ValueError as error:
        raise ProblemError(f"'{path.parent / name}' holds no arrays of a result ({error}); write it again") from error
    contact = record.setdefault("contact", {})
    if not sound or not isinstance(contact, dict):
        raise ProblemError(f"'{path.parent / name}' or '{path}' was damaged; write both again")
    for key, array in arrays.items():
        entries, last = (contact, key.removeprefix(_CONTACT)) if key.startswith(_CONTACT) else (record, key)
        entries[last] = array


def read_json(path: str | Path) -> Record:
    """A record written by :func:`write_json`; what stands in its second file comes as NumPy arrays."""
    path = path_of(path)
    text = read_text(path, "result file", MOST_BYTES)
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of too many digits, and brackets nested too deep
        raise ProblemError(f"result file '{path}' is not JSON ({error}); write it with write_json") from error
    if not isinstance(record, dict):
        raise ProblemError(f"result file '{path}' holds no record of a solution; write it with write_json")
    if "arrays" in record:
        _put_back(record, path)
    return record


def boundary_names(problem: DiscreteProblem) -> list[str] | None:
    """The contact boundary of each contact point; None if it is not known."""
    contact = problem.contact
    if problem.field is None or (contact.boundary < 0).any():
        return None
    return [contact.names[number] for number in contact.boundary.tolist()]


def prepared(path: str | Path, suffix: str) -> Path:
    """The path with its folder made; only the expected suffix is accepted."""
    path = path_of(path)
    if path.suffix.lower() != suffix:
        raise ProblemError(f"'{shown(path)}' must end in '{suffix}'")
    make_folder(path.parent)
    return path


def version() -> str:
    """The version of this library, as it is installed."""
    try:
        return metadata.version("hemivar")
    except metadata.PackageNotFoundError:
        return "unknown"
