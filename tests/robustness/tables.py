"""Hostile CSV files."""

from __future__ import annotations

import math
import random

from tests.robustness.seeds import FILES
from tests.robustness.toml import spoilt, strange_name

__all__ = ["odd_table"]


def odd_table(rng: random.Random, which: str) -> tuple[bytes, str]:
    """A CSV file and what is odd about it."""
    columns = {"law.csv": ["r", "derivative"], "friction.csv": ["r", "derivative"], "bound.csv": ["s", "bound"]}[which]
    rows = [line.split(",") for line in FILES[which].decode().splitlines()[1:]]
    head: list[str] | None = list(columns)
    separator, note = ",", ""
    match rng.randrange(24):
        case 0:
            head, rows, note = head[::-1], [row[::-1] for row in rows], "columns swapped, with their names"
        case 1:
            head, note = head[::-1], "names swapped"
        case 2:
            head = rng.choice(
                [
                    ["x", "y"],
                    ["derivative", "r"],
                    ["Penetration", "Pressure"],
                    ["r"],
                    ["r", "r"],
                    ["", ""],
                    [strange_name(rng)] * 2,
                ]
            )
            note = f"names {str(head)[:40]}"
        case 3:
            rows, head, note = [[c.replace(".", ",") for c in row] for row in rows], None, "decimal commas"
        case 4:
            separator, rows, note = (
                ";",
                [[c.replace(".", ",") for c in row] for row in rows],
                "decimal commas, semicolons",
            )
        case 5:
            separator = rng.choice([";", "\t", " ", "|", "  ", " ; ", ", "])
            note = f"separator {separator!r}"
        case 6:
            rows = [[*row, str(rng.random())] for row in rows]
            head = rng.choice([None, [*columns, "note"], ["note", *columns]])
            note = f"three columns, names {head}"
        case 7:
            rng.shuffle(rows)
            note = "unsorted"
        case 8:
            rows = rows + [rows[-1]] * rng.choice([1, 2, 5])
            note = "last row repeated"
        case 9:
            i, j = rng.randrange(len(rows)), rng.randrange(2)
            rows[i][j] = rng.choice(
                [
                    "nan",
                    "inf",
                    "-inf",
                    "",
                    "x",
                    "1e400",
                    "1e308",
                    "-1e308",
                    "1e-320",
                    "0x1",
                    "1_0",
                    "\u0661",
                    "1e",
                    "NULL",
                    "-5",
                ]
            )
            note = f"cell {rows[i][j]!r}"
        case 10:
            count = rng.choice([0, 1])
            rows, note = rows[:count], f"{count} rows"
        case 11:
            count = rng.choice([1000, 3000, 20_000, 100_000])
            rows = [[f"{0.5 * i / count:.8f}", f"{0.1 + 0.8 * i / count + 0.01 * (i % 2):.6f}"] for i in range(count)]
            note = f"{count} rows"
        case 12:
            rows[rng.randrange(len(rows))][rng.randrange(2)] = "1" * rng.choice([200_000, 2_000_000])
            note = "a huge field"
        case 13:
            head = ["a" * 200_000, "b"]
            note = "a huge name"
        case 14:
            rows = [[c, str(-float(d))] for c, d in rows]
            note = "values negative"
        case 15:
            factor = 10.0 ** rng.choice([-300, -100, -20, 20, 100, 155, 300])
            rows = [[c, repr(float(d) * factor)] for c, d in rows]
            note = f"values times {factor:g}"
        case 16:
            factor = 10.0 ** rng.choice([-300, -20, 20, 100, 300])
            rows = [[repr(float(c) * factor), d] for c, d in rows]
            note = f"places times {factor:g}"
        case 17:
            rows.insert(
                rng.randrange(len(rows)),
                rng.choice([["# comment"], [""], ["r", "derivative"], ['"0.1', '0.2"'], ["1"]]),
            )
            note = "a row of another kind"
        case 18:
            head, note = None, "without names"
        case 19:
            rows = [[f'"{c}"' for c in row] for row in rows]
            note = "quoted"
        case 20:
            rows = [
                [repr(math.nextafter(float(rows[0][0]), math.inf)) if i == 1 else row[0], row[1]]
                for i, row in enumerate(rows)
            ]
            rows.sort(key=lambda row: float(row[0]))
            note = "places one rounding apart"
        case 21:
            rows = [[row[0], repr(float(row[1]) * rng.uniform(-2, 2))] for row in rows]
            note = "values at random"
        case 22:
            rows = [[c, d] for c, d in rows for _ in range(2)]
            note = "every row twice"
        case _:
            content, note = spoilt(FILES[which], rng)
            return content, note
    lines = [separator.join(row) for row in ([head] if head else []) + rows]
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogatepass"), note
