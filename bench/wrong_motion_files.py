"""Blind motions whose robot file is wrong (masses, or one gear ratio): what a diagnosis and first aid say.

    python bench/wrong_motion_files.py masses --seed 74100 --count 5 [--theme clean] [--conditions today]
        [--off 0.03] [--program FOLDER] [--out marks.json]
    python bench/wrong_motion_files.py ratio --seed 74020 --count 14 [--off 0.1] [--axes 4]

masses: every link's mass times 1 + off n, its centre plus off |c| n each way (n: standard normal, by the
seed of the case), then the diagnosis; counted is on how many files `link_masses` is named, how many hidden
causes of the library are named beside it, and which names are neither.

ratio: the first `axes` gear ratios times 1 + off, one after the other; counted is how many first aid tells,
with the right axis and a ratio within 3 % of the true one, and on how many files that are right it says
something.

Data are those of bench/blind, whose generator stays as it is.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind import motion_scenario  # noqa: E402
from blind.run import ROBOTS, line  # noqa: E402
from blind.scorer import diagnose_case  # noqa: E402

NEAR = 0.03  # of a ratio that first aid says


def spoiled(text: str, off: float, random: np.random.Generator) -> str:
    """The robot file with other masses and centres; nothing else changes."""
    lines, inside = text.splitlines(), False
    for number, row in enumerate(lines):
        inside = row.strip() == "[[links]]" if row.lstrip().startswith("[") else inside
        key, _, value = row.partition(" = ")
        if inside and key == "mass_kg":
            lines[number] = f"{key} = {tomllib.loads(row)[key] * (1.0 + off * random.standard_normal())!r}"
        elif inside and key == "centre_of_mass_m":
            centre = np.array(tomllib.loads(row)[key])
            centre = centre + off * np.linalg.norm(centre) * random.standard_normal(3)
            lines[number] = f"{key} = {[float(part) for part in centre]}"
    return "\n".join(lines) + "\n"


def masses(case, arguments) -> dict:
    case.robot.write_text(spoiled(case.robot.read_text(), arguments.off,
                                  np.random.default_rng([case.truth["seed"], 7])))
    return diagnose_case(case.robot, case.data, case.truth) | {"masses_off": arguments.off}


def of_masses(records: list[dict]) -> str:
    named = [set(record.get("named", ())) for record in records]
    hidden = [set() if record["foreign"] else set(record["hidden"]) for record in records]
    wrong = [name for names, causes in zip(named, hidden) for name in names - causes - {"link_masses"}]
    right = sum(len(names & causes) for names, causes in zip(named, hidden))
    return (f"link_masses named on {sum('link_masses' in names for names in named)} of {len(records)} files; "
            f"{right} of {sum(map(len, hidden))} hidden causes named; "
            f"wrong names: {', '.join(sorted(wrong)) or 'none'}")


def of_ratios(records: list[dict]) -> str:
    total = {key: sum(record[key] for record in records) for key in ("tried", "told", "right", "false")}
    return (f"told {total['told']} of {total['tried']}, {total['right']} of them right; said something on "
            f"{total['false']} of {len(records)} right files")


def ratio(case, arguments) -> dict | None:
    """None where the file or the data do not admit the check."""
    from exactarm.data.dataset import read_dataset
    from exactarm.first_aid.ratio_mistakes import ratio_mistakes
    from exactarm.robot_file import load_robot

    robot = load_robot(str(case.robot))
    data = read_dataset(case.data, robot)
    if robot.links is None or not {"theta", "tau_motor"} & set(data.joints):
        return None
    told = right = 0
    for axis, joint in enumerate(robot.joints[: arguments.axes]):
        wrong = robot.with_joint(axis, ratio=joint.ratio * (1.0 + arguments.off))
        for said in ratio_mistakes(wrong, data):
            of, _, rest = said.text.partition("gear ratio of axis ")[2].partition(" of about ")
            near = abs(float(rest.split()[0]) / joint.ratio - 1.0) < NEAR
            told, right = told + 1, right + (of == str(axis + 1) and near)
    return {"seed": case.truth["seed"], "tried": min(arguments.axes, robot.axes), "told": told,
            "right": right, "false": len(list(ratio_mistakes(robot, data)))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("masses", "ratio"))
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--theme")
    parser.add_argument("--conditions", default="today")
    parser.add_argument("--off", type=float)
    parser.add_argument("--axes", type=int, default=4)
    parser.add_argument("--program", type=Path)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if arguments.program:
        sys.path.insert(0, str(arguments.program.resolve()))
    if arguments.off is None:
        arguments.off = 0.03 if arguments.what == "masses" else 0.1
    records: list[dict] = []
    with tempfile.TemporaryDirectory() as scratch:
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            case = motion_scenario.draw_case(Path(scratch) / str(seed), seed, ROBOTS, arguments.theme,
                                             arguments.conditions)
            record = masses(case, arguments) if arguments.what == "masses" else ratio(case, arguments)
            if record is None:
                continue
            records.append(record)
            print(line(record) if arguments.what == "masses" else record, flush=True)
            if arguments.out:
                arguments.out.write_text(json.dumps(records, indent=1) + "\n")
    print(of_masses(records) if arguments.what == "masses" else of_ratios(records))


if __name__ == "__main__":
    main()
