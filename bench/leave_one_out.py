"""What a diagnosis says of a cause that its library lacks: every effect of a kind of data left out in turn.

    python bench/leave_one_out.py [--kind poses|gear_run|motion|tracked_motion] --each 3 --seed 75000
        [--only NAME ...] [--clean 12] [--out FILE.json]

A case of bench/blind with one hidden effect (today's conditions), diagnosed by a library without this effect
and without its other forms (`FORMS`: a curve of a gear would stand for its run-out). Counted per effect:

    else    the verdict is `unexplained`, and held-out rows, unknown functions or wandering say so
    axis    an unknown function turns the hidden cause's axis (or tilts what stands behind one, or moves the
            device or the sensor, where no axis is turned)
    signal  it follows the signal that the cause follows (`SIGNALS`)

A cause at less than `CLEAR` times the noise is drawn anew with the next seed: nobody can miss what nobody
sees. --clean: cases without a cause, diagnosed by the whole library; counted are those with a draft.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind.run import ROBOTS, SCENARIOS  # noqa: E402
from blind.scorer import diagnose_case  # noqa: E402
from exactarm.effects import library  # noqa: E402

CLEAR = 1.5  # validation RMS beside the noise, as in bench/blind
_STEP, _TRIES = 100, 20  # seeds of one effect; for one clear case
GEAR = ("gear_eccentricity", "gear_harmonics")
FORMS = dict.fromkeys(GEAR, GEAR)
# what it follows: {j} the axis, {m} the motor; alternatives in the order of their likeness; and what it moves
OF_AXIS, OF_LOAD = ("angle of axis {j}",), ("load of axis {j}",)
OF_SIDE = ("direction of axis {j}", "approach of axis {j}", "speed of axis {j}", "angle of axis {j}")
OF_MOTOR, OF_WARMTH = ("angle of axis {m}",), ("temperature", "time", "neighbouring rows")
OF_RATE = ("speed of axis", "acceleration of axis")
POSES = {
    "backlash": (OF_LOAD, "axis"),
    "joint_compliance": (OF_LOAD, "axis"),
    "gear_eccentricity": (OF_AXIS, "axis"),
    "gear_harmonics": (OF_AXIS, "axis"),
    "direction_dependence": (("angle of axis {j}", "approach of axis {j}"), "axis"),
    "gear_ratio": (OF_AXIS, "axis"),
    "joint_coupling": (OF_MOTOR, "axis"),
    "hysteresis": (("approach of axis {j}",), "axis"),
    "base_compliance": (("position", "load of axis", "angle of axis"), "any"),
    "link_compliance": (("position", "load of axis", "angle of axis"), "any"),
    "thermal_drift": (OF_WARMTH, "any"),
    "tracker_scale": (("position",), "device"),
    "tracker_drift": (OF_WARMTH, "device"),
    "tracker_step": (("time", "neighbouring rows"), "device"),
}
IN_TIME = {"time_delay": (OF_RATE, "any"), "hysteresis": (OF_SIDE, "axis"),
           "backlash": (OF_LOAD + OF_SIDE, "axis"), "direction_dependence": (OF_SIDE, "axis")}
SIGNALS = {
    "poses": POSES,
    "gear_run": {name: POSES[name] for name in ("gear_harmonics", "gear_eccentricity", "joint_coupling")}
    | IN_TIME | {
        "gear_ratio": (OF_AXIS + ("speed of axis {j}",), "axis"),
        "speed_dependence": (("speed of axis {j}",), "axis"),
        "load_dependence": (OF_LOAD, "axis"),
        "gyro_scale": (OF_RATE, "device"),
        "gyro_bias": (("sensor",), "device"),  # follows nothing: the sensor is all there is to say
        "gyro_g_sensitivity": (("angle of axis",), "device"),
        "gyro_misalignment": (OF_RATE, "device"),
        "thermal_drift": (OF_WARMTH, "device"),
    },
    "motion": {
        "stribeck_friction": (("speed of axis {j}",), "axis"),
        "asymmetric_friction": (("speed of axis {j}", "direction of axis {j}"), "axis"),
        "load_friction": (OF_LOAD + ("speed of axis {j}", "direction of axis {j}"), "axis"),
        "torque_ripple": (("motor angle of axis {j}", "angle of axis {j}"), "axis"),
        "torque_constant": (OF_LOAD, "axis"),
        "rotor_inertia": (("acceleration of axis {j}",), "axis"),
        "gravity_compensator": (OF_AXIS, "axis"),
        "payload": (("load of axis", "angle of axis"), "any"),
        "gear_ratio": (OF_LOAD + OF_AXIS + ("acceleration of axis {j}",), "axis"),
        "joint_coupling": (("axis {m}",), "axis"),
        "time_delay": (OF_RATE, "any"),
        "thermal_drift": (OF_WARMTH + OF_RATE, "any"),
    },
    "tracked_motion": {name: of for name, of in POSES.items() if name != "gear_harmonics"} | IN_TIME
    | {"payload": (("load of axis", "angle of axis", "angles of two axes"), "any")},
}


def judged(record: dict, truth: dict, signals: tuple[str, ...], where: str) -> dict:
    """What the record of a case says of the hidden effect."""
    effect, said = truth["effects"][0], record.get("else_said", "")
    joint, motor = effect["joint"], effect.get("motor")
    turns = lambda axis: re.search(rf"(?<!of )axis {axis} (follows|by)", said) or f"along axis {axis}" in said
    turned = bool(turns(joint)) or f"a turn of axis {joint} " in said
    device = "device" in said or "sensor" in said
    moved = device or bool(turns(r"\d")) or "a turn of axis" in said or "a tilt behind axis" in said
    axis = {"axis": turned, "device": device, "any": moved}[where]
    signal = any(s.format(j=joint, m=motor) in said for s in signals)
    return {"else": record.get("verdict") == "unexplained", "axis": axis, "signal": signal}


def case(folder: Path, kind: str, name: str, first: int) -> tuple[dict, dict, int] | None:
    """One clear case of an effect: record, marks, and the seed after it; None where few seeds give one."""
    whole, drawn = dict(library()), None
    for seed in range(first, first + _TRIES):
        with contextlib.suppress(RuntimeError):  # an arm or runs that cannot show it
            drawn = SCENARIOS[kind].draw_case(folder / str(seed), seed, ROBOTS, name)
            if drawn.truth["raised"] >= CLEAR:
                break
    else:
        return None
    try:
        record = diagnose_case(drawn.robot, drawn.data, drawn.truth, without=FORMS.get(name, (name,)))
    finally:
        library().clear()
        library().update(whole)
    return record, judged(record, drawn.truth, *SIGNALS[kind][name]), seed + 1


def share(marks: list[dict], key: str) -> str:
    return f"{sum(m[key] for m in marks)}/{len(marks)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", choices=SIGNALS, default="poses")
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--seed", type=int, default=75000)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--clean", type=int, default=0)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    kind, names = arguments.kind, list(SIGNALS[arguments.kind])
    if unknown := set(arguments.only or ()) - set(names):
        parser.error(f"{kind} have no {', '.join(sorted(unknown))}; they have {', '.join(names)}")
    marks: dict[str, list[dict]] = {name: [] for name in arguments.only or names}
    records, drafted = [], 0
    with tempfile.TemporaryDirectory() as scratch:
        for name in marks:
            seed = arguments.seed + _STEP * names.index(name)
            for _ in range(arguments.each):
                found = case(Path(scratch), kind, name, seed)
                if found is None:
                    print(f"{name}: no clear case from seed {seed} on", flush=True)
                    break
                record, mark, seed = found
                marks[name].append(mark)
                records.append(record | mark)
                flags = " ".join(key if mark[key] else "-" * len(key) for key in mark)
                print(f"{record['seed']} {flags} x{record['raised']:.2f} {record['hidden']} -> "
                      f"{record.get('verdict')}: {record.get('named')} | {record.get('else_said', '')} "
                      f"| {record['cpu_seconds']:.1f} s", flush=True)
                if arguments.out:
                    arguments.out.write_text(json.dumps(records, indent=1) + "\n")
        for seed in range(arguments.seed + _STEP * len(names),
                          arguments.seed + _STEP * len(names) + arguments.clean):
            drawn = SCENARIOS[kind].draw_case(Path(scratch) / str(seed), seed, ROBOTS, "clean")
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
