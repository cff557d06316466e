"""Few combinations in which every two levels of different factors meet."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence, Set

import numpy as np

from tests.composition.cases import Row
from tests.composition.rules import FACTORS, RULES, statable, works

__all__ = ["completed", "every_pair", "few_rows", "pairs_of", "refused_rows"]

Pair = frozenset[tuple[str, str]]
#: Ways to complete a row that are tried for each one that is taken.
_TRIED = 60


def pairs_of(row: Row) -> set[Pair]:
    """The pairs of levels that meet in a row."""
    levels = [(name, getattr(row, name)) for name in FACTORS]
    return {frozenset(pair) for pair in itertools.combinations(levels, 2)}


def completed(levels: Mapping[str, str], refused: bool = False) -> Row | None:
    """The plainest combination with some levels given that can be stated, and works unless it may be refused."""
    tried = [[levels[name]] if name in levels else _plainest_first(name) for name in FACTORS]
    if levels.get("beside", "none") != "none" and "task" not in levels:
        tried[0] = ["march"]
    rows = (Row(*chosen) for chosen in itertools.product(*tried))
    usable = (row for row in rows if (statable if refused else works)(vars(row)))
    return next(usable, None)


def _plainest_first(factor: str) -> list[str]:
    plain = getattr(Row("solve"), factor)
    return [plain, *(level for level in FACTORS[factor] if level != plain)]


def _all_pairs(factors: Mapping[str, Sequence[str]]) -> Iterator[dict[str, str]]:
    for (one, ones), (other, others) in itertools.combinations(factors.items(), 2):
        yield from ({one: a, other: b} for a, b in itertools.product(ones, others))


def every_pair() -> list[Row]:
    """A row for each two levels, all else being plain; refused where the two levels are refused by themselves."""
    found = []
    for levels in _all_pairs(FACTORS):
        row = completed(levels) or completed(levels, refused=True)
        if row is not None:
            found.append(row)
    return list(dict.fromkeys(found))


def few_rows(factors: Mapping[str, Sequence[str]], seed: int = 0) -> list[Row]:
    """Rows that work, in which every two levels meet that can meet in one (greedily, by random completions)."""
    random = np.random.default_rng(seed)
    left: dict[Pair, Row] = {}
    for levels in _all_pairs(factors):
        row = completed(levels)
        if row is not None and all(getattr(row, name) in factors[name] for name in factors):
            left[frozenset(levels.items())] = row
    rows = []
    while left:
        plainest = next(iter(left.values()))
        given = dict(next(iter(left)))
        best, gain = plainest, len(pairs_of(plainest) & left.keys())
        for row in _completions(given, factors, left.keys(), random):
            count = len(pairs_of(row) & left.keys())
            if count > gain:
                best, gain = row, count
        rows.append(best)
        for pair in pairs_of(best):
            left.pop(pair, None)
    return rows


def _completions(
    given: Mapping[str, str], factors: Mapping[str, Sequence[str]], left: Set[Pair], random: np.random.Generator
) -> Iterator[Row]:
    """Rows with some levels given, each further level being one that meets most of the others for the first time."""
    for _ in range(_TRIED):
        chosen = dict(given)
        for name in random.permutation([name for name in factors if name not in given]).tolist():
            new = {
                level: sum(frozenset({(name, level), one}) in left for one in chosen.items()) + 0.9 * random.random()
                for level in factors[name]
                if works(chosen | {name: level})
            }
            if not new:
                break
            chosen[name] = max(new, key=new.__getitem__)
        else:
            yield Row(**chosen)


def refused_rows() -> list[Row]:
    """The plainest row that each rule refuses."""
    found = []
    for rule in RULES:
        named = {name: getattr(rule, name) for name in FACTORS if getattr(rule, name)}
        rows = (
            completed(dict(zip(named, chosen, strict=True)), refused=True)
            for chosen in itertools.product(*named.values())
        )
        found.append(next(row for row in rows if row is not None))
    return list(dict.fromkeys(found))
