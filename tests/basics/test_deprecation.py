"""Names that go warn, say what to write instead, and stay for two minor versions."""

import warnings

import pytest

from hemivar.basics.deprecation import deprecated


@deprecated("0.3", "0.5", "cubed")
def cube(x: float) -> float:
    """The third power."""
    return x**3


def test_it_warns_where_it_is_called_and_does_its_work() -> None:
    with pytest.warns(
        DeprecationWarning, match=r"cube is deprecated since hemivar 0\.3 and goes in 0\.5; use cubed"
    ) as said:
        assert cube(2.0) == 8.0
    assert said[0].filename == __file__
    assert (cube.__doc__ or "").startswith("The third power.")
    assert ".. deprecated:: 0.3" in (cube.__doc__ or "")
    assert cube.__name__ == "cube"


def test_making_it_warns_of_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        deprecated("1.0", "2.0", "nothing")(len)


@pytest.mark.parametrize(("since", "removed"), [("0.3", "0.4"), ("0.3", "0.3"), ("1.2", "1.3.9"), ("2.0", "1.9")])
def test_nothing_goes_too_soon(since: str, removed: str) -> None:
    with pytest.raises(ValueError, match="too soon"):
        deprecated(since, removed, "another")
