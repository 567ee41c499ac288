"""What a diagnosis says of a cause that its library lacks: every effect of static poses left out in turn.

    python bench/leave_one_out.py --each 3 --seed 75000 [--only NAME ...] [--clean 12] [--out FILE.json]

A case of bench/blind with one hidden effect (today's conditions), diagnosed by a library without this effect
and without its other forms (`FORMS`: a curve of a gear would stand for its run-out). Counted per effect:

    else    the verdict is `unexplained`, and held-out rows, unknown functions or wandering say so
    axis    an unknown function turns the hidden cause's axis (or tilts what stands behind one, or moves the
            device, where no axis is turned)
    signal  it follows the signal that the cause follows (`SIGNALS`)

A cause at less than `CLEAR` times the noise is drawn anew with the next seed: nobody can miss what nobody
sees. --clean: cases without a cause, diagnosed by the whole library; counted are those with a draft.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind import pose_scenario  # noqa: E402
from blind.scorer import diagnose_case  # noqa: E402
from exactarm.effects import library  # noqa: E402

ROBOTS = TOP / "python" / "exactarm" / "data" / "robots"
CLEAR = 1.5  # validation RMS beside the noise, as in bench/blind
_STEP = 100  # seeds of one effect
GEAR = ("gear_eccentricity", "gear_harmonics")
FORMS = dict.fromkeys(GEAR, GEAR)
# what it follows: {j} the axis, {m} the motor; alternatives in the order of their likeness
SIGNALS = {
    "backlash": (("load of axis {j}",), "axis"),
    "joint_compliance": (("load of axis {j}",), "axis"),
    "gear_eccentricity": (("angle of axis {j}",), "axis"),
    "gear_harmonics": (("angle of axis {j}",), "axis"),
    "direction_dependence": (("angle of axis {j}", "approach of axis {j}"), "axis"),
    "gear_ratio": (("angle of axis {j}",), "axis"),
    "joint_coupling": (("angle of axis {m}",), "axis"),
    "hysteresis": (("approach of axis {j}",), "axis"),
    "base_compliance": (("position", "load of axis", "angle of axis"), "any"),
    "link_compliance": (("position", "load of axis", "angle of axis"), "any"),
    "thermal_drift": (("temperature", "time", "neighbouring rows"), "any"),
    "tracker_scale": (("position",), "device"),
    "tracker_drift": (("time", "temperature", "neighbouring rows"), "device"),
    "tracker_step": (("time", "neighbouring rows"), "device"),
}


def judged(record: dict, truth: dict) -> dict:
    """What the record of a case says of the hidden effect."""
    effect, said = truth["effects"][0], record.get("else_said", "")
    signals, where = SIGNALS[effect["effect"]]
    joint, motor = effect["joint"], effect.get("motor")
    turned, device = f"a turn of axis {joint} " in said, "device" in said
    moved = device or "a turn of axis" in said or "a tilt behind axis" in said
    axis = {"axis": turned, "device": device, "any": moved}[where]
    signal = any(s.format(j=joint, m=motor) in said for s in signals)
    return {"else": record.get("verdict") == "unexplained", "axis": axis, "signal": signal}


def case(folder: Path, name: str, seed: int) -> tuple[dict, dict, int]:
    """One clear case of an effect: record, marks, and the seed after it."""
    whole = dict(library())
    while True:
        drawn = pose_scenario.draw_case(folder / str(seed), seed, ROBOTS, name)
        seed += 1
        if drawn.truth["raised"] >= CLEAR:
            break
    try:
        record = diagnose_case(drawn.robot, drawn.data, drawn.truth, without=FORMS.get(name, (name,)))
    finally:
        library().clear()
        library().update(whole)
    return record, judged(record, drawn.truth), seed


def share(marks: list[dict], key: str) -> str:
    return f"{sum(m[key] for m in marks)}/{len(marks)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--seed", type=int, default=75000)
    parser.add_argument("--only", nargs="+", choices=SIGNALS, default=list(SIGNALS))
    parser.add_argument("--clean", type=int, default=0)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    marks: dict[str, list[dict]] = {name: [] for name in arguments.only}
    records, drafted = [], 0
    with tempfile.TemporaryDirectory() as scratch:
        for name in arguments.only:
            seed = arguments.seed + _STEP * list(SIGNALS).index(name)
            for _ in range(arguments.each):
                record, mark, seed = case(Path(scratch), name, seed)
                marks[name].append(mark)
                records.append(record | mark)
                flags = " ".join(key if mark[key] else "-" * len(key) for key in mark)
                print(f"{record['seed']} {flags} x{record['raised']:.2f} {record['hidden']} -> "
                      f"{record.get('verdict')}: {record.get('named')} | {record.get('else_said', '')} "
                      f"| {record['cpu_seconds']:.1f} s", flush=True)
                if arguments.out:
                    arguments.out.write_text(json.dumps(records, indent=1) + "\n")
        for seed in range(arguments.seed + _STEP * len(SIGNALS),
                          arguments.seed + _STEP * len(SIGNALS) + arguments.clean):
            drawn = pose_scenario.draw_case(Path(scratch) / str(seed), seed, ROBOTS, "clean")
            record = diagnose_case(drawn.robot, drawn.data, drawn.truth)
            drafted += bool(record.get("drafts"))
            print(f"{seed} clean -> {record.get('verdict')}: {record.get('named')}, "
                  f"{record.get('drafts')} drafts", flush=True)
    for name, found in marks.items():
        print(f"{name:22s}", *(f"{key} {share(found, key)}" for key in ("else", "axis", "signal")))
    every = [mark for found in marks.values() for mark in found]
    print(f"{'all':22s}", *(f"{key} {share(every, key)}" for key in ("else", "axis", "signal")),
          f"clean with drafts {drafted}/{arguments.clean}")


if __name__ == "__main__":
    main()
