"""XML of others, read without what could make it grow: no DTD, hence no entities, and bounds on what it holds."""

from __future__ import annotations

from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from hemivar.basics.disk import shown
from hemivar.errors import ProblemError

__all__ = ["parse_xml"]

#: Elements of a file, and how deep they lie in one another.
_MOST_ELEMENTS, _DEEPEST = 200_000, 32


def parse_xml(data: bytes) -> Element:
    """The root of the elements of a text."""
    tree, depth, count = TreeBuilder(), 0, 0

    def refuse_doctype(*_: object) -> None:
        raise ProblemError("it declares a document type (DOCTYPE), which is not read; remove that line")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > _DEEPEST or count > _MOST_ELEMENTS:
            raise ProblemError(
                f"it contains more than {_MOST_ELEMENTS} elements, or more than {_DEEPEST} in one another; write "
                f"it again"
            )
        tree.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        tree.end(tag)

    parser = expat.ParserCreate()
    parser.buffer_text, parser.buffer_size = True, 1 << 20
    parser.StartDoctypeDeclHandler = refuse_doctype
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = begin, end, tree.data
    try:
        parser.Parse(data, True)
    except ProblemError:
        raise
    except (expat.ExpatError, LookupError, ValueError) as error:  # the latter for encodings that are not known
        raise ProblemError(f"it is not readable XML ({shown(error)[:100]}); write it again") from None
    return tree.close()
