"""Which share of a command's processor time each of its steps takes, on shipped data: the numbers of
`exactarm/commands/steps.py`.

    python bench/step_times.py [COMMAND ...]
"""

import sys
import tempfile
import time
from pathlib import Path

from exactarm.commands.execute import execute, parse
from exactarm.commands.listing import import_command
from exactarm.examples import example
from exactarm.progress import Progress

UR10, KR300 = ("ur10", "ur10/series_B"), ("kr300", "kr300/run_A", "kr300/run_B")
FIXTURE = Path(example("ball_in_socket/panda_6")).parent / "fixture.toml"
SEATS = ("panda", "ball_in_socket/panda_6", "--fixture", str(FIXTURE))
RUNS = {
    "calibrate": [UR10, SEATS],
    "certify": [UR10],
    "design": [("ur10",)],
    "diagnose": [UR10, ("tx40", "tx40/motion"), (*KR300, "--kind", "gear_run"), SEATS],
    "evaluate": [UR10, SEATS],
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


def main():
    for command in sys.argv[1:] or RUNS:
        for words in RUNS[command]:
            with tempfile.TemporaryDirectory() as out:
                recorder, module = Recorder(), import_command(command)
                execute(module, parse(module, [*words, "--out", out, "--threads", "1"]), recorder)
            seconds = recorder.seconds()
            whole = sum(seconds.values())
            shares = ", ".join(f"{name} {value / whole:.2f}" for name, value in seconds.items())
            print(f"{command} {words[0]} ({whole:.1f} s): {shares}", flush=True)


if __name__ == "__main__":
    main()
