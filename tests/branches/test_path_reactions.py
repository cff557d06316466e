"""Forces of supports along a path: they balance loads and contact, and end as those of a solve."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches import Path, follow_path
from hemivar.cli.app import main
from hemivar.errors import ProblemError

GLUE = hv.laws.Adhesive(20.0, 0.2, softening=10.0, compression=50.0)


def glued_strip(pulled: bool, loaded: bool) -> hv.ContactProblem:
    """A strip on glue, clamped on the left, drawn up at the right or by a traction."""
    return hv.ContactProblem(
        hv.rectangle((4.0, 1.0), (8, 2)),
        hv.Material.young(100.0, 0.3),
        contact={"bottom": hv.Contact(GLUE)},
        supports={"left": "clamped", **({"right": hv.Fixed(y=0.05)} if pulled else {})},
        tractions={"top": (0.0, 0.1)} if loaded else {},
    )


def force_of_foundation(path: Path) -> np.ndarray:
    """Force of the foundation on the body at each point, (k, d)."""
    contact = path.problem.contact
    forces = [contact.weights @ (0.0 - contact.global_vectors(one)) for one in path.multiplier]
    return np.array(forces)


@pytest.mark.parametrize(("pulled", "loaded"), [(True, False), (False, True), (True, True)])
def test_supports_loads_and_contact_are_in_balance_at_every_point(pulled: bool, loaded: bool) -> None:
    problem = glued_strip(pulled, loaded)
    path = follow_path(problem)
    reactions = {name: path.reactions(name) for name in problem.supports}
    load = np.outer(path.load_factor, [0.0, 0.4 if loaded else 0.0])
    np.testing.assert_allclose(sum(reactions.values()) + force_of_foundation(path) + load, 0.0, atol=1e-12)
    assert path.load_factor[-1] == 1.0
    solution = hv.solve(problem)
    np.testing.assert_allclose(solution.local, path.local[-1], atol=1e-9)  # the same of several equilibria
    for name, force in solution.reactions.items():
        np.testing.assert_allclose(reactions[name][-1], force, atol=1e-8)


def test_constant_loads_are_counted_whole_at_every_point() -> None:
    path = follow_path(glued_strip(True, True), constant=["top"])
    total = path.reactions("left") + path.reactions("right")
    np.testing.assert_allclose(total + force_of_foundation(path), np.outer(np.ones(len(path)), [0.0, -0.4]), atol=1e-12)


def test_the_record_has_the_force_of_a_support_as_its_quantity() -> None:
    path = follow_path(glued_strip(True, False))
    values = [row["value"] for row in path.record("support.right.force.y")["points"]]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(values, path.reactions("right")[:, 1])
    sizes = [row["value"] for row in path.record("support.right.force")["points"]]  # type: ignore[attr-defined]
    np.testing.assert_allclose(sizes, np.linalg.norm(path.reactions("right"), axis=1))


def test_an_unknown_support_is_refused() -> None:
    with pytest.raises(ProblemError, match="no support 'rigth'"):
        follow_path(glued_strip(True, False)).reactions("rigth")


def test_the_command_prints_the_peak(tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "strip.toml"
    hv.write_problem(glued_strip(True, False), file)
    assert main(["path", str(file), "--quantity", "support.right.force"]) == 0
    printed = capsys.readouterr().out
    force = np.linalg.norm(follow_path(glued_strip(True, False)).reactions("right"), axis=1)
    line = next(line for line in printed.splitlines() if line.startswith("peak"))
    assert f"support.right.force {force.max():.6g} at load factor" in line
    assert main(["path", str(file), "--quantity", "support.rigth.force"]) == 2
    assert "support.right.force" in capsys.readouterr().err
