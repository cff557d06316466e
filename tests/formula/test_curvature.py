"""Derivatives of formulas of several variables, in symbols, and bounds of second ones on boxes."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.types import Array, BoolArray
from hemivar.formula.curvature import BoxVariable, enclosed_range, second_derivatives
from hemivar.formula.graph import Graph
from hemivar.formula.reader import Reader

#: Formulas of a and b with their second derivatives aa, ab, bb by hand.
BY_HAND = {
    "3*a^2*b + b": ("6*b", "6*a", "0*a"),
    "exp(a*b)": ("b^2*exp(a*b)", "(1 + a*b)*exp(a*b)", "a^2*exp(a*b)"),
    "sin(a) + cos(2*b)": ("-sin(a)", "0*a", "-4*cos(2*b)"),
    "a/(1 + b^2)": ("0*a", "-2*b/(1 + b^2)^2", "a*(6*b^2 - 2)/(1 + b^2)^3"),
    "sqrt(1 + a^2 + b^2)": (
        "(1 + b^2)/(1 + a^2 + b^2)^1.5", "-a*b/(1 + a^2 + b^2)^1.5", "(1 + a^2)/(1 + a^2 + b^2)^1.5",
    ),
    "max(a - b, 0)^2 + abs(b - 10)": ("max(a - b, 0)/max(a - b, 1e-30)*2", "-2*max(a - b, 0)/max(a - b, 1e-30)",
                                      "2*max(a - b, 0)/max(a - b, 1e-30)"),
    "a^b": ("b*(b - 1)*a^(b - 2)", "a^(b - 1)*(1 + b*log(a))", "log(a)^2*a^b"),
}  # fmt: skip


def graph_of(text: str) -> tuple[Graph, int]:
    return Reader(text, "", ("a", "b")).graph()


def value(graph: Graph, node: int, a: Array, b: Array) -> Array:
    return np.broadcast_to(np.asarray(graph.value(node, {"a": a, "b": b}), dtype=float), a.shape)


@pytest.mark.parametrize("text", BY_HAND)
def test_second_derivatives_in_symbols_are_those_by_hand(text: str) -> None:
    graph, node = graph_of(text)
    a, b = np.random.default_rng(0).uniform(0.2, 2.0, (2, 50))
    for (first, second), hand in zip((("a", "a"), ("a", "b"), ("b", "b")), BY_HAND[text], strict=True):
        found = graph.derivative(graph.derivative(node, first), second)
        swapped = graph.derivative(graph.derivative(node, second), first)
        expected = value(*graph_of(hand), a, b)
        np.testing.assert_allclose(value(graph, found, a, b), expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(value(graph, swapped, a, b), expected, rtol=1e-12, atol=1e-12)


def on_boxes(text: str, low: Array, high: Array) -> tuple[Array, Array]:
    graph, node = graph_of(text)
    none, one = np.zeros(len(low)), np.ones(len(low))
    a = BoxVariable((low[:, 0], high[:, 0]), (np.stack([one, none]),) * 2)
    b = BoxVariable((low[:, 1], high[:, 1]), (np.stack([none, one]),) * 2)
    return second_derivatives(graph, node, {"a": a, "b": b})


@pytest.mark.parametrize("text", [text for text in BY_HAND if "max" not in text])
def test_bounds_on_boxes_hold_all_values_and_close_in(text: str) -> None:
    random = np.random.default_rng(1)
    low = random.uniform(0.2, 1.5, (20, 2))
    for width in (0.5, 1e-6):
        below, above = on_boxes(text, low, low + width)
        inside = low[:, None] + width * random.uniform(size=(20, 100, 2))
        for row, hand in enumerate(BY_HAND[text]):
            values = value(*graph_of(hand), inside[..., 0], inside[..., 1])
            slack = 1e-13 * (1.0 + np.abs(values))
            assert (values >= below[row][:, None] - slack).all()
            assert (values <= above[row][:, None] + slack).all()
            assert width > 0.1 or (above[row] - below[row] < 1e-3).all()


def test_a_kink_has_no_bound() -> None:
    below, above = on_boxes("abs(a - b)", np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([[1.0, 1.0], [1.0, 3.0]]))
    assert np.isneginf(below[0, 0])
    assert np.isposinf(above[0, 0])
    assert below[0, 1] == above[0, 1] == 0.0


def in_disc(at: Array) -> BoolArray:
    return np.asarray(np.hypot(at[:, 0], at[:, 1]) <= 1.0)


def test_the_range_over_a_disc_is_enclosed() -> None:
    """Of x - 2 y over the unit disc it is sqrt(5) to both sides, and sure bounds are a little wider."""

    def bounds(low: Array, high: Array) -> tuple[Array, Array]:
        return low[:, 0] - 2.0 * high[:, 1], high[:, 0] - 2.0 * low[:, 1]

    found = enclosed_range(bounds, np.array([-1.0, -1.0]), np.array([1.0, 1.0]), in_disc)
    root = np.sqrt(5.0)
    assert -1.01 * root < found.lower <= -root
    assert root <= found.upper < 1.01 * root
    assert found.least == pytest.approx(-root, rel=0.01)
    assert found.least_at == pytest.approx((-1.0 / root, 2.0 / root), abs=0.1)


def test_where_nothing_is_known_the_range_is_infinite() -> None:
    def bounds(low: Array, high: Array) -> tuple[Array, Array]:
        wide = (low[:, 0] < 0.3) & (high[:, 0] > 0.3)
        return np.where(wide, -np.inf, low[:, 0]), np.where(wide, np.inf, high[:, 0])

    found = enclosed_range(bounds, np.array([-1.0, -1.0]), np.array([1.0, 1.0]), in_disc)
    assert np.isneginf(found.lower)
    assert found.least == pytest.approx(-1.0, abs=0.02)
