"""A keyword that there is not is answered by one sentence."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from dataclasses import dataclass

import pytest

import hemivar as hv
from hemivar.basics.known_keywords import known_keywords, showing_options
from tests.problems import square

PROBLEM = square(n=2)
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "solve": (lambda: hv.solve(PROBLEM, tol=1e-8), r"solve has no argument 'tol'; did you mean 'rtol'\?"),
    "method": (lambda: hv.solve(PROBLEM, methd="newton"), r"'methd'; did you mean 'method'\?"),
    "far off": (lambda: hv.solve(PROBLEM, xyz=1), r"solve has no argument 'xyz' \(arguments: problem, method"),
    "march": (lambda: hv.march(PROBLEM, 1.0, steps=0.1), r"March has no argument 'steps'; did you mean 'step'\?"),
    "rectangle": (lambda: hv.rectangle(cell=4), r"rectangle has no argument 'cell'; did you mean 'cells'\?"),
    "ContactProblem": (
        lambda: hv.ContactProblem(mesh=PROBLEM.mesh, material=PROBLEM.material, support={}),
        r"ContactProblem has no argument 'support'; did you mean 'supports'\?",
    ),
    "Contact": (lambda: hv.Contact(hv.Signorini(), frictoin=None), r"Contact .*did you mean 'friction'\?"),
    "Controls": (lambda: hv.Controls(tol=1e-8), r"Controls has no argument 'tol'; did you mean 'rtol'\?"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_unknown_keyword_is_named_with_its_neighbour(name: str) -> None:
    make, sentence = WRONG[name]
    with pytest.raises(hv.errors.ProblemError, match=sentence) as error:
        make()
    assert isinstance(error.value, TypeError)


def test_signatures_and_pickles_stay() -> None:
    assert list(inspect.signature(hv.solve).parameters)[:3] == ["problem", "method", "controls"]
    assert next(iter(inspect.signature(hv.ContactProblem).parameters)) == "mesh"
    assert pickle.loads(pickle.dumps(hv.solve)) is hv.solve
    assert pickle.loads(pickle.dumps(hv.Controls(1e-6))) == hv.Controls(1e-6)
    assert hv.solve.__doc__
    with pytest.raises(TypeError, match="missing"):
        hv.solve()


@dataclass(frozen=True)
class Cut:
    """How to cut.

    Parameters
    ----------
    depth : float
        How deep,
        in metres.
    angle, speed : float
        Both.
    tool : str

    Notes
    -----
    None.
    """

    depth: float = 1.0
    tool: str = "saw"


def test_what_a_dataclass_says_of_its_fields_stands_in_the_help_of_a_function_that_takes_them() -> None:
    @known_keywords
    @showing_options(Cut)
    def cut(body: str, depth: float = Cut.depth, **options: object) -> Cut:
        """Cut.

        Parameters
        ----------
        body : str
        depth : float
            Own words.
        **options

        Returns
        -------
        Cut
        """
        return Cut(depth, **options)  # type: ignore[arg-type]

    text = inspect.getdoc(cut) or ""
    assert "Own words.\ntool : str\n\nReturns" in text
    assert "in metres" not in text
    assert list(inspect.signature(cut).parameters) == ["body", "depth", "tool"]
    assert cut("a", tool="axe") == Cut(1.0, "axe")
    with pytest.raises(hv.errors.ProblemError, match="has no argument 'tol'; did you mean 'tool'"):
        cut("a", tol="axe")
