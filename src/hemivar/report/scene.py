"""Pictures of three-dimensional bodies by PyVista, where it is installed (``pip install "hemivar[3d]"``)."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hemivar.basics.disk import make_folder, whole_file
from hemivar.basics.types import IntArray
from hemivar.errors import ProblemError
from hemivar.report.deformed import DeformedBody
from hemivar.report.solid_body import sharp_edges, viewing_direction
from hemivar.report.style import STATE_COLOURS, with_unit
from hemivar.solvers import ContactState, Solution

__all__ = ["check_rendering", "render_solution"]


def render_solution(
    solution: Solution,
    path: str | Path,
    *,
    scale: float | Literal["auto"] = 1.0,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    size: tuple[int, int] = (1600, 1200),
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

    Raises
    ------
    ProblemError
        PyVista is not installed, the problem has no three-dimensional mesh, the suffix is not .png, or the size is
        out of range.
    FileError
        The file or its folder cannot be made.
    """
    field, path = solution.problem.field, Path(path)
    if path.suffix.lower() != ".png":
        raise ProblemError(f"'{path}': rendered pictures are written as .png, not '{path.suffix}'")
    if not all(16 <= pixels <= 16384 for pixels in size):
        raise ProblemError(f"size = {size}; give width and height from 16 to 16384 pixels")
    check_rendering(2 if field is None else field.mesh.dim)
    make_folder(path.parent)
    import pyvista

    body = DeformedBody.of(solution, scale)
    mesh, moved = body.mesh, body.vertices
    values, name = body.surface
    length = float(np.linalg.norm(np.ptp(moved, axis=0)))
    font = max(12, size[1] // 48)
    small = int(0.7 * font)
    with pyvista.vtk_verbosity("off"):
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
        plotter.add_light(pyvista.Light(light_type="headlight"))
        plotter.set_background("white")
        surface = pyvista.PolyData(moved, _with_counts(mesh.boundary_facets))
        label = with_unit(name, unit if name == "displacement" else stress_unit)
        surface.point_data[label] = values
        bar = {
            "title_font_size": font, "label_font_size": font, "n_labels": 5, "fmt": "%.3g", "vertical": True,
            "position_x": 0.86, "position_y": 0.2, "height": 0.5, "width": 0.05, "color": "black",
        }  # fmt: skip
        shading = {"ambient": 0.6, "diffuse": 0.4}
        plotter.add_mesh(surface, scalars=label, cmap="cividis", scalar_bar_args=bar, **shading)
        for points, width in ((mesh.points, 1.0), (moved, 2.5)):
            lines = pyvista.PolyData(points, lines=_with_counts(sharp_edges(mesh)))
            plotter.add_mesh(lines, line_width=width, color="black")
        if solution.problem.contact_points:
            places = body.contact_places + 2e-3 * length * viewing_direction(solution.problem)
            for row, (state, here, label) in enumerate(body.states()):
                colour = STATE_COLOURS[state]
                ink = "black" if state == ContactState.OPEN else colour
                plotter.add_text(
                    label, position=(0.8 * size[0], (0.96 - 0.04 * row) * size[1]), font_size=small, color=ink
                )
                if here.any():
                    mark = float(np.clip(0.25 * size[0] / np.sqrt(len(places)), 3.0, 14.0))
                    points = plotter.add_points(places[here], color=colour, point_size=mark, **shading)
                    points.prop.render_points_as_spheres = True
        text = "\n".join(line for line in (title or "", body.magnified) if line)
        if text:
            plotter.add_text(text, position="upper_left", font_size=small, color="black")
        plotter.show_bounds(
            mesh=surface, location="outer", ticks="both", font_size=small, n_xlabels=3, n_ylabels=3, n_zlabels=3,
            use_3d_text=False,
            xtitle=with_unit("x", unit), ytitle=with_unit("y", unit), ztitle=with_unit("z", unit), color="black",
        )  # fmt: skip
        middle = 0.5 * (moved.min(axis=0) + moved.max(axis=0))
        plotter.camera_position = [middle + 2.4 * length * viewing_direction(solution.problem), middle, (0.0, 0.0, 1.0)]
        try:
            with whole_file(path) as temporary:
                plotter.screenshot(str(temporary))
        finally:
            plotter.close()
    return path


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
