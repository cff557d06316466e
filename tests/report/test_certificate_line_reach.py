"""Laws that fall without bound far out: alpha is that of a reach, and a solution is the only one within it."""

from __future__ import annotations

import json

from hemivar.branches import find_solutions
from hemivar.certificates import smallness
from hemivar.certificates.smallness import one_solution
from hemivar.laws import ContactLaw, FormulaLaw
from hemivar.report import plot_certificate
from hemivar.report.notebook import html_of
from tests.bodies import points_on_springs
from tests.certificates.test_bound_reach import certified


def test_every_output_says_so() -> None:
    """There is another solution at 10.3, where the law has overtaken the body."""
    problem = points_on_springs(3e3, [1.0], ContactLaw(FormulaLaw("-exp(r)", reach=4.0)))
    certificate = certified(problem)
    said = "the only one with penetrations within the reach 4"
    assert certificate.unique == certificate.uniqueness == said
    record = json.loads(json.dumps(certificate.record()))
    assert record["unique"] == said
    assert record["reach_normal"] == 4.0
    assert "reach_tangential" in record["infinite"]
    whole = "\n".join(certificate.lines(whole=True))
    assert f"local minimiser; {said}" in whole
    assert "an estimate, for penetrations within the reach 4 only" in whole
    assert said in certificate.brief()
    assert said in html_of(certificate)
    figure = plot_certificate(certificate)
    assert said in figure._suptitle.get_text()  # type: ignore[attr-defined]
    assert not one_solution(problem, certificate.smallness)
    assert not one_solution(problem, smallness(problem))
    found = find_solutions(problem, starts=2)
    assert not found.exhaustive
    assert "sampled" not in whole + found.searched
    assert "unique minimiser" not in whole
