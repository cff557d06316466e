"""Bodies of the commands; :mod:`hemivar.cli` registers them."""

__all__: list[str] = []
