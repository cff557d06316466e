"""The command."""

from hemivar.cli.app import app, main

__all__ = ["app", "main"]
