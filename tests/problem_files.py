"""Texts of problem files that several tests write."""

from __future__ import annotations

__all__ = ["SURVEY", "TRESCA", "block_file", "conditions"]

SURVEY = '{ law = "survey", q_max = 0.3, p_const = 2.0 }'
TRESCA = '{ law = "tresca", bound = 0.5 }'


def block_file(cells: int, *, normal: str = SURVEY, friction: str | None = TRESCA, title: str = "block") -> str:
    """The survey's square with so many cells along each side, on a foundation."""
    mesh = f'title = "{title}"\n[mesh]\nrectangle = [1.0, 1.0]\ncells = [{cells}, {cells}]\n'
    return mesh + conditions(normal, friction)


def conditions(normal: str = SURVEY, friction: str | None = TRESCA, body: str = "[-0.8, -0.8]") -> str:
    """All but the mesh: clamped on the left, a load, contact on the bottom."""
    lines = [
        "[material]", "lame = [4.0, 4.0]",
        "[loads]", f"body = {body}",
        "[supports]", 'left = "clamped"',
        "[contact.bottom]", f"normal = {normal}",
    ]  # fmt: skip
    return "\n".join([*lines, *([] if friction is None else [f"friction = {friction}"]), ""])
