"""How objects show themselves in a notebook."""

from __future__ import annotations

__all__ = ["Displayed"]


class Displayed:
    """Base of classes that a notebook shows by a small picture and a table, see :mod:`hemivar.report.notebook`."""

    def _repr_html_(self) -> str:
        from hemivar.report.notebook import html_of

        return html_of(self)
