"""Problems with known answers, of the survey and of the literature, static and in time.

Every function returns one value that may be given wherever a problem or an evolution is asked for (``hv.solve``,
``hv.discretize``, ``hv.march``, ...): a statement, for bars a discrete problem, or, where the solution is known, a
:class:`~hemivar.basics.known_statement.ManufacturedProblem` that holds it beside its ``statement``.
"""

from __future__ import annotations

from hemivar.basics.first_use import on_demand

__getattr__, __dir__, __all__ = on_demand(__name__, __file__)
