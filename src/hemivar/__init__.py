"""hemivar: hemivariational inequalities of contact mechanics, computed, certified and drawn.

    problem = hemivar.ContactProblem(mesh=..., material=..., supports=..., contact=...)
    solution = hemivar.solve(hemivar.discretize(problem))

Names are loaded when they are first used, so that ``import hemivar`` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.handed_on import hand_on

__version__ = "0.1.0"

_EXPORTS = {
    "hemivar.errors": ("HemivarError", "MethodError", "ProblemError"),
    "hemivar.laws": (
        "Adhesive",
        "Bilateral",
        "Bonding",
        "Capped",
        "Compliance",
        "ContactLaw",
        "Coulomb",
        "CoulombBound",
        "DampedContact",
        "FinitePenetration",
        "FormulaLaw",
        "Friction",
        "FunctionLaw",
        "Layered",
        "Logarithmic",
        "Memory",
        "NoContact",
        "NoFriction",
        "PenetrationBound",
        "PenetrationMemory",
        "PiecewiseQuadratic",
        "RateAndState",
        "SawTooth",
        "Secant",
        "Signorini",
        "SlipSum",
        "SlipTable",
        "SlipWeakening",
        "Softening",
        "StaticKinetic",
        "Superpotential",
        "SurveyLaw",
        "Tresca",
        "ViscousFoundation",
        "Wear",
        "affine",
        "bonded",
        "envelope",
        "plus",
        "read_law_table",
        "secant",
        "table_law",
    ),
    "hemivar.mesh": (
        "Mesh",
        "box",
        "read_mesh",
        "rectangle",
    ),
    "hemivar.discrete": (
        "DiscreteProblem",
        "residual",
    ),
    "hemivar.mechanics": (
        "Branch",
        "Clamped",
        "Contact",
        "ContactProblem",
        "Cylinder",
        "Fixed",
        "Heat",
        "HeatContact",
        "Material",
        "Normals",
        "Plane",
        "Prescribed",
        "Pressure",
        "Quadrature",
        "Roller",
        "ScalarContact",
        "ScalarProblem",
        "SignedDistance",
        "Sphere",
    ),
    "hemivar.fem": ("discretize",),
    "hemivar.systems": ("Workspace", "condense"),
    "hemivar.files": ("read_problem", "write_problem"),
    "hemivar.solvers": (
        "LBFGS",
        "METHODS",
        "AugmentedLagrangian",
        "AugmentedLagrangianNewton",
        "Controls",
        "ExactInner",
        "FixedPoint",
        "LoadStepping",
        "NewtonKrylov",
        "NonsmoothMultigrid",
        "NonsmoothNewton",
        "NormalState",
        "Powell",
        "PrimalDualActiveSet",
        "ProximalBundle",
        "SemismoothNewton",
        "Solution",
        "Status",
        "TangentialState",
        "solve",
        "solve_nested",
    ),
    "hemivar.branches": ("Path", "SolutionSet", "find_solutions", "follow_path"),
    "hemivar.certificates": ("Certificate", "DistanceToExact", "Smallness", "certify", "smallness"),
    "hemivar.adapt": (
        "AdaptiveEnd",
        "AdaptiveLevel",
        "AdaptiveSolution",
        "Goal",
        "GoalValue",
        "goal_named",
        "goal_value",
        "known_goals",
        "solve_adaptive",
    ),
    "hemivar.certificates.continuous": ("ExactDistance", "exact_distance", "lower_bounds"),
    "hemivar.evolution": (
        "AdaptiveStep",
        "BondBroken",
        "Checkpoint",
        "Evolution",
        "FixedStep",
        "GeneralizedAlpha",
        "History",
        "ImplicitEuler",
        "Jump",
        "March",
        "MarginLost",
        "Midpoint",
        "MoreauJean",
        "Newmark",
        "Release",
        "BDF2",
        "SDIRK2",
        "Save",
        "Slip",
        "Touch",
        "When",
        "march",
    ),
    "hemivar.workflows.study": ("Study", "study"),
    "hemivar.workflows.sweep": ("Sweep", "sweep"),
}
#: Rooms that are there as attributes, such as ``hemivar.report.plot_solution``.
_ROOMS = ("files", "gallery", "report", "workflows")
#: Methods that hand their value on to a function of a room above, loaded when they are called.
_HANDED_ON = {
    "Displayed._repr_html_": "report.notebook.html_of",
    "Displayed.plot": "report.notebook.picture_of",
    "Displayed.show": "report.window.show",
    "Displayed.to_dataframe": "report.frames.frame_of",
    "Solution.summary": "report.summary.summary_of",
    "Solution.certify": "certificates.certify",
    "Solution.to_dict": "files.solution_record",
    "Solution.to_json": "files.write_json",
    "Solution.to_vtu": "files.write_vtu",
    "Solution.plot": "report.solution_pictures.plot_body_or_points",
    "History.write": "files.write_history",
    "History.to_dict": "files.history_record",
    "History.to_json": "files.write_history_json",
    "History.to_dataframe": "files.history_frame",
    "History.plot": "report.plot_march",
    "History.animate": "report.animate",
}
hand_on(_HANDED_ON)
_HOME = {name: module for module, names in _EXPORTS.items() for name in names}

__all__ = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> Any:
    if name not in _ROOMS and name not in _HOME:
        raise AttributeError(f"module 'hemivar' has no attribute {name!r}")
    with IMPORTS:
        if name in _ROOMS:
            return importlib.import_module(f"hemivar.{name}")
        value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)


if TYPE_CHECKING:
    # What a type checker counts as exported; a test compares it with the names above.
    # fmt: off
    __all__ = [  # noqa: RUF022 - in the order of the names above
        "__version__", "AdaptiveEnd", "AdaptiveLevel", "AdaptiveSolution", "AdaptiveStep", "Adhesive",
        "AugmentedLagrangian", "AugmentedLagrangianNewton", "BDF2", "Bilateral", "BondBroken", "Bonding", "Branch",
        "Capped", "Certificate", "Checkpoint", "Clamped", "Compliance", "Contact", "ContactLaw", "ContactProblem",
        "Controls", "Coulomb",
        "CoulombBound", "Cylinder", "DampedContact", "DiscreteProblem", "DistanceToExact", "Evolution",
        "ExactDistance", "ExactInner", "FinitePenetration", "Fixed", "FixedPoint", "FixedStep", "FormulaLaw",
        "Friction", "FunctionLaw", "GeneralizedAlpha", "Goal", "GoalValue", "Heat", "HeatContact", "HemivarError",
        "History", "ImplicitEuler", "Jump", "LBFGS", "Layered", "LoadStepping", "Logarithmic", "METHODS", "March",
        "MarginLost", "Material", "Memory", "Mesh", "MethodError", "Midpoint", "MoreauJean", "Newmark",
        "NewtonKrylov", "NoContact", "NoFriction", "NonsmoothMultigrid", "NonsmoothNewton", "NormalState", "Normals",
        "Path", "PenetrationBound", "PenetrationMemory", "PiecewiseQuadratic", "Plane", "Powell", "Prescribed",
        "Pressure", "PrimalDualActiveSet", "ProblemError", "ProximalBundle", "Quadrature", "RateAndState", "Release",
        "Roller", "SDIRK2", "Save", "SawTooth", "ScalarContact", "ScalarProblem", "Secant", "SemismoothNewton",
        "SignedDistance", "Signorini", "Slip", "SlipSum", "SlipTable", "SlipWeakening", "Smallness", "Softening",
        "Solution", "SolutionSet", "Sphere", "StaticKinetic", "Status", "Study", "Superpotential", "SurveyLaw",
        "Sweep", "TangentialState", "Touch", "Tresca", "ViscousFoundation", "Wear", "When", "Workspace", "affine",
        "bonded", "box", "certify", "condense", "discretize", "envelope", "exact_distance", "find_solutions",
        "follow_path", "goal_named", "goal_value", "known_goals", "lower_bounds", "march", "plus", "read_law_table",
        "read_mesh", "read_problem", "rectangle", "residual", "secant", "smallness", "solve", "solve_adaptive",
        "solve_nested", "study", "sweep", "table_law", "write_problem",
    ]
    # fmt: on

    import hemivar.files as files
    import hemivar.gallery as gallery
    import hemivar.report as report
    import hemivar.workflows as workflows
    from hemivar.adapt import (
        AdaptiveEnd,
        AdaptiveLevel,
        AdaptiveSolution,
        Goal,
        GoalValue,
        goal_named,
        goal_value,
        known_goals,
        solve_adaptive,
    )
    from hemivar.branches import Path, SolutionSet, find_solutions, follow_path
    from hemivar.certificates import Certificate, DistanceToExact, Smallness, certify, smallness
    from hemivar.certificates.continuous import ExactDistance, exact_distance, lower_bounds
    from hemivar.discrete import DiscreteProblem, residual
    from hemivar.errors import HemivarError, MethodError, ProblemError
    from hemivar.evolution import (
        BDF2,
        SDIRK2,
        AdaptiveStep,
        BondBroken,
        Checkpoint,
        Evolution,
        FixedStep,
        GeneralizedAlpha,
        History,
        ImplicitEuler,
        Jump,
        March,
        MarginLost,
        Midpoint,
        MoreauJean,
        Newmark,
        Release,
        Save,
        Slip,
        Touch,
        When,
        march,
    )
    from hemivar.fem import discretize
    from hemivar.files import read_problem, write_problem
    from hemivar.laws import (
        Adhesive,
        Bilateral,
        Bonding,
        Capped,
        Compliance,
        ContactLaw,
        Coulomb,
        CoulombBound,
        DampedContact,
        FinitePenetration,
        FormulaLaw,
        Friction,
        FunctionLaw,
        Layered,
        Logarithmic,
        Memory,
        NoContact,
        NoFriction,
        PenetrationBound,
        PenetrationMemory,
        PiecewiseQuadratic,
        RateAndState,
        SawTooth,
        Secant,
        Signorini,
        SlipSum,
        SlipTable,
        SlipWeakening,
        Softening,
        StaticKinetic,
        Superpotential,
        SurveyLaw,
        Tresca,
        ViscousFoundation,
        Wear,
        affine,
        bonded,
        envelope,
        plus,
        read_law_table,
        secant,
        table_law,
    )
    from hemivar.mechanics import (
        Branch,
        Clamped,
        Contact,
        ContactProblem,
        Cylinder,
        Fixed,
        Heat,
        HeatContact,
        Material,
        Normals,
        Plane,
        Prescribed,
        Pressure,
        Quadrature,
        Roller,
        ScalarContact,
        ScalarProblem,
        SignedDistance,
        Sphere,
    )
    from hemivar.mesh import Mesh, box, read_mesh, rectangle
    from hemivar.solvers import (
        LBFGS,
        METHODS,
        AugmentedLagrangian,
        AugmentedLagrangianNewton,
        Controls,
        ExactInner,
        FixedPoint,
        LoadStepping,
        NewtonKrylov,
        NonsmoothMultigrid,
        NonsmoothNewton,
        NormalState,
        Powell,
        PrimalDualActiveSet,
        ProximalBundle,
        SemismoothNewton,
        Solution,
        Status,
        TangentialState,
        solve,
        solve_nested,
    )
    from hemivar.systems import Workspace, condense
    from hemivar.workflows.study import Study, study
    from hemivar.workflows.sweep import Sweep, sweep
