"""Processor seconds and peak memory of a diagnosis, beside another checkout of the program on the same data.

    python bench/diagnosis_time.py [CASE ...] [--beside CHECKOUT] [--repeats 3] [--out FILE.json]

    few         140 simulated poses of a UR10 with three hidden causes
    B, C        measured poses of a UR10 that come with the package, two set-ups
    both        B and C in one run, 4,268 poses
    many        12,000 simulated poses, the causes of `few`
    motion      measured torques of a TX40 that come with the package
    corners     60 simulated pictures of a board, a camera on the flange of a UR10
    encoders    a minute of 1 kHz between two encoders, simulated by bench/blind, a delay and a run-out hidden

Without CASE: all but both and many. Each diagnosis is a process of its own, `python -m exactarm diagnose
...`, with one thread; what is counted is the whole of it, from the start of Python to the written report,
as the system accounts for it (user and system seconds, largest resident set). With --beside the two
programs take turns on each case; printed are medians and the ratio beside / this.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
import pandas as pd

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind.arm import read_arm  # noqa: E402
from blind.gear_effects import GearEccentricity, TimeDelay  # noqa: E402
from blind.gear_runs import OVERSAMPLING, Runs, sense, to_and_fro  # noqa: E402

DATA = TOP / "python" / "exactarm" / "data"
SERIES = {name: next((DATA / "examples" / "ur10").glob(f"series_{name}.*")) for name in "BC"}
HIDDEN = (
    "backlash joint=2 width_rad=4e-4",
    "joint_compliance joint=3 linear_rad_per_Nm=5e-6",
    "gear_eccentricity joint=1 first_cos_rad=2e-4 first_sin_rad=1e-4",
)
RATE_HZ, RUN_S, RUNS, ENCODERS, ENCODER_NOISE_RAD = 1000.0, 10.0, 6, 2, 1e-5
USUAL, LARGE = ("few", "B", "C", "motion", "corners", "encoders"), ("both", "many")
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def simulated_poses(folder: Path, count: int) -> list[str]:
    words = [
        "simulate",
        "ur10",
        "--count",
        str(count),
        "--deviation",
        "1",
        "--seed",
        "3",
        "--out",
        str(folder),
    ]
    run(TOP, words + [word for effect in HIDDEN for word in ("--effect", effect)])
    return ["ur10", str(folder / "measured.csv")]


def shipped(*series: str) -> list[str]:
    return ["ur10", *(str(SERIES[name]) for name in series)]


def pictures(folder: Path) -> list[str]:
    words = ["--measure", "closures", "--contact", "camera", "--places", "1", "--count", "60"]
    run(TOP, ["simulate", "ur10", *words, "--deviation", "1", "--seed", "3", "--out", str(folder)])
    return ["ur10", str(folder / "closures.csv"), "--fixture", str(folder / "fixture.toml")]


def between_encoders(folder: Path) -> list[str]:
    """Axes 1 and 2 of the Racer wander, motors beside encoders behind the gears; the encoders lag by 2 ms."""
    random, step = np.random.default_rng(4), 1.0 / (RATE_HZ * OVERSAMPLING)
    robot = DATA / "robots" / "racer-7-1.4.toml"
    arm = read_arm(robot)
    middle = 0.5 * (arm.lower + arm.upper) - arm.offset
    parts = []
    for _ in range(RUNS):
        phi = np.tile(middle, (round(RUN_S / step), 1))
        for axis in range(ENCODERS):
            phi[:, axis] += to_and_fro(0.35 * (arm.upper - arm.lower)[axis], RUN_S, step, random)[: len(phi)]
        parts.append(phi)
    phi, time = np.concatenate(parts), np.tile(np.arange(len(parts[0])) * step, RUNS)
    run_of = np.repeat(np.arange(RUNS) + 1, len(parts[0]))
    direction = np.sign(np.concatenate([np.gradient(part, axis=0) for part in parts])) * np.sign(
        arm.motor_per_output
    )
    runs = Runs(
        time,
        phi * arm.motor_per_output,
        direction,
        run_of,
        np.zeros(len(phi), int),
        np.full(len(phi), 25.0),
        tuple(range(ENCODERS)),
    )
    causes = (TimeDelay(size=2e-3), GearEccentricity(joint=1, size=2e-4, phase=1.0))
    reading = sense(arm, runs, causes, np.eye(3))
    picked = reading.picked
    columns = {"time_s": time[picked], "run": run_of[picked]}
    columns |= {f"theta_{i + 1}_rad": runs.theta[picked, i] for i in range(arm.axes)}
    noisy = reading.sensor + random.normal(0.0, ENCODER_NOISE_RAD, reading.sensor.shape)
    columns |= {f"q_{axis + 1}_rad": noisy[:, axis] for axis in range(ENCODERS)}
    folder.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(columns).to_csv(folder / "gear.csv", index=False, float_format="%.12g")
    return [str(robot), str(folder / "gear.csv")]


def words_of(case: str, folder: Path) -> list[str]:
    """ROBOT and FILES of a case, its data written into `folder` where they are simulated."""
    if case in ("few", "many"):
        return simulated_poses(folder, {"few": 140, "many": 12_000}[case])
    if case == "corners":
        return pictures(folder)
    if case == "motion":
        return ["tx40", str(DATA / "examples" / "tx40" / "motion.parquet")]
    return between_encoders(folder) if case == "encoders" else shipped(*{"both": "BC"}.get(case, case))


def run(checkout: Path, words: list[str]) -> dict:
    """One command of the program of a checkout: processor seconds, peak memory in MB."""
    environment = os.environ | ONE_THREAD
    if any((checkout / "python" / "exactarm").glob("_core.*.so")):  # built in place
        environment["PYTHONPATH"] = str(checkout / "python")
    elif checkout != TOP:  # this one may be installed
        raise SystemExit(f"{checkout}: no built extension in python/exactarm")
    process = subprocess.Popen([sys.executable, "-m", "exactarm", *words, "--quiet"], env=environment)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{checkout}: exactarm {' '.join(words)} ended with {process.returncode}")
    return {"processor_seconds": used.ru_utime + used.ru_stime, "peak_MB": used.ru_maxrss / 1024.0}


def measured(case: str, checkouts: list[Path], repeats: int) -> dict:
    """Medians of each checkout, in turn on the same data, and what was said."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, rows = Path(scratch), {str(checkout): [] for checkout in checkouts}
        data, said = words_of(case, folder / "data"), {}
        for _ in range(repeats):
            for checkout in checkouts:
                out = folder / "out"
                rows[str(checkout)].append(
                    run(checkout, ["diagnose", *data, "--threads", "1", "--seed", "1", "--out", str(out)])
                )
                result = json.loads((out / "result.json").read_text())
                said[str(checkout)] = {
                    "verdict": result["verdict"],
                    "rms": result["after"]["validation"]["rms"],
                    "effects": [f"{e['effect']} {e['joint'] or ''}".strip() for e in result["effects"]],
                }
    return {
        name: {key: median(one[key] for one in each) for key in each[0]} | said[name]
        for name, each in rows.items()
    }


