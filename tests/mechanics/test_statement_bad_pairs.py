"""Pairs of bodies that are stated wrongly: each is refused in a sentence that says what, where and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import HemivarError
from hemivar.mechanics import Plane, Quadrature

BLOCKS = {"u": hv.rectangle((1.0, 1.0), (3, 2), origin=(0.0, 1.0)), "l": hv.rectangle((1.0, 1.0), (2, 2))}
TWO = hv.Mesh.assembled(BLOCKS)
THREE = hv.Mesh.assembled({name: hv.rectangle((1.0, 1.0), 2, origin=(0.0, 2.0 - k)) for k, name in enumerate("abc")})
HELD = {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()}


def touching(against: Any = "l:top", name: str = "u:bottom", **more: Any) -> dict[str, hv.Contact]:
    return {name: hv.Contact(hv.Compliance(2.0), against=against, **more)}


def two(contact: Any = None, **more: Any) -> hv.ContactProblem:
    contact = touching() if contact is None else contact
    given = {"mesh": TWO, "material": hv.Material.lame(4.0, 4.0), "contact": contact, "supports": HELD}
    return hv.ContactProblem(**given | more)


def far(part: hv.Mesh) -> hv.ContactProblem:
    return two(mesh=hv.Mesh.assembled({"u": part, "l": BLOCKS["l"]}))


STATED: dict[str, tuple[Callable[[], object], str]] = {
    # what it touches
    "a part": (
        lambda: two(touching("l")),
        "'l', which is not a boundary; give one of l:left, l:right, l:bottom, l:top",
    ),
    "a typo": (lambda: two(touching("l:tpo")), "did you mean 'l:top'"),
    "without its part": (lambda: two(touching("top")), "names boundary 'top', which the mesh does not have"),
    "another case": (lambda: two(touching("L:top")), "names boundary 'L:top', which the mesh does not have"),
    "a dot": (lambda: two(touching("l.top")), "did you mean 'l:top'"),
    "a blank": (lambda: two(touching("l: top")), "did you mean 'l:top'"),
    "a part that is not there": (lambda: two(touching("m:top")), "names boundary 'm:top', which the mesh does not"),
    "itself": (lambda: two(touching("u:bottom")), "the two share facets, and self-contact is not available; name two"),
    "the other end of its part": (lambda: hv.discretize(two(touching("u:top"))), "no facet of the one faces the other"),
    "the side beside it": (lambda: hv.discretize(two(touching("u:left"))), "no facet of the one faces the other"),
    "a side at a right angle": (lambda: hv.discretize(two(touching("l:left"))), "check names, places and units"),
    "a number": (lambda: two(touching(3)), "against is 3; give the name of a boundary"),
    "an empty name": (lambda: two(touching("")), "against is ''; give the name of a boundary"),
    "an empty name of a slave": (lambda: two(touching(slave="")), "slave is ''; give the name of a boundary"),
    "several": (lambda: two(touching(("l:top", "l:left"))), "against is a tuple; give the name of a boundary"),
    "a mesh": (lambda: two(touching(BLOCKS["l"])), "against is a Mesh; give the name of a boundary"),
    "an interface": (
        lambda: two(
            touching("seam"),
            mesh=hv.Mesh.assembled(BLOCKS).with_interfaces({"seam": lambda x: np.abs(x[:, 1] - 0.5) < 1e-9}),
        ),
        "take mesh.opened('seam') and one of its sides",
    ),
    # where it stands
    "a part that touches": (lambda: two(touching(name="u")), "and bodies touch along boundaries; give one of u:left"),
    "a key with a typo": (lambda: two(touching(name="u:botom")), "did you mean 'u:bottom'"),
    "a key without its part": (
        lambda: two(touching("b:top", "a:bottom") | touching("c:top", "bottom"), mesh=THREE, supports={}),
        "contact names boundary 'bottom', which the mesh does not have",
    ),
    "twice, from both sides": (
        lambda: two(touching() | touching("u:bottom", "l:top")),
        "contact 'l:top' states the same two boundaries; state them once",
    ),
    "a chain by the wrong side": (
        lambda: hv.discretize(
            two(
                touching("b:top", "a:bottom") | touching("c:top", "b:top"),
                mesh=THREE,
                supports={"c:bottom": hv.Clamped(), "a:top": hv.Clamped()},
            )
        ),
        "contact 'b:top' against 'c:top': no facet of the one faces the other",
    ),
    "a name for a contact": (lambda: two({"u:bottom": "l:top"}), "contact['u:bottom'] is 'l:top'; wrap the law"),
    "one contact for all": (lambda: two(touching()["u:bottom"]), "contact must map boundary names to conditions"),
    # slaves
    "a slave that is none of the two": (lambda: two(touching(slave="u:left")), "give 'u:bottom' or 'l:top'"),
    "a part for a slave": (lambda: two(touching(slave="u")), "slave = 'u'; give 'u:bottom' or 'l:top'"),
    "a slave alone": (lambda: two(touching(None, slave="u:bottom")), "goes with against, the boundary that is touched"),
    "a number for a slave": (lambda: two(touching(slave=1)), "slave is 1; give the name of a boundary"),
    "a slave that is clamped": (
        lambda: hv.discretize(two(touching(slave="l:top"), supports=HELD | {"l:top": hv.Clamped()})),
        "supports hold all nodes of 'l:top'; give slave = 'u:bottom'",
    ),
    # gaps, and what a pair has not
    "a gap that is no formula": (
        lambda: two(touching(gap="0.1*width")),
        "gap: formula '0.1*width' at character 5: 'width' is not known",
    ),
    "a gap that is no number": (lambda: two(touching(gap=np.nan)), "gap: nan is not finite"),
    "a gap beyond numbers": (lambda: two(touching(gap=1e200)), "beyond the range of numbers"),
    "a gap of two columns": (
        lambda: hv.discretize(two(touching(gap=lambda x: x))),
        "gap of contact 'u:bottom' against 'l:top': the callable returned shape (4, 2)",
    ),
    "a gap that is nowhere": (
        lambda: hv.discretize(two(touching(gap=lambda x: np.full(len(x), np.nan)))),
        "gap of contact 'u:bottom' against 'l:top': the callable returned nan",
    ),
    "a gap in time": (
        lambda: hv.discretize(two(touching(gap=lambda x, t: t + 0.0 * x[:, 0]))),
        "a gap of the problem depends on time; take the problem at one time",
    ),
    "an obstacle": (lambda: two(touching(obstacle=Plane((0.0, 0.0), (0.0, 1.0)))), "touches one of the two: leave one"),
    "normals of an obstacle": (lambda: two(touching(normals="obstacle")), "needs an obstacle; give one or leave"),
    "a belt": (lambda: two(touching(belt=(1.0, 0.0))), "move the other body in place of a belt"),
    "a side": (lambda: two(touching(side="below")), "has a side, which is for one component; leave it out"),
    "damping at rest": (
        lambda: hv.discretize(two(touching(damping=hv.Compliance(1.0)))),
        "has damping, which means something in time only",
    ),
    "midpoints": (lambda: two(quadrature=Quadrature.MIDPOINT), "is for foundations; take Quadrature.NODAL"),
    "one component": (
        lambda: hv.ScalarProblem(TWO, 1.0, touching(), supports={"u:top": 0.0, "l:bottom": 0.0}),
        "a scalar problem has no bodies that touch; leave against out",
    ),
    # bodies
    "bodies far apart": (
        lambda: hv.discretize(far(hv.rectangle((1.0, 1.0), 2, origin=(5.0, 1.0)))),
        "no facet of the one faces the other along its normals; check names, places and units",
    ),
    "a body that is pulled off": (
        lambda: hv.discretize(two(supports={"l:bottom": hv.Clamped()}, tractions={"u:top": (0.0, 1.0)})),
        "part 'u' of the body, around x = (0.888889, 1.16667), is free to move",
    ),
    "a body that slips away": (
        lambda: hv.discretize(two(supports={"l:bottom": hv.Clamped()}, tractions={"u:top": (1.0, -1.0)})),
        "along the rigid motion (translation (1, 0))",
    ),
    "the key is clamped": (lambda: two(supports=HELD | {"u:bottom": hv.Clamped()}), "no contact can happen there"),
    "a material without one part": (
        lambda: hv.discretize(two(material=hv.Material.by_region({"u": hv.Material.lame(4.0, 4.0)}))),
        "lies in no region that the material names",
    ),
    "a material of another part": (
        lambda: hv.discretize(
            two(material=hv.Material.by_region(dict.fromkeys(("u", "lower"), hv.Material.lame(4.0, 4.0))))
        ),
        "names region 'lower', which the mesh does not have; it has: l, u",
    ),
    "a support without its part": (lambda: two(supports={"bottom": hv.Clamped()}), "did you mean 'u:bottom'"),
    "a load on a part": (lambda: two(tractions={"u": (0.0, 1.0)}), "give one of u:left, u:right, u:bottom, u:top"),
}


@pytest.mark.parametrize("case", list(STATED))
def test_what_is_stated_wrongly_is_told(case: str) -> None:
    make, words = STATED[case]
    with pytest.raises(HemivarError, match=re.escape(words)):
        make()
