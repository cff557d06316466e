"""Pictures of three-dimensional bodies by PyVista, where it is installed (``pip install "hemivar[3d]"``)."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hemivar.basics.disk import make_folder, whole_file
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.certificates import Certificate
from hemivar.errors import ProblemError
from hemivar.report.body_colour import BodyColour
from hemivar.report.certificate_line import certificate_line, title_of, write_foot
from hemivar.report.deformed import DeformedBody
from hemivar.report.drawn_body import mark_size
from hemivar.report.picture import new_figure
from hemivar.report.solid_body import legend_of_solid, sharp_edges, viewing_direction
from hemivar.report.style import GREY, MARKERS, drawing, with_unit
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable

__all__ = ["check_rendering", "render_solution"]

#: Height of the picture in inches, by which letters have their size.
_HEIGHT = 5.0
#: Where the body is drawn: left, bottom, width, height.
_PLACE = (0.02, 0.12, 0.82, 0.8)
#: Rounds in which the camera finds the middle, and the part of the picture that is filled.
_ROUNDS, _FILLED = 3, 0.96


def render_solution(
    solution: Solution,
    path: str | Path,
    *,
    scale: float | Literal["auto"] = 1.0,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    size: tuple[int, int] = (1600, 1200),
    colour: BodyColour | Literal["stress", "displacement", "none"] | None = None,
    certificate: Certificate | None = None,
) -> Path:
    """Write a picture (.png) of the deformed body, shaded, with its contact points by state.

    As :func:`plot_solution`, which needs matplotlib only, but drawn by PyVista off screen, which is quicker for
    surfaces of many facets.

    Parameters
    ----------
    solution : Solution
        Of a three-dimensional problem with a mesh.
    path : str or Path
    scale : float or "auto"
        Factor of the displacement, as in :func:`plot_solution`.
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.
    size : (int, int)
        Width and height in pixels, 16 to 16384.
    colour : BodyColour, optional
        What colours the body, as in :func:`plot_solution`.
    certificate : Certificate, optional
        What is known about the solution, for the line below; without it the line has the residual only.

    Raises
    ------
    ProblemError
        PyVista is not installed, the problem has no three-dimensional mesh, the suffix is not .png, the size is out of
        range, or there are no such colours.
    FileError
        The file or its folder cannot be made.
    """
    field, path = solution.problem.field, Path(path)
    if path.suffix.lower() != ".png":
        raise ProblemError(f"'{path}': rendered pictures are written as .png, not '{path.suffix}'")
    if not all(16 <= pixels <= 16384 for pixels in size):
        raise ProblemError(f"size = {size}; give width and height from 16 to 16384 pixels")
    check_rendering(2 if field is None else field.mesh.dim)
    body = DeformedBody.of(solution, scale)
    coloured = body.colour(colour)
    make_folder(path.parent)
    pixels = size[1] / _HEIGHT  # in an inch
    left, bottom, width, height = (round(part * whole) for part, whole in zip(_PLACE, 2 * size, strict=True))
    scene = _Scene(body, coloured, (max(width, 16), max(height, 16)), unit)
    with drawing():
        fig = new_figure((size[0] / pixels, _HEIGHT))
        fig.set_dpi(pixels)
        place = (left / size[0], bottom / size[1], width / size[0], height / size[1])
        ax = fig.add_axes(place)
        ax.imshow(scene.picture, interpolation="nearest", aspect="auto")
        ax.set_axis_off()
        for kind, here, _ in body.states() if body.problem.contact_points else ():
            ax.plot(
                *scene.marks[here & scene.faced].T, ls="", ms=mark_size(len(here)), mew=0.4, clip_on=False,
                scalex=False, scaley=False, **MARKERS[kind],
            )  # fmt: skip
        if coloured is not BodyColour.NONE:
            bar = fig.colorbar(scene.colours(), cax=fig.add_axes((0.86, 0.24, 0.018, 0.5)))
            bar.set_label(coloured.label(unit, stress_unit))
        if heading := title_of(solution, title):
            fig.suptitle(heading, fontsize=10, y=0.98)
        legend_of_solid(fig, body)
        write_foot(fig, certificate_line(solution, certificate))
        with whole_file(path) as temporary:
            fig.savefig(temporary, dpi=pixels)
    return path


class _Scene:
    """The body, shaded, seen from where its contact boundary is seen, in the middle of its picture."""

    def __init__(self, body: DeformedBody, colour: BodyColour, size: tuple[int, int], unit: str) -> None:
        self.body, self.size, self.unit = body, size, unit
        self.values = None if colour is BodyColour.NONE else body.values(colour)
        self.towards = viewing_direction(body.problem)
        self.length = float(np.linalg.norm(np.ptp(body.vertices, axis=0)))
        self.picture, projection = self._centred()
        contact = body.problem.contact
        # contact points (columns, rows), and which of them are on a side that is turned to the viewer
        self.marks, self.faced = np.zeros((0, 2)), np.zeros(0, dtype=bool)
        if contact.count:
            assert contact.frames is not None
            flat = np.column_stack([body.contact_places, np.ones(contact.count)]) @ projection.T
            across = 0.5 * (1.0 + flat[:, :2] / flat[:, 3:] * (1.0, -1.0))
            self.marks, self.faced = across * size - 0.5, contact.frames[:, 0] @ self.towards > 0.0

    def colours(self) -> ScalarMappable:
        """The scale of the colours."""
        with IMPORTS:
            from matplotlib.cm import ScalarMappable
            from matplotlib.colors import Normalize

        assert self.values is not None
        return ScalarMappable(Normalize(float(self.values.min()), float(self.values.max())), "cividis")

    def _centred(self) -> tuple[AnyArray, Array]:
        """The picture (rows, columns, 3), in the middle of which the body stands and fills it, and its projection."""
        with IMPORTS:
            import pyvista

        with pyvista.vtk_verbosity("off"):
            plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(self.size), lighting="none")
            try:
                self._draw(plotter)
                plotter.show(auto_close=False, interactive=False)
                moved, camera = self.body.vertices, plotter.camera
                middle = 0.5 * (moved.min(axis=0) + moved.max(axis=0))
                plotter.camera_position = [middle + 2.4 * self.length * self.towards, middle, (0.0, 0.0, 1.0)]
                for _ in range(_ROUNDS):  # axes keep the size of their letters, so that one round is not exact
                    plotter.render()
                    low, high = _extent(plotter.image)
                    zoom = _FILLED * 2.0 / max(float((high - low).max()), 1e-3)
                    centre = np.array(camera.GetWindowCenter()) + 0.5 * (low + high)
                    camera.SetWindowCenter(*(zoom * centre))
                    camera.zoom(zoom)
                plotter.render()
                matrix = camera.GetCompositeProjectionTransformMatrix(self.size[0] / self.size[1], -1.0, 1.0)
                projection = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
                return plotter.image, projection
            finally:
                plotter.close()

    def _draw(self, plotter: Any) -> None:
        with IMPORTS:
            import pyvista

        mesh, moved = self.body.mesh, self.body.vertices
        plotter.add_light(pyvista.Light(light_type="headlight"))
        plotter.set_background("white")
        surface = pyvista.PolyData(moved, _with_counts(mesh.boundary_facets))
        shading = {"ambient": 0.6, "diffuse": 0.4}
        if self.values is None:
            plotter.add_mesh(surface, color="#d9e6f2", **shading)
        else:
            surface.point_data["colour"] = self.values
            plotter.add_mesh(surface, scalars="colour", cmap="cividis", show_scalar_bar=False, **shading)
        for points, width, ink in ((mesh.points, 1.0, GREY), (moved, 2.5, "black")):
            lines = pyvista.PolyData(points, lines=_with_counts(sharp_edges(mesh)))
            plotter.add_mesh(lines, line_width=width, color=ink)
        small = max(8, self.size[1] // 60)
        plotter.show_bounds(
            mesh=surface, location="outer", ticks="both", font_size=small, n_xlabels=3, n_ylabels=3, n_zlabels=3,
            use_3d_text=False, xtitle=with_unit("x", self.unit), ytitle=with_unit("y", self.unit),
            ztitle=with_unit("z", self.unit), color="black",
        )  # fmt: skip


def _extent(picture: AnyArray) -> tuple[Array, Array]:
    """Lower left and upper right corner of what is not white, in a picture from (-1, -1) to (1, 1)."""
    rows, columns = np.nonzero((picture[..., :3] < 250).any(axis=2))
    if not len(rows):
        return -np.ones(2), np.ones(2)
    high, wide = picture.shape[:2]
    low = np.array([columns.min() / wide, 1.0 - (rows.max() + 1) / high])
    return 2.0 * low - 1.0, 2.0 * np.array([(columns.max() + 1) / wide, 1.0 - rows.min() / high]) - 1.0


def check_rendering(dim: int) -> None:
    """Raise a ProblemError if PyVista is missing, or a body of this dimension is not drawn by it."""
    if dim != 3:
        raise ProblemError(
            "PyVista draws bodies in 3D, with a mesh; draw others by matplotlib: plot_solution, or --plot"
        )
    if importlib.util.find_spec("pyvista") is None:
        raise ProblemError(
            "pyvista is not installed; pip install 'hemivar[3d]', or draw by matplotlib: plot_solution, or --plot"
        )


def _with_counts(connectivity: IntArray) -> IntArray:
    """Rows of node numbers as VTK wants them: each preceded by its length."""
    count = np.full((len(connectivity), 1), connectivity.shape[1])
    return np.hstack([count, connectivity]).ravel()
