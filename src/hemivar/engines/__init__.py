"""Engines: the same method on other machines than one."""

__all__ = []
