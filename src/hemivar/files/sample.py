"""A problem file to begin with."""

from __future__ import annotations

__all__ = ["SAMPLE"]

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
# file = "part.msh"          # or: Gmsh or anything meshio reads; its physical groups give
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