def line(case: str, found: dict) -> str:
    """Seconds and memory of this checkout, and of the other with the ratio."""
    this, *others = found.values()
    text = f"{case:9} {this['processor_seconds']:8.1f} s {this['peak_MB']:7.0f} MB"
    for other in others:
        text += f" | beside {other['processor_seconds']:8.1f} s {other['peak_MB']:7.0f} MB"
        text += f" | ratio {other['processor_seconds'] / this['processor_seconds']:.2f}, memory "
        text += f"{other['peak_MB'] / this['peak_MB']:.2f}"
    return text + "".join(
        f" | {len(one['effects'])} effects, held out {one['rms']:.3g}" for one in found.values()
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "cases", metavar="CASE", nargs="*", help=f"{', '.join(USUAL + LARGE)} (default: {', '.join(USUAL)})"
    )
    parser.add_argument("--beside", type=Path, help="another checkout, whose `python` folder is used")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    cases = arguments.cases or list(USUAL)
    if unknown := [case for case in cases if case not in USUAL + LARGE]:
        parser.error(f"unknown case {unknown[0]!r}, expected one of: {', '.join(USUAL + LARGE)}")
    checkouts = [TOP] + ([arguments.beside.resolve()] if arguments.beside else [])
    results = {}
    for case in cases:
        results[case] = measured(case, checkouts, arguments.repeats)
        print(line(case, results[case]), flush=True)
    if arguments.out:
        arguments.out.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
