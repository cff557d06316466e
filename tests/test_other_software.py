"""Code for users of other software runs where that software is installed, and gives the library's own answer."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv

PAGE = Path(__file__).parents[1] / "docs" / "from-other-software.md"


def code_under(heading: str) -> str:
    """The code under a heading."""
    section = PAGE.read_text(encoding="utf-8").split(f"## {heading}\n")[1].split("\n## ")[0]
    (code,) = re.findall(r"^```py\n(.*?)^```", section, re.DOTALL | re.MULTILINE)
    return str(code)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "heading", "tolerance"), [("getfem", "GetFEM", 1e-3), ("dolfinx", "FEniCSx (DOLFINx)", 1e-9)]
)
def test_code_for_another_code(
    module: str, heading: str, tolerance: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """DOLFINx cuts squares as ``pattern="right"`` does, GetFEM in another way."""
    code = code_under(heading)
    compile(code, heading, "exec")
    pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(code, heading, "exec"), names)
    own = hv.solve(
        hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 16, pattern="right"),
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()},
            contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.5))},
            body_force=(-0.8, -0.8),
        )
    ).raise_for_status()
    assert names["solution"].energy == pytest.approx(own.energy, rel=tolerance)
    assert names["solution"].normal_force == pytest.approx(own.normal_force, rel=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize(("module", "slope"), [("torch", "gap.grad.numpy()"), ("jax", "np.asarray(slope)")])
def test_automatic_differentiation_goes_through_contact(module: str, slope: str) -> None:
    """The gradient of the sum of squares of the pressures, against differences."""
    page = (PAGE.parent / "identification.md").read_text(encoding="utf-8").split("\n## Sensitivities\n")[1]
    blocks = re.findall(r"^```(python|py)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    stated, torch, jax = blocks[0][1], *(code for kind, code in blocks if kind == "py")
    pytest.importorskip(module)
    if module == "jax":  # by_gaps stands in the block of torch
        torch = torch[torch.index("def by_gaps") : torch.index("class Pressures")] + jax
    names: dict[str, Any] = {}
    exec(compile(stated + torch, module, "exec"), names)

    def squares(gap: Any) -> float:
        return float((hv.solve(names["pressed"](gap)).pressure ** 2).sum())

    unit = np.eye(names["knots"].size)
    expected = [(squares(1e-7 * one) - squares(-1e-7 * one)) / 2e-7 for one in unit]
    np.testing.assert_allclose(eval(slope, names), expected, rtol=1e-5, atol=1e-4)


def test_the_code_stands_on_the_page() -> None:
    for heading in ("GetFEM", "FEniCSx (DOLFINx)"):
        assert "of_arrays" in code_under(heading)
