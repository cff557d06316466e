"""Pairs of bodies that are stated wrongly: each is refused in a sentence that says what, where and what to do."""

from __future__ import annotations

import re

import pytest

import hemivar as hv
from hemivar.errors import HemivarError
from hemivar.files.changes import read_change
from hemivar.files.problem_file import parse_problem_file

FILE = """
[mesh.u]
rectangle = [1.0, 1.0]
cells = [3, 2]
shift = [0.0, 1.0]

[mesh.l]
rectangle = [1.0, 1.0]
cells = [2, 2]

[material]
lame = [4.0, 4.0]

[supports]
"l:bottom" = "clamped"
"u:top" = "clamped"

[contact."u:bottom"]
against = "l:top"
normal = { law = "compliance", stiffness = 2.0 }
"""


LOWER = "[mesh.l]\nrectangle = [1.0, 1.0]\ncells = [2, 2]"


HEAT = "[time]\nuntil = 1.0\nstep = 0.5\n[heat]\nconductivity = 1.0\ncapacity = 1.0\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "[mesh.u]",
            "[mesh]",
            "rectangle: belongs to one part, but the mesh has parts; write it under [mesh.l]",
        ),
        (LOWER, "", "the mesh has no boundary 'l:bottom'"),
        (LOWER, "[mesh.l]", "[mesh.l] rectangle, box, file: none is given; give one of the three"),
        (LOWER, '[mesh.l]\nfile = "gone.msh"', "[mesh] u, l: mesh file 'gone.msh' does not exist; check the path"),
        (LOWER, "[mesh.l]\nbox = [1.0, 1.0, 1.0]\ncells = 2", "part 'u' is plane and part 'l' is not"),
        ("[mesh.u]", '[mesh."u:v"]', "give a name without a colon, such as 'upper'"),
        ('[contact."u:bottom"]', "[contact.u:bottom]", 'put the name in quotes, for it has a colon: "u:bottom"'),
        ('"l:bottom" = "clamped"', 'l:bottom = "clamped"', 'put the name in quotes, for it has a colon: "l:bottom"'),
        ('[contact."u:bottom"]', "[contact.bottom]", "the mesh has no boundary 'bottom'; did you mean 'u:bottom'"),
        ('against = "l:top"', 'against = "l"', "give one of l:left, l:right, l:bottom, l:top"),
        ('against = "l:top"', "against = 3", "[contact.u:bottom] against: must be a text, not the number 3"),
        ('against = "l:top"', 'against = ["l:top"]', "[contact.u:bottom] against: must be a text, not a list"),
        ("against", "againts", "unknown key; did you mean 'against'"),
        ('"l:top"', '"l:top"\nslave = true', "[contact.u:bottom] slave: must be a text, not true"),
        ('"l:top"', '"l:top"\ngap = "0.1*z"', "gap: formula '0.1*z' uses z, but the mesh is plane; use x and y"),
        ('"l:top"', '"l:top"\ngap = "0.1*"', "gap: formula '0.1*' at character 4: not understood"),
        ('"l:top"', '"l:top"\ngap = [0.1]', "gap: must be a number or a formula in quotes, not a list"),
        ("shift = [0.0, 1.0]", "shift = 1.0", "[mesh.u] shift: must be a list of numbers"),
        ("shift = [0.0, 1.0]", 'turn = "30"', "[mesh.u] turn: must be a number, not the text '30'"),
        ("shift = [0.0, 1.0]", 'opened = ["glue"]', "the mesh has no interface 'glue'"),
        ("[supports]", f'{HEAT}contact = {{ "l:top" = {{ conductance = 1.0 }} }}\n[supports]', "is the boundary that"),
        (
            "[supports]",
            f'{HEAT}contact = {{ "u:bottom" = {{ conductance = 1.0, temperature = 20 }} }}\n[supports]',
            "has the temperature of a foundation, and 'u:bottom' touches 'l:top'",
        ),
        ("[supports]", f"{HEAT}\n[supports]".replace("= 1.0\ncap", "= { u = 1.0 }\ncap"), "lies in no region that the"),
    ],
)
def test_what_files_of_pairs_refuse(old: str, new: str, words: str) -> None:
    assert old in FILE

    def stated() -> None:
        found = parse_problem_file(FILE.replace(old, new, 1))
        hv.discretize(found.heat.conduction(found.problem) if found.heat else found.problem, evolving=True)

    with pytest.raises(HemivarError, match=re.escape(words)):
        stated()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("contact.u:botom.normal.stiffness=3", "there is no table 'u:botom' in [contact]; did you mean 'u:bottom'"),
        ("contact.u.normal.stiffness=3", "there is no table 'u' in [contact] (there are: u:bottom)"),
        ("mesh.w.cells=4", "there is no table 'w' in [mesh] (there are: u, l)"),
        ("contact.u:bottom.against=l:top", "write texts and formulas in quotes"),
        ('contact.u:bottom.against=""', "[contact.u:bottom] against: is empty; write"),
        ('contact.u:bottom.slave="u"', "slave = 'u'; give 'u:bottom' or 'l:top'"),
    ],
)
def test_what_changes_of_pairs_refuse(change: str, words: str) -> None:
    with pytest.raises(HemivarError, match=re.escape(words)):
        parse_problem_file(FILE, changes=[read_change(change)])
