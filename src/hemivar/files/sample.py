"""Templates: problem files to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from hemivar.basics.arguments import suggest
from hemivar.basics.disk import read_text
from hemivar.errors import ProblemError

__all__ = ["SAMPLE", "TEMPLATES", "template"]

#: A problem that solves as it is; what ``hemivar new`` writes.
SAMPLE = """\
# A contact problem for hemivar.  Solve it with:   hemivar solve FILE --plot figure.png
# Lengths and forces are in any consistent units.  Every number marked (f) may also be a formula in quotes,
# such as "0.1 * x * (1 - x)", with sin cos tan tanh exp log sqrt abs min max and pi.

title = "elastic block, dragged over a foundation"

[mesh]
rectangle = [1.0, 1.0]       # width and height; boundaries: left, right, bottom, top
cells = [32, 32]             # along x and y
pattern = "cross"            # "cross": four triangles in each rectangle; "right" or "left": two
# box = [1.0, 1.0, 1.0]      # instead of a rectangle, with cells = [8, 8, 8]; boundaries also: front, back (y)
# file = "part.msh"          # or: Gmsh, Abaqus, Nastran, ...; its groups give
                             # the names of boundaries and regions
# refine = 1                 # cut every triangle into four, so many times
# order = 2                  # quadratic elements

[material]
lame = [4.0, 4.0]            # lambda and mu (f)
# young = 10.0               # or: Young's modulus (f)
# poisson = 0.25             #     and Poisson's ratio (f)
# plane = "stress"           # "strain" is the default

[loads]
body = [-0.8, -0.8]          # force per area of the body (f)
traction = { top = [0.0, 0.0] }   # force per length of the boundary (f)
# pressure = { right = 0.1 } # along the inward normal (f)

[supports]                   # by boundary: "clamped", "roller" (no normal displacement),
left = "clamped"             # { x = 0.0 } (one component) or { displacement = [0.0, -0.1] } (f)

[contact.bottom]             # one table for each boundary that may touch a foundation
normal = { law = "survey", q_max = 0.3, p_const = 2.0 }   # hemivar laws lists the laws (f)
friction = { law = "tresca", bound = 0.5 }                # leave it out for no friction (f)
gap = 0.0                    # distance between body and foundation (f)

# [solver]
# method = "newton"          # hemivar methods lists the methods
# rtol = 1e-10               # tolerance of the residual, relative to the load
"""

#: Problem files that come with the package, beside the sample: name, file and what it is.
_SHIPPED = {
    "survey": ("survey_5_1.toml", "the survey's body, data (5.1): a block dragged over a foundation"),
    "softening": ("softening.toml", "a foundation that gives way: one solution, or several"),
    "delamination": ("delamination.toml", "a strip pulled off the ground that it is glued to"),
    "hertz": ("hertz_line.toml", "rigid contact: a steel block on a cylinder (mm, N, MPa)"),
    "two-bodies": ("two_bodies.toml", "a block pressed and dragged over another one (mm, N, MPa)"),
    "press-fit": ("press_fit.toml", "two rings shrunk onto one another, as bodies of revolution"),
    "cube": ("cube_friction.toml", "three dimensions: a cube with friction"),
    "bounce": ("bounce.toml", "in time: a block falls, bounces and comes to rest (hemivar march)"),
    "membrane": ("membrane_obstacle.toml", "a scalar problem: a membrane pressed onto a hill"),
}
#: Problem files to begin with, by the names of ``hemivar new --template``, and what each is.
TEMPLATES: Mapping[str, str] = MappingProxyType(
    {"sample": "a commented file with most of what can be said", **{name: what for name, (_, what) in _SHIPPED.items()}}
)


def template(name: str) -> str:
    """The text of a template."""
    if name == "sample":
        return SAMPLE
    if name not in _SHIPPED:
        raise ProblemError(f"template '{name}' is not known{suggest(name, list(TEMPLATES))}")
    return read_text(Path(__file__).parent / "templates" / _SHIPPED[name][0], "template")
