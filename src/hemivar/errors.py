"""Errors that hemivar raises; each message says what is wrong, where, and what to do."""

from __future__ import annotations

__all__ = ["FileError", "HemivarError", "MethodError", "ProblemError", "SupportError"]


class HemivarError(Exception):
    """Base of all errors raised by hemivar.

    Examples
    --------
    >>> import hemivar as hv
    >>> try:
    ...     hv.rectangle((1.0, -1.0), 4)
    ... except hv.HemivarError as error:
    ...     print(error)
    size = (1.0, -1.0); every length must be positive
    """


class ProblemError(HemivarError, ValueError):
    """The problem, a law or a file is not usable as stated."""


class SupportError(ProblemError):
    """The supports of a body leave it free to move, or contradict one another or a law."""


class MethodError(HemivarError, ValueError):
    """The chosen method cannot treat this problem; the message says why and names one that can."""


class FileError(ProblemError):
    """A file cannot be read or written; the message names it."""
