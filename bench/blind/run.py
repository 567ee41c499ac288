"""Draws cases, diagnoses them blind and prints the marks.

    python bench/blind/run.py --count 60 [--kind poses|gear_run|motion|tracked_motion] [--seed 0]
        [--theme NAME] [--conditions today|wide|NAME] [--without NAME] [--program FOLDER] [--folder DIR]
        [--out marks.json]
    python bench/blind/run.py --read marks.json ...

theme: single, clean, foreign, pair, or the name of one effect; without it they come in turn at random.
conditions: blind/conditions.py. Every case stands in its own folder under DIR with robot, data and truth,
so that any of them can be looked at again. The program under test is the one of this checkout, or the
`python` folder of another. --out is written anew after every case, so that a run that is stopped leaves
what it has; --read prints the marks of several such files together.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
if str(TOP / "bench") not in sys.path:
    sys.path.insert(0, str(TOP / "bench"))

from blind import gear_scenario, motion_scenario, pose_scenario, tracked_scenario  # noqa: E402
from blind.conditions import NAMES, TODAY  # noqa: E402
from blind.marks import printed, summary  # noqa: E402
from blind.scorer import diagnose_case  # noqa: E402

SCENARIOS = {
    "poses": pose_scenario,
    "gear_run": gear_scenario,
    "motion": motion_scenario,
    "tracked_motion": tracked_scenario,
}
ROBOTS = TOP / "python" / "exactarm" / "data" / "robots"


def line(record: dict) -> str:
    hidden = " + ".join(record["hidden"]) or "nothing"
    named = (
        ", ".join(f"{n} ({p:.2f})" for n, p in zip(record.get("named", []), record.get("probability", [])))
        or "nothing"
    )
    times = lambda key: f"{record[key] / record['noise']:.2f}" if record.get(key) is not None else "-"
    conditions = ", ".join(record["conditions"])
    return (
        f"{record['seed']:5d} {record['score']:9s} x{record['raised']:.2f} {hidden} -> "
        f"{record.get('verdict', 'FAILED')}: {named} | "
        f"before {times('before')} after {times('after')} best {times('best')} "
        f"floor {times('noise_found')} | "
        f"{record['arm']} {record['rows']} {record['cpu_seconds']:.1f} s"
        + (f" | {conditions}" if conditions else "")
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=SCENARIOS, default="poses")
    parser.add_argument("--theme")
    parser.add_argument("--conditions", choices=NAMES, default=TODAY)
    parser.add_argument(
        "--without", action="append", default=[], metavar="NAME", help="an effect the library shall not have"
    )
    parser.add_argument(
        "--program", type=Path, default=TOP / "python", help="the `python` folder of the program under test"
    )
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument(
        "--read", type=Path, nargs="+", help="print the marks of these files, and diagnose nothing"
    )
    arguments = parser.parse_args()
    if arguments.read:
        print(
            printed(
                summary([case for path in arguments.read for case in json.loads(path.read_text())["cases"]])
            )
        )
        return
    sys.path.insert(0, str(arguments.program.resolve()))
    command = {
        key: str(value) if isinstance(value, Path) else value for key, value in vars(arguments).items()
    }
    records: list[dict] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.folder or Path(scratch)
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            draw = SCENARIOS[arguments.kind].draw_case
            case = draw(folder / str(seed), seed, ROBOTS, arguments.theme, arguments.conditions)
            records.append(diagnose_case(case.robot, case.data, case.truth, without=tuple(arguments.without)))
            print(line(records[-1]), flush=True)
            if arguments.out:
                written = {"run": command, "marks": summary(records), "cases": records}
                arguments.out.write_text(json.dumps(written, indent=1) + "\n")
    print(printed(summary(records)))


if __name__ == "__main__":
    main()
