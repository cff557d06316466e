"""Texts of problem files that several tests write."""

from __future__ import annotations

__all__ = [
    "MANUFACTURED",
    "MANUFACTURED_EXACT",
    "MANUFACTURED_MM",
    "MANUFACTURED_MM_EXACT",
    "SURVEY",
    "TRESCA",
    "block_file",
    "conditions",
]

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


#: A block with a displacement in closed form: u = (0, -0.1 - 0.05 (2 + cos(pi x)) y); the load, the upper face and the
#: gap are what it makes of them, and the pressure is 0.6 (2 + cos(pi x)).
MANUFACTURED = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[loads]
body = ["-0.4*pi*sin(pi*x)", "-0.2*pi^2*cos(pi*x)*y"]
[supports]
left = "roller"
right = "roller"
top = { displacement = [0.0, "-0.1 - 0.05*(2 + cos(pi*x))"] }
[contact.bottom]
normal = { law = "compliance", stiffness = 100.0 }
gap = "0.1 - 0.006*(2 + cos(pi*x))"
"""
MANUFACTURED_EXACT = ("0", "-0.1 - 0.05*(2 + cos(pi*x))*y")
#: The same with lengths in thousandths, and forces per area in millionths.
MANUFACTURED_MM = """
[mesh]
rectangle = [1e3, 1e3]
cells = [4, 4]
[material]
lame = [4e-6, 4e-6]
[loads]
body = ["-0.4e-9*pi*sin(pi*x/1e3)", "-0.2e-9*pi^2*cos(pi*x/1e3)*(y/1e3)"]
[supports]
left = "roller"
right = "roller"
top = { displacement = [0.0, "1e3*(-0.1 - 0.05*(2 + cos(pi*x/1e3)))"] }
[contact.bottom]
normal = { law = "compliance", stiffness = 100.0e-9 }
gap = "1e3*(0.1 - 0.006*(2 + cos(pi*x/1e3)))"
"""
MANUFACTURED_MM_EXACT = ("0", "1e3*(-0.1 - 0.05*(2 + cos(pi*x/1e3))*(y/1e3))")
