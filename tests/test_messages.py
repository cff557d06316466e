"""The language of messages: short sentences, and none of the words that only this project used."""

from __future__ import annotations

import re

import pytest

from tests.messages import Message, messages, written

#: Words of a sentence.
_MOST_WORDS = 30
#: Home-made words and phrases, and what stands in their place.
HOME_MADE = {
    r"\banew\b": "again",
    r"\bmend\b": "correct",
    r"\btold\b": "reported, stopped",
    r"\bunsaid\b": "not expressible",
    r"\bbooked\b": "recorded, reported",
    r"\bput in\b": "external work",
    r"\bgap of the ledger\b": "balance error",
    r"\bblows?\b": "impulse",
    r"\bat hand\b": "current",
    r"\bno pair\b": "must be a pair (low, high)",
    r"\bnobody\b": "no one",
    r"\bso many\b": "a number",
    r"\bas far as\b": "where, if",
    r"\bis no checkpoint\b": "is not a checkpoint",
    r"\bgoes on from there\b": "continue",
    r"\bstands in it\b": "occurs",
    r", for (it|they|the) ": "because",
    r"(?<!there) is no (?!longer\b)": "is not a",
    r"\bare no (?!longer\b)(?<!there are no )": "are not",
    r"\bin space\b": "in 3D",
    r"\bfor ever\b": "without bound",
    r"\b(a|the) march\b": "run, time integration",
    r"\brules? of integration\b": "quadrature",
    r"\blets go\b": "debonds",
    r"\bgave out\b": "ran out",
    r"\bfor lack of\b": "because",
    r"\bstatement\b": "problem",
    r"\btake such\b": "use a",
}
#: Words by which an error says what to do.
_WHAT_TO_DO = re.compile(
    r"\b(give|take|write|name|make|must|leave|remove|save|choose|add|check|use|pass|lower|raise|install|correct|state|put"
    r"|join|fix|keep|refine|start|solve|go|exchange|let|begin|subtract|list|simplify|widen|look|see|measure|move|turn"
    r"|rename|resolve|separate|swap|divide|fill|narrow|define|draw|run|map|follow|discretize|interpolate|return|overwrite"
    r"|change|create|restrict|split|renumber|animate|wait|condense|set|multiply|sweep|search|wants|needs?|it can be|try"
    r"|resume|end|stop|compare|build|mesh|wrap|has its own|continue|evaluate|frees?|free some|send|say|shorten)\b"
    r"|known|\{\}$|allowed|lists the|parameters: |written as|at \{\} points it has|belongs in|not looked for"
)
#: Errors that say why something is not what it should be: another one, which says what to do, is put around them.
_REASONS = (
    "basics/packed", "ranks/checkpoint", "files/stored_solution", "files/sweep_point",
    "files/time_table", "laws/coupled/plane_potential",
    "files/body_table", "files/contact_table.py", "files/problem_file", "files/schema", "files/quantities",
    "bounds/compiled_", "laws/compiled_law", "kernels/library", "kernels/mesh_sums", "linear/compiled",
    "linear/factorisation", "systems/compiled_rounds", "basics/codec", "certificates/__init__", "files/toml",
    "fem/energy_integral",
)  # fmt: skip
Found = list[Message]


@pytest.fixture(scope="module")
def found() -> Found:
    return messages()


def test_the_messages_are_all_collected(found: Found) -> None:
    text = written(found)
    kinds = {one.kind for one in found}
    assert {"error", "warning", "remedy", "note", "line", "help"} - kinds <= {"warning"}
    assert len(found) > 1000
    for known in (
        "give the file named by --checkpoint",  # of the engine for ranks
        "Bound the distance to the exact solution.",  # help
        "refine the mesh, as adaptive refinement does where it is needed",  # a remedy
        "of the largest entry",  # what a result claims
    ):
        assert known in text


def test_sentences_are_short(found: Found) -> None:
    def long(one: Message) -> list[str]:
        return [sentence for sentence in one.sentences if len(sentence.split()) > _MOST_WORDS]

    told = [f"{one.place}: {sentence}" for one in found for sentence in long(one)]
    assert not told, "\n".join(["shorten these, or make two sentences of each:", *told])


def test_messages_use_words_of_the_field(found: Found) -> None:
    told = [
        f"{one.place}: {one.text}; write '{other}' or the like"
        for one in found
        for word, other in HOME_MADE.items()
        if re.search(word, one.text)
    ]
    assert not told, "\n".join(told)


def test_errors_say_what_to_do(found: Found) -> None:
    """In the last of their parts, or as what must be in the place of what is."""
    errors = [one for one in found if one.kind == "error" and not one.place.startswith(_REASONS)]
    assert len(errors) > 1000
    told = [f"{one.place}: {one.text}" for one in errors if not _WHAT_TO_DO.search(one.text.split(";")[-1])]
    assert not told, "\n".join(["say what to do:", *told])
