"""What long work says of itself: step of how many, time left, lines in a pipe; commands say their steps."""

import re

import pytest

from exactarm import example
from exactarm.commands.execute import execute, parse
from exactarm.commands.listing import import_command
from exactarm.commands.steps import READING, STEPS, steps_of_kinds
from exactarm.progress import LEAST_ELAPSED_S, Progress

UR10 = ("ur10", str(example("ur10/series_B")))
KR300 = ("kr300", str(example("kr300/run_A")), str(example("kr300/run_B")))


class Screen:
    def __init__(self, terminal):
        self.terminal, self.text = terminal, ""

    def isatty(self):
        return self.terminal

    def write(self, text):
        self.text += text

    def flush(self):
        pass


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


class Recorder(Progress):
    """Keeps what was announced."""

    def __init__(self):
        super().__init__(None)
        self.planned, self.begun = [], []

    def plan(self, steps, long=False):
        super().plan(steps, long)
        self.planned = list(self._steps)

    def stage(self, name, total=None):
        super().stage(name, total)
        self.begun.append(name)


def test_a_terminal_shows_which_step_of_how_many_and_the_time_left():
    screen, clock = Screen(True), Clock()
    progress = Progress(screen, clock)
    progress.plan({"reading": 0.25, "fitting": 0.75})
    progress.stage("reading")
    clock.now = 20.0
    progress.stage("fitting")
    progress.stage("round 2")
    assert progress.seconds_left == pytest.approx(60.0)
    progress.close()
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.text)
    assert "step 2 of 2: fitting, round 2" in plain and re.search(r"about (1:00|0:59) left", plain)


def test_counts_inside_a_step_move_the_time_left():
    clock = Clock()
    progress = Progress(None, clock)
    progress.plan(["playing"])
    progress.stage("playing", total=4)
    clock.now = 0.5 * LEAST_ELAPSED_S
    progress.step(2)
    assert progress.seconds_left is None  # short work is over before one has read it
    clock.now = 10.0
    assert progress.share == 0.5 and progress.seconds_left == pytest.approx(10.0)
    progress.step(2)
    assert progress.seconds_left == 0.0


@pytest.mark.parametrize("long, lines", [
    (True, "step 1 of 3: reading\nstep 3 of 3: drawing\n"),  # the second is left out
    (False, ""),
])
def test_a_pipe_hears_of_every_step_of_long_work_and_of_none_of_short_work(long, lines):
    screen = Screen(False)
    progress = Progress(screen, Clock())
    progress.ends_with("drawing")
    progress.plan(["reading", "fitting"], long=long)
    for name in ("reading", "a detail", "drawing"):
        progress.stage(name)
    progress.close()
    assert screen.text == lines


def test_progress_updates_one_line_on_a_terminal_and_clears_it():
    screen = Screen(True)
    progress = Progress(screen)
    progress.part("step 3 of 9")
    progress.stage("fitting", total=2)
    progress.step(note="backlash_2 [bold]")
    progress.close()
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.text)
    assert "step 3 of 9, fitting: backlash_2 [bold]" in plain and "1/2" in plain and "0:00:0" in plain
    # the line is cleared, the cursor is back
    assert screen.text.rstrip("\n").endswith("\x1b[2K") and "\x1b[?25h" in screen.text


def test_progress_is_rare_plain_lines_in_a_pipe():
    screen, seconds = Screen(False), (0.5 * count for count in range(200))
    progress = Progress(screen, clock=lambda: next(seconds))
    progress.stage("fitting", total=20)
    for _ in range(20):
        progress.step()
    progress.close()
    assert screen.text == "fitting 6/20\nfitting 12/20\nfitting 18/20\n"  # every 3 s from the first stage on


def test_a_part_of_a_longer_work_is_one_line_in_a_pipe():
    screen = Screen(False)
    progress = Progress(screen, Clock())
    progress.part("step 2 of 9, gears")
    progress.plan(["reading", "fitting"], long=True)
    progress.stage("reading")
    assert screen.text == "step 2 of 9, gears\n"


def test_a_file_of_two_kinds_has_the_steps_of_both():
    names = list(steps_of_kinds(("gear_run", "motion")))
    assert len(names) == 2 * len(STEPS["diagnose"]) - 1 and names[0] == READING
    assert names[1].startswith("gear run, ") and names[-1].startswith("motion, ")


@pytest.mark.slow
@pytest.mark.parametrize("command, words", [
    ("calibrate", (*UR10, "--compliance", "none")),
    ("plan", ("racer-7-1.4", "line", "--rate", "100")),
    pytest.param("certify", UR10, marks=pytest.mark.slow),
    pytest.param("design", ("ur10", "--count", "20"), marks=pytest.mark.slow),
    pytest.param("diagnose", (*KR300, "--kind", "gear_run"), marks=pytest.mark.slow),
    pytest.param("evaluate", UR10, marks=pytest.mark.slow),
    pytest.param("gear", KR300, marks=pytest.mark.slow),
    pytest.param("identify", ("tx40", str(example("tx40/motion"))), marks=pytest.mark.slow),
    pytest.param("study", ("racer-7-1.4", "line", "--nu", "1e-14,1e-9", "--rate", "99"),
                 marks=pytest.mark.slow),
])
def test_a_command_announces_its_steps_in_their_order(command, words, tmp_path):
    progress, module = Recorder(), import_command(command)
    execute(module, parse(module, [*words, "--out", str(tmp_path / "out"), "--threads", "1"]), progress)
    steps = [name for name in progress.begun if name in progress.planned]
    assert progress.planned and steps == sorted(steps, key=progress.planned.index)
    assert steps[-1] == progress.planned[-1] and len(steps) > len(progress.planned) / 2
    assert set(progress.planned) <= {*STEPS[command], steps[-1]}


@pytest.mark.parametrize("terminal", [False, True])
def test_what_the_work_will_take_is_said_at_once_and_stays(terminal):
    screen = Screen(terminal)
    progress = Progress(screen, Clock())
    progress.plan({"one": 1.0}, long=True)
    progress.stage("one")
    progress.announce("5,000 of 100,000 rows: about 4 min")
    progress.close()
    assert "5,000 of 100,000 rows: about 4 min\n" in screen.text
