"""hemivar: hemivariational inequalities of contact mechanics, computed, certified and drawn.

    problem = hemivar.ContactProblem(mesh=..., material=..., supports=..., contact=...)
    solution = hemivar.solve(problem)

Which names there are stands in ``__init__.pyi``, beside this file; they are loaded when they are first used, so that
``import hemivar`` is quick.  The others are in ``hemivar.laws``, ``hemivar.materials``, ``hemivar.solvers`` and so on.
"""

from __future__ import annotations

import importlib
import pkgutil

import lazy_loader

from hemivar.basics.defined_above import MISSING, define_above
from hemivar.basics.first_use import IMPORTS

__version__ = "0.1.0"

#: All that the method leaves to packages which use it; loaded when it is called, a sentence where the package is not
#: installed.
_DEFINED_ABOVE = {
    "ReprMixin._repr_html_": "report.notebook.html_of",
    "ReprMixin.plot": "report.notebook.picture_of",
    "ReprMixin.show": "report.notebook.show",
    "ReprMixin.to_dataframe": "report.notebook.frame_of",
    "DiscreteProblem.of_forms": "fem.forms.of_forms",
    "residual.residual": "fem.stress_stiffness.under_own_stress",
    "Solution.summary": "report.summary.summary_of",
    "Fit.plot": "identification.identification_figure.plot_fit",
    "Fit.summary": "identification.identification_figure.fit_summary",
    "Solution.certify": "certificates.certify",
    "Solution.to_dict": "files.solution_record",
    "Solution.to_json": "files.write_json",
    "Solution.to_vtu": "files.write_vtu",
    "Solution.plot": "report.solution_pictures.plot_body_or_points",
    "History.write": "files.history_table.write_history",
    "History.to_json": "files.history_table.write_history_json",
    "History.plot": "report.plot_march",
    "History.animate": "report.animate",
    "certificate.certify": "bounds.exact_certificate.distance_to_exact",
    "smallness.trace_bound": "bounds.exact_certificate.trace_bound",
    "stage_solver.follow_minimisers": "branches.along_minimisers.follow_minimisers",
    "stage_solver.find_solutions": "branches.solutions.find_solutions",
    "methods.further_methods": "survey.further_methods.further_methods",
    "engine.engine_named": "ranks.petsc_engine.PetscEngine",
}
define_above(_DEFINED_ABOVE)

_attached, _, _names = lazy_loader.attach_stub(__name__, __file__)
#: Rooms that are there as attributes, such as ``hemivar.laws``.
_ROOMS = tuple(sorted({module.name for module in pkgutil.iter_modules(__path__)}.intersection(_names)))
__all__ = ["__version__", *(name for name in _names if name not in _ROOMS)]


def __getattr__(name: str) -> object:
    with IMPORTS:
        if name.startswith("_") or name in _names:
            return _loaded(name)
        rooms = [room for room in _ROOMS if _shows(room, name)]
    where = f"; it is hemivar.{rooms[0]}.{name}" if rooms else ""
    raise AttributeError(f"module 'hemivar' has no attribute '{name}'{where}")


def _loaded(name: str) -> object:
    """What a name stands for; a sentence where the package that it comes from is not installed."""
    try:
        return _attached(name)
    except ModuleNotFoundError as error:
        package = error.name or ""
        if not package.startswith("hemivar."):
            raise
        what = package if package == f"hemivar.{name}" else f"hemivar.{name} is part of {package}, which"
        raise ModuleNotFoundError(f"{what} is {MISSING}", name=package) from None


def _shows(room: str, name: str) -> bool:
    """Whether a room has a public name; one that is not installed has none."""
    try:
        return name in getattr(importlib.import_module(f"hemivar.{room}"), "__all__", ())
    except ModuleNotFoundError:
        return False


def __dir__() -> list[str]:
    return [*__all__, *_ROOMS]
