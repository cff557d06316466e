"""Whether an accepted answer is right: the physics of a problem file examined without any code of the library.

The displacement and the mesh come from the VTU file, forces and contact points from the JSON file; the problem file is
read again, and everything else (stiffness, loads, supports, gaps, contact normals and weights, laws) is built anew.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.expression import UnknownError
from tests.robustness.graphs import SenselessError
from tests.robustness.msh import MalformedError
from tests.robustness.physics import Physics, Verdict

__all__ = ["Verdict", "examine", "examine_many", "examine_record"]


def examine(
    folder: Path, problem: str, answer: str, fields: str | None, rtol: float, verdict: Verdict | None = None
) -> Verdict:
    """Examine an answer.

    Parameters
    ----------
    folder : Path
        Of the case.
    problem, answer : str
        Names of the problem file and of the JSON file.
    fields : str or None
        Name of a VTU file on the same mesh.
    rtol : float
        The tolerance of the solve.
    """
    verdict = Verdict() if verdict is None else verdict
    try:
        record = json.loads((folder / answer).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        verdict.wrong.append(f"the JSON file cannot be read: {error}")
        return verdict
    examine_record(folder, problem, record, fields, rtol, verdict, together=True)
    return verdict


def examine_record(
    folder: Path,
    problem: str,
    record: Mapping[str, Any],
    fields: str | None,
    rtol: float,
    verdict: Verdict,
    together: bool = False,
) -> None:
    """Like :func:`examine`, for a record that has been read; ``together`` if one run wrote it and the VTU file."""
    if "residual" in record:  # a displacement for `certify` needs none
        _plain_checks(record, rtol, verdict)
    try:
        data = tomllib.loads(
            (folder / problem).read_bytes().decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
        )
    except (OSError, ValueError, RecursionError) as error:
        verdict.wrong.append(f"a problem file that is not TOML was accepted: {error}")
        return
    if fields is None:
        verdict.left_out.append("everything: there is no mesh")
        return
    try:
        with np.errstate(all="ignore"):
            Physics(folder, data, record, fields, rtol, verdict, together).examine()
    except SenselessError as error:
        verdict.wrong.append(f"accepted though senseless: {error}")
    except MalformedError as error:
        verdict.wrong.append(f"a malformed mesh was accepted: {error}")
    except UnknownError as error:
        verdict.left_out.append(str(error))


def examine_many(folder: Path, problem: str, answer: str, fields: str | None, alone: str | None) -> Verdict:
    """Examine the answers of ``hemivar solutions``, and compare them with each other and with that of a solve."""
    verdict = Verdict()
    try:
        record = json.loads((folder / answer).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        verdict.wrong.append(f"the JSON file cannot be read: {error}")
        return verdict
    found = record["solutions"]
    for one in found:
        examine_record(folder, problem, one, fields, 1e-9, verdict)
    fields_found = [np.array(one["displacement"], dtype=float) for one in found]
    size = max((float(np.abs(u).max()) for u in fields_found), default=0.0)
    for i, first in enumerate(fields_found):
        for j in range(i):
            apart = float(np.abs(first - fields_found[j]).max())
            forces = [np.array(found[k]["contact"]["pressure"], dtype=float) for k in (i, j)]
            unlike = float(np.abs(forces[0] - forces[1]).max(initial=0.0))
            same = apart <= 1e-7 * size and unlike <= 1e-5 * max(float(np.abs(f).max(initial=0.0)) for f in forces)
            verdict.demand(not same, f"solutions {j + 1} and {i + 1} are the same")
    if alone is not None and record["exhaustive"] and (folder / alone).exists():
        other = json.loads((folder / alone).read_text(encoding="utf-8"))
        if other.get("status") == "converged":
            u = np.array(other["displacement"], dtype=float)
            near = min((float(np.abs(u - v).max()) for v in fields_found), default=math.inf)
            scale = max(size, float(np.abs(u).max()))
            verdict.demand(near <= 1e-5 * scale, f"'exhaustive', but what solve finds is missing ({near:.2g} away)")
            verdict.examined.append("the search holds what solve finds")
            unique = (other.get("certificate") or {}).get("unique")
            verdict.demand(not (unique and len(found) > 1), f"{len(found)} solutions where one is certified unique")
    return verdict


def _plain_checks(record: Mapping[str, Any], rtol: float, verdict: Verdict) -> None:
    """What the record says of itself."""
    residual, parts = record.get("residual"), record.get("residual_parts") or {}
    rounding, scale = parts.get("rounding"), parts.get("scale")
    known = all(isinstance(x, float | int) and math.isfinite(x) for x in (residual, rounding, scale))
    verdict.demand(known, f"residual {residual}, parts {parts}")
    if known:
        # what arithmetic leaves behind may be allowed for, but not without end
        # a method that certifies its own error may leave a residual of 1e-6 (docs/theory/inequality.md)
        certified = record.get("method") == "bundle" and record.get("error_bound") is not None
        allowed = (1e-6 if certified else rtol) + (min(rounding / scale, 1e-6) if scale else 0.0)
        verdict.demand(residual <= 1.001 * allowed + 1e-300, f"converged with a residual of {residual:.3g}")
    for key in ("energy", "displacement"):
        verdict.demand(_finite(record.get(key)), f"{key} holds what is not a finite number")
    for key in ("penetration", "pressure", "weight"):
        verdict.demand(_finite(record["contact"].get(key)), f"contact.{key} holds what is not a finite number")
    certificate = record.get("certificate")
    if certificate and certificate.get("unique"):
        sampled = bool(certificate.get("alpha_sampled"))
        verdict.demand(not sampled, "certified unique, but alpha is sampled")
        # where contact alone holds a body there is no margin, and a bound of the error needs one
        unknown = certificate.get("error_bound") is None and certificate.get("margin") is not None
        verdict.demand(not unknown, "certified unique without a bound of the error")
    verdict.examined.append("record")


def _finite(value: Any) -> bool:
    try:
        return bool(np.isfinite(np.array(value, dtype=float)).all())
    except (TypeError, ValueError):
        return False
