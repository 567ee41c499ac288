"""Draws cases, diagnoses them blind and prints the marks.

    python bench/blind/run.py --count 60 [--kind poses|gear_run|motion|tracked_motion] [--seed 0] [--theme NAME] [--folder DIR] [--out marks.json]

theme: single, clean, foreign, pair, or the name of one effect; without it they come in turn at random. Every case
stands in its own folder under DIR with robot, data and truth, so that any of them can be looked at again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
for folder in (TOP / "bench", TOP / "python"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from blind import gear_scenario, motion_scenario, pose_scenario, tracked_scenario  # noqa: E402
from blind.scorer import diagnose_case, summary  # noqa: E402

SCENARIOS = {"poses": pose_scenario, "gear_run": gear_scenario, "motion": motion_scenario, "tracked_motion": tracked_scenario}
ROBOTS = TOP / "python" / "exactarm" / "data" / "robots"


def line(record: dict) -> str:
    hidden = " + ".join(record["hidden"]) or "nothing"
    named = ", ".join(f"{n} ({p:.2f})" for n, p in zip(record.get("named", []), record.get("probability", []))) or "nothing"
    times = lambda key: f"{record[key] / record['noise']:.2f}" if key in record else "-"
    return (f"{record['seed']:5d} {record['score']:9s} x{record['raised']:.2f} {hidden} -> {record.get('verdict', 'FAILED')}: {named} | "
            f"before {times('before')} after {times('after')} best {times('best')} floor {times('noise_found')} | "
            f"{record['arm']} {record['rows']} {record['seconds']:.1f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=SCENARIOS, default="poses")
    parser.add_argument("--theme")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.folder or Path(scratch)
        records = []
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            case = SCENARIOS[arguments.kind].draw_case(folder / str(seed), seed, ROBOTS, arguments.theme)
            records.append(diagnose_case(case.robot, case.data, case.truth))
            print(line(records[-1]), flush=True)
    marks = summary(records)
    for name, value in marks.items():
        print(f"{name:36s} {value}")
    if arguments.out:
        arguments.out.write_text(json.dumps({"marks": marks, "cases": records}, indent=1) + "\n")


if __name__ == "__main__":
    main()
