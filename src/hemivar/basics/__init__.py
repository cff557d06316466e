"""What every room needs: arrays and arguments that are checked, files, deadlines, memory, pickling."""

__all__ = []
