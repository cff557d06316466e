"""``python -m tests.robustness --cases 3000 --seed 1 --jobs 2``: run hostile cases and print what became of them.

``python -m tests.robustness bounds --cases 300`` holds random bounds against finer solutions instead.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.robustness import bounds
from tests.robustness.case import leave_command
from tests.robustness.generate import FAMILIES, make_case
from tests.robustness.judge import FAULTS, Outcome, as_record, run_and_judge, table
from tests.robustness.limited import warm_up
from tests.robustness.pool import run_cases


def main() -> int:
    if sys.argv[1:2] == ["bounds"]:
        return bounds.main(sys.argv[2:])
    parser = argparse.ArgumentParser(prog="python -m tests.robustness", description=__doc__)
    parser.add_argument("--cases", type=int, default=300, help="how many (300)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (1)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (0)")
    parser.add_argument("--jobs", type=int, default=2, help="processes at work at once (2)")
    parser.add_argument("--family", choices=list(FAMILIES), help="only cases of this family")
    parser.add_argument("--case", metavar="SEED:NUMBER", help="one case, with everything it prints")
    parser.add_argument("--dump", type=Path, metavar="DIR", help="keep the folders of cases with faults here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all outcomes")
    given = parser.parse_args()
    if given.case is not None:
        return _one(given.case, given.family, given.dump)
    begun = time.monotonic()
    numbers = range(given.first, given.first + given.cases)
    outcomes: list[Outcome] = []
    for outcome in run_cases(given.seed, numbers, given.jobs, given.family, given.dump):
        outcomes.append(outcome)
        if outcome.verdict in FAULTS:
            print(f"{outcome.name:>9}  {outcome.verdict}: {outcome.faults[outcome.verdict]}")
            print(f"{'':11}{outcome.family}: {outcome.note}", flush=True)
    print(f"\n{table(outcomes)}\n\n{len(outcomes)} cases in {time.monotonic() - begun:.0f} s")
    if given.json is not None:
        given.json.write_text(json.dumps([as_record(o) for o in outcomes], indent=1) + "\n", encoding="utf-8")
    return int(any(o.verdict in FAULTS for o in outcomes))


def _one(name: str, family: str | None, dump: Path | None) -> int:
    seed, _, number = name.partition(":")
    case = make_case(int(seed), int(number), family)
    warm_up()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "case"
        outcome = run_and_judge(case, folder)
        print(f"{case.family}: {case.note}\nhemivar {' '.join(case.arguments)}")
        sys.stdout.write((folder.parent / "case.log").read_text(encoding="utf-8", errors="backslashreplace"))
        print(json.dumps(as_record(outcome), indent=1))
        if dump is not None:
            leave_command(case, folder)
            shutil.copytree(folder, dump / name.replace(":", "-"), symlinks=True, dirs_exist_ok=True)
    return int(outcome.verdict in FAULTS)


if __name__ == "__main__":
    sys.exit(main())
