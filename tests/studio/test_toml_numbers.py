"""Numbers in TOML texts: found where they stand, and replaced without a change of anything else."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.basics.units import Units
from hemivar.files.sample import TEMPLATES, template
from hemivar.files.toml import text_of
from hemivar.studio.sliders import key_of_message, sliders_of
from hemivar.studio.toml_numbers import numbers_of, replaced

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "problems").glob("*.toml"))
HARD = r'''
# 1 = 2, [table]
"a.b" = 1 # 7
'c"d' = [1.5, # 3
  "2", '3', [4, 5,], { x = -6.0e-1, "y 1" = [7] },
]
text = """8 " \""" 9"""
other = SSS
10 = 11'SSS
later.on = {deep.er = 12, t = true}
day = 1979-05-27T07:32:00Z
odd = [0x10, 0o7, inf, nan, 1_000]
[[list]]
v = 13
[[list]]
v = 14.0
  [list.inner]
  w = 15
[ "q]" . r ]
z=+16
'''.replace("SSS", 3 * "'")


def leaves(value: object, path: tuple[str | int, ...] = ()) -> dict[tuple[str | int, ...], float]:
    """All numbers of data, by their paths."""
    if isinstance(value, dict):
        return {p: v for key, inner in value.items() for p, v in leaves(inner, (*path, key)).items()}
    if isinstance(value, list):
        return {p: v for k, inner in enumerate(value) for p, v in leaves(inner, (*path, k)).items()}
    return {path: value} if isinstance(value, int | float) and not isinstance(value, bool) else {}


def check_numbers(text: str, left_out: int = 0) -> None:
    """All numbers are found, and each can be replaced by itself."""
    data = tomllib.loads(text)
    known, found = leaves(data), numbers_of(text)
    assert {one.path: one.value for one in found}.items() <= known.items()
    assert len(found) == len(known) - left_out
    for one in found:
        after = leaves(tomllib.loads(replaced(text, one, 0.0625)))
        assert after.pop(one.path) == 0.0625
        known_else = {path: value for path, value in known.items() if path != one.path}
        assert str(after) == str(known_else)  # nan is like itself in text


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_numbers_of_every_example_are_found_and_can_be_replaced(path: Path) -> None:
    check_numbers(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", TEMPLATES)
def test_numbers_of_templates(name: str) -> None:
    check_numbers(template(name))


def test_strings_comments_dates_and_lists_of_tables() -> None:
    check_numbers(HARD, left_out=4)


def test_a_text_of_any_characters_hides_no_number() -> None:
    check_numbers(
        'title = "\ue0000\ue000 \ue000\ue0001\ue000\ue000"\n"\ue0001" = 5  # \ue000\nx = [1e4, +2, 1_000]\r\n'
    )


VALUES = st.recursive(
    st.one_of(
        st.integers(-(10**6), 10**6),
        st.floats(allow_nan=False, allow_infinity=False),
        st.booleans(),
        st.text(st.characters(exclude_categories=("Cs",)), max_size=12),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text("ab c.\"'#]é", max_size=4), inner, max_size=3)
    ),
    max_leaves=12,
)


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(st.sampled_from(["mesh", "loads", "title", "contact", "x y"]), VALUES, max_size=4))
def test_numbers_of_random_tables(data: dict[str, object]) -> None:
    check_numbers(text_of(data))


def test_sliders_stay_in_the_ranges_of_their_laws_and_name_their_parameters() -> None:
    text = template("softening")
    sliders = {one.key: one for one in sliders_of(tomllib.loads(text), numbers_of(text), Units())}
    limit = sliders["contact.bottom.normal.limit"]
    assert 0.0 < limit.low < limit.value < limit.high
    assert "penetration" in limit.meaning
    cells = sliders["mesh.cells.0"]
    assert cells.whole
    assert cells.low == 1
    assert all(one.low <= one.value <= one.high for one in sliders.values())
    assert not any(one.key.startswith("solver") for one in sliders.values())


def test_sliders_of_glue_are_those_of_its_parameters() -> None:
    glue = 'law = "mixed-mode", strength = 30.0, energy = 0.5, stiffness = 1e4, ratio = 1.5'
    text = f"[contact.bottom]\nnormal = {{ {glue} }}\n"
    sliders = sliders_of(tomllib.loads(text), numbers_of(text), Units())
    assert sliders[0].meaning == "largest traction in opening (force/area)"
    assert all(one.low >= 0.0 for one in sliders)


@pytest.mark.parametrize(
    ("message", "key"),
    [
        ("[contact.bottom] normal.q_max: is -1; it must be at least 0", "contact.bottom.normal.q_max"),
        ("problem: [mesh] cells: is 0.5", "mesh.cells.0"),
        ("[loads] body: must be a list", "loads.body.0"),
        ("the body is free to move", None),
    ],
)
def test_messages_are_shown_beside_the_key_that_they_name(message: str, key: str | None) -> None:
    keys = ["mesh.cells.0", "mesh.cells.1", "loads.body.0", "contact.bottom.normal.q_max"]
    assert key_of_message(message, keys) == key
