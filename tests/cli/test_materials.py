"""``hemivar materials``: the list, one material with its bounds, its picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hemivar.cli import main
from hemivar.errors import ProblemError
from hemivar.mechanics import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.report.material_figures import plot_material
from tests.samples import sampled


@pytest.mark.parametrize("name", sampled(sorted(MATERIAL_LAWS), 3))
def test_every_material_is_shown_and_drawn(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "material.png"
    assert main(["materials", name, "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert f"  {name}: " in out
    assert f'material = {{ law = "{name}", ' in out
    assert "C_low has " in out
    assert "strongly monotone" in out
    assert "(change them with --set)" in out
    assert picture.stat().st_size > 10_000


def test_they_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials"]) == 0
    out = capsys.readouterr().out
    assert "linear materials" in out
    for name, entry in MATERIAL_LAWS.items():
        assert f"  {name}: " in out
        assert all(f"      {p.key} " in out for p in entry.parameters)


def test_constants_are_taken(capsys: pytest.CaptureFixture[str]) -> None:
    given = ["bulk=10", "shear=5", "softened=0.2", "strain=0.01", "plane=strain"]
    assert main(["materials", "hencky", *(part for one in given for part in ("--set", one))]) == 0
    out = capsys.readouterr().out
    assert "C_low has bulk modulus 10, shear modulus 1\n" in out
    assert "C_up has bulk modulus 10, shear modulus 5\n" in out
    assert "shown with" not in out
    assert main(["materials", "potential", "--set", "energy=tr^2 + dev2", "--set", "reach=1"]) == 0
    out = capsys.readouterr().out
    assert "proved by intervals" in out
    assert "for |eps| <= 1" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["henky"], ["did you mean 'hencky'?"]),
        (["--plot", "m.png"], ["name a material"]),
        (["hencky", "--plot", "m.txt"], [".png"]),
        (["hencky", "--set", "bulk"], ["NAME=VALUE"]),
        (["hencky", "--set", "stiffening=1"], ["material 'hencky' has no parameter 'stiffening'"]),
        (["hencky", "--set", "bulk=-1"], ["bulk", "positive"]),
        (["hencky", "--set", "bulk=1+x"], ["--set bulk=1+x", "a problem file"]),
        (["hencky", "--reach", "0"], ["--reach", "positive strain"]),
        (["locking", "--set", "measure=volume"], ["deviator, strain"]),
        (["potential", "--set", "energy=tr^2 - dev2"], ["is not convex"]),
    ],
)
def test_mistakes_are_told(arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials", *arguments]) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in words), told


def test_the_curve_lies_between_its_bounds() -> None:
    for material in (Material.hencky(6.0, 4.0, 0.25, 0.05), Material.locking(6.0, 4.0, 50.0, 0.03, plane="stress")):
        for panel in plot_material(material).axes:
            up, low, curve = (line for line in panel.lines if len(line.get_xdata()) > 2)
            strain = np.asarray(curve.get_xdata())
            size = [np.abs(np.asarray(line.get_ydata())) for line in (low, curve, up)]
            assert (size[0] <= size[1] + 1e-12).all()
            assert (size[1] <= size[2] + 1e-12).all()
            ratio = size[1][strain != 0.0] / size[2][strain != 0.0]
            assert ratio.max() - ratio.min() > 0.1  # the picture reaches as far as something happens


def test_what_cannot_be_drawn_is_said() -> None:
    mixed = Material.by_region({"a": Material.young(1.0, 0.3)})
    varies = Material.hencky(lambda x: 1.0 + x[:, 0], 4.0, 0.25, 0.05)
    for material in (mixed, varies):
        with pytest.raises(ProblemError, match="draw one material, at a point"):
            plot_material(material)
    assert len(plot_material(varies, point=(0.0, 0.0)).axes) == 2
    with pytest.raises(ProblemError, match=r"reach is -1\.0; give a positive number"):
        plot_material(Material.hencky(6.0, 4.0, 0.25, 0.05), reach=-1.0)
