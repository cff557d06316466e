"""What no mesh may be made of, and the place that the message names."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, box, rectangle

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
TETRAHEDRON = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.2, 0.9]]


@pytest.mark.parametrize(
    ("points", "cells", "words"),
    [
        (SQUARE[:3], [[0, 1, 2], [0, 1, 2]], r"cells 0 and 1 lie on the same side of the facet.* at \("),
        (SQUARE, [[0, 1, 2], [0, 1, 3]], r"cells 0 and 1 lie on the same side .*\[0, 1\] at \(0\.5, 0\)"),
        (TETRAHEDRON, [[0, 1, 2, 3], [0, 1, 2, 4]], r"cells 0 and 1 lie on the same side .* at \(0\.33"),
        (TETRAHEDRON[:4], [[0, 1, 2, 3], [1, 2, 0, 3]], "cells 0 and 1 lie on the same side"),
        (
            SQUARE,
            [[0, 1, 2], [0, 2, 3], [0, 1, 3], [0, 1, 2]],
            r"at \(0\.5, 0\.5\) belongs to 3 cells \(0, 1, 3\)|3 cells",
        ),
        (SQUARE, [[0, 1, 1], [1, 2, 3]], r"degenerate .*cells 0, the first at \(0\.666667, 0\)"),
        (SQUARE, [[0, 1, 2], [0, 3, 2]], r"inverted: cells 1, the first at \(0\.333333, 0\.666667\)"),
        ([*SQUARE, [3.0, 4.0]], [[0, 1, 2], [0, 2, 3]], r"nodes 4, the first at \(3, 4\)"),
        (np.array(SQUARE) + 1e17, [[0, 1, 2], [0, 2, 3]], "degenerate|spoils the shape"),
        (np.array(SQUARE) + 1e12, [[0, 1, 2], [0, 2, 3]], r"rounded to 0\.00022, which spoils"),
        (np.array(SQUARE) * 1e100, [[0, 1, 2], [0, 2, 3]], "another unit of length"),
        (np.array(SQUARE) * 1e-100, [[0, 1, 2], [0, 2, 3]], "another unit of length"),
        (np.array(SQUARE) * (1 + 2j), [[0, 1, 2], [0, 2, 3]], "points is complex"),
        (SQUARE, np.array([[0, 1, 2], [0, 2, 3]]) * (1 + 0j), "whole numbers"),
        (SQUARE, np.array([[0, 1, 2**64 - 1]], dtype=np.uint64), "refers to number 18446744073709551615"),
    ],
)
def test_bad_meshes_are_refused_with_the_place(points: object, cells: object, words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ProblemError, match=words) as caught:
            Mesh(points, cells)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_meshes_of_any_shape_pass_these_checks() -> None:
    """Random cells, turned, moved and cut: whatever is conforming is taken."""
    rng = np.random.default_rng(3)
    for mesh in (rectangle(cells=(5, 3), pattern="cross"), box(cells=(3, 2, 2))):
        d = mesh.dim
        for _ in range(10):
            turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
            turn[0] *= np.linalg.det(turn)
            order = rng.permutation(mesh.number_of_nodes)
            back = np.argsort(order)
            moved = (mesh.points @ turn.T)[order] * 10.0 ** rng.uniform(-3, 3) + rng.normal(size=d)
            cells = back[mesh.cells][rng.permutation(mesh.number_of_cells)]
            names = {name: back[facets] for name, facets in mesh.boundaries.items()}
            again = Mesh(moved, cells, names)
            assert {name: len(facets) for name, facets in again.boundaries.items()} == {
                name: len(facets) for name, facets in mesh.boundaries.items()
            }


def test_a_cut_of_one_part_has_names_and_parts_stay_apart() -> None:
    """A square with a slit from its left side to its middle, and two squares side by side."""
    square = rectangle(cells=4).with_interfaces({"slit": lambda x: (abs(x[:, 1] - 0.5) < 1e-9) & (x[:, 0] < 0.5)})
    slit = square.opened("slit")
    faces = {name: slit.boundaries[name] for name in ("slit:1", "slit:2")}
    right = {"right": slit.boundaries["right"]}
    with pytest.raises(
        ProblemError, match=r"the body is cut at \(0\.(125|375), 0\.5\): 4 facets.*join coincident nodes"
    ):
        Mesh(slit.points, slit.cells, right)
    with pytest.raises(ProblemError, match="join coincident nodes"):
        Mesh(slit.points, slit.cells).with_boundaries({"left": lambda x: x[:, 0] < 1e-9})
    assert set(Mesh(slit.points, slit.cells, right | faces).boundaries) == {"right", "slit:1", "slit:2"}
    with pytest.raises(ProblemError, match="2 facets coincide"):
        Mesh(slit.points, slit.cells, right | {"one": faces["slit:1"]})
    left, other = rectangle(cells=2), rectangle(cells=2, origin=(1.0, 0.0))
    points, cells = np.vstack([left.points, other.points]), np.vstack([left.cells, other.cells + left.number_of_nodes])
    assert Mesh(points, cells, {"left": left.boundaries["left"]}).parts.count == 2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rectangle(origin=(1e17, 0.0)), "rounded to 22, which spoils the shape of cells of size 0.125"),
        (lambda: box(origin=(0.0, -1e17, 0.0)), "rounded to 22, which spoils"),
        (lambda: rectangle().moved(np.eye(2), (0.0, 1e17)), "rounded to 22, which spoils"),
        (lambda: rectangle(size=(1e308, 1e308)), "unit of length"),
        (lambda: rectangle(size=(1e308, 1.0), origin=(1e308, 0.0)), "unit of length"),
        (lambda: rectangle(size=(1e-200, 1.0)), "unit of length"),
        (lambda: rectangle(size=(1e-14, 1.0)), "cells without volume"),
        (lambda: box(size=(1.0, 1e-9, 1e-5)), "cells without volume"),
        (lambda: rectangle().scaled(1e308), "unit of length"),
        (lambda: box().scaled(1e-308), "unit of length"),
        (lambda: rectangle().moved(1e308 * np.array([[1.0, -1.0], [1.0, 1.0]])), "unit of length"),
        (lambda: rectangle(size=(1 + 1j, 1)), "size is complex"),
        (lambda: rectangle(cells=2 + 0j), "whole numbers"),
        (lambda: rectangle(cells="3"), "whole numbers"),
        (lambda: rectangle(cells=float("nan")), "whole numbers"),
        (lambda: rectangle(cells=float("inf")), "whole numbers"),
        (lambda: rectangle(cells=True), "whole numbers"),
        (lambda: rectangle(origin=(float("nan"), 0.0)), "origin.*finite"),
        (lambda: rectangle(origin=(0.0, 0.0, 0.0)), "two coordinates"),
        (lambda: box(origin=(0.0, 0.0)), "three coordinates"),
        (lambda: rectangle().refined(-1), "whole number"),
        (lambda: rectangle().refined(0.5), "whole number"),
        (lambda: rectangle().moved(np.eye(2) * (1 + 1j)), "matrix is complex"),
        (lambda: rectangle().moved(np.eye(2), (1.0, float("nan"))), "shift.*finite"),
        (lambda: rectangle().moved(np.eye(2), (1.0, 2.0, 3.0)), "shift has shape"),
        (lambda: rectangle().scaled(2j), "factor"),
        (lambda: rectangle().marked({"": "x < 0.5"}), "a name of boundaries is ''; give one that conditions"),
        (lambda: rectangle().with_interfaces({" ": lambda x: x[:, 0] == 0.5}), "a name of interfaces is ' '"),
        (lambda: Mesh(SQUARE, [[0, 1, 2], [0, 2, 3]], regions={"": [0]}), "a name of regions is ''"),
    ],
)
def test_bad_arguments_are_refused_without_warnings(make: Callable[[], object], words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ProblemError, match=words) as caught:
            make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [1e-30, 1e-9, 1e6, 1e30])
def test_any_common_unit_is_fine(size: float) -> None:
    mesh = rectangle((size, size), 4).moved(np.eye(2), (size, -size)).scaled(2.0).refined()
    Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))
