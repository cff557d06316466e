"""Use cases: each takes a problem and options, yields events while it works, and returns a value.

    for event in hemivar.workflows.run(problem):
        ...
    result = hemivar.workflows.result_of(hemivar.workflows.run(problem))

Nothing here prints or ends the process, or writes a file but where options name one to go on from: the command, a
notebook and a window show the same work.  :func:`study` and :func:`sweep` are :func:`studying` and :func:`sweeping` run
to their end.
"""

from __future__ import annotations

from hemivar.basics.first_use import on_demand

__getattr__, __dir__, __all__ = on_demand(__name__, __file__)
