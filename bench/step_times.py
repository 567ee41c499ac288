"""Which share of a command's processor time each of its steps takes, on shipped data (`check`: on simulated
days): the numbers of `exactarm/commands/steps.py`.

    python bench/step_times.py [COMMAND ...]
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas

import exactarm as ea
from exactarm.commands.execute import execute, parse
from exactarm.commands.listing import import_command
from exactarm.files.examples import example
from exactarm.progress import Progress

UR10, KR300 = ("ur10", "ur10/series_B"), ("kr300", "kr300/run_A", "kr300/run_B")
THREADS = {"check": ()}  # it has no such option
FIXTURE = Path(example("ball_in_socket/panda_6")).parent / "fixture.toml"
SEATS = ("panda", "ball_in_socket/panda_6", "--fixture", str(FIXTURE))
TARGETS, DAYS_BEFORE, DAYS = 2000, 10, 100  # of a program; of a check
RUNS = {
    "calibrate": [UR10, SEATS],
    "certify": [UR10],
    "check": [("racer-7-1.4", "before.csv", "after.csv")],
    "compensate": [("calibrated/robot.toml", "targets.csv", "--points", "calculated", "--keep-refused")],
    "design": [("ur10",)],
    "diagnose": [UR10, ("tx40", "tx40/motion"), (*KR300, "--kind", "gear_run"), SEATS],
    "evaluate": [UR10, SEATS, ("calibrated/robot.toml", UR10[1], "--at", "targets.csv")],
    "gear": [KR300],
    "identify": [("tx40", "tx40/motion")],
    "loop": [("racer-7-1.4", "--effect", "backlash joint=2 width_rad=4e-4")],
    "plan": [("racer-7-1.4", "line"), ("racer-7-1.4", "spiral")],
}


class Recorder(Progress):
    """Says nothing, and keeps the processor time of every step of the plan."""

    def __init__(self):
        super().__init__(None)
        self.began = []

    def stage(self, name, total=None):
        super().stage(name, total)
        if name in self._steps:
            self.began.append((name, time.process_time()))

    def seconds(self):
        ends = [at for _, at in self.began[1:]] + [time.process_time()]
        found = {}
        for (name, began), end in zip(self.began, ends):
            found[name] = found.get(name, 0.0) + end - began
        return found


def prepare(folder):
    """The files of `check`, `compensate` and `evaluate --at`, made from shipped robots and data."""
    result = ea.calibrate(*UR10, threads=1)
    result.save(folder / "calibrated")
    poses, days, random = folder / "poses.csv", [], np.random.default_rng(0)
    for path, count in ((poses, 5), (folder / "targets.csv", TARGETS)):  # away from singular poses
        table = {f"q_{i}_deg": random.uniform(20.0, 70.0, count) for i in range(1, 7)}
        pandas.DataFrame(table).to_csv(path, index=False)
    for day in range(DAYS_BEFORE + DAYS):
        made = ea.simulate("racer-7-1.4", poses, frames="declared", seed=day)  # noise of its own
        made.save(folder / "day")
        days.append(pandas.read_csv(folder / "day/measured.csv").assign(day=day))
    pandas.concat(days[:DAYS_BEFORE]).to_csv(folder / "before.csv", index=False)
    pandas.concat(days[DAYS_BEFORE:]).to_csv(folder / "after.csv", index=False)


def main():
    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        measure(Path(folder), sys.argv[1:] or RUNS)


def measure(folder, commands):
    made = lambda word: str(folder / word) if (folder / word).exists() else word
    for command in commands:
        for given in RUNS[command]:
            words = [made(word) for word in given]
            with tempfile.TemporaryDirectory() as out:
                recorder, module = Recorder(), import_command(command)
                one = THREADS.get(command, ("--threads", "1"))
                execute(module, parse(module, [*words, "--out", out, *one]), recorder)
            seconds = recorder.seconds()
            whole = sum(seconds.values())
            shares = ", ".join(f"{name} {value / whole:.2f}" for name, value in seconds.items())
            print(f"{command} {given[0]} ({whole:.1f} s): {shares}", flush=True)


if __name__ == "__main__":
    main()
