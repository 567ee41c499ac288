"""One trial: a spoiled file given to a reader or to a command, and what must hold then.

    readers    the file is read, or refused by InputError, in one line that names it
    words      a command line with words left out, exchanged, or options with hostile values
    commands   exit 0 with a result that is finite and that our own readers accept, or exit 1 or 2 with one
               line on stderr that is no "fault in exactarm", names a file or an option (2), and leaves no
                   result
What holds for commands holds for words. Within bounds of time; a trial is told by its seed alone.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import os
import shutil
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from exactarm import cli
from exactarm.commands.about import about_of
from exactarm.commands.accept import accept
from exactarm.commands.batch import read_jobs
from exactarm.commands.design_for import read_experiments
from exactarm.commands.execute import parser_of
from exactarm.commands.listing import import_command
from exactarm.compensate.formats import jobs
from exactarm.compensate.setting import Setting
from exactarm.data.dataset import Dataset, read_dataset, read_joint_log, read_planned_poses
from exactarm.data.fixture import load_fixture
from exactarm.data.point_text import read_points
from exactarm.data.session_table import with_sessions
from exactarm.errors import InputError
from exactarm.plan.path_file import load_path
from exactarm.robot_file import load_robot, read_robot
from robustness.mutations import mildly_spoiled, spoiled, spoiled_words
from robustness.samples import samples
from robustness.short_runs import RUNS
from robustness.virtual_samples import with_pulses

MOST_SECONDS = 60.0  # of the processor, of a trial; the slowest valid one takes fifteen
PATIENCE_S = 600.0  # by the clock, of a trial that waits for something
SHARE_OF_COMMANDS = 0.1
SHARE_OF_WORDS = 0.5  # of the trials of commands
SHARE_OF_MILD = 0.6  # of the trials of commands on files: of the others nearly all are refused
SLOW = ("demo", "loop")  # minutes on spoiled input are no fault of theirs


shipped = functools.cache(load_robot)  # read once, not for every spoiled file


def _program(name: str) -> Callable[[Path], object]:
    robot = shipped("ur10")
    pulses = with_pulses(shipped("racer-7-1.4")) if name.startswith("measure") else None
    return lambda path: [job.read(Setting(pulses or robot)) for job in jobs([path])]


def _in_sessions(path: Path) -> object:
    rows = Dataset.of_arrays("poses", {"q": np.zeros((4, 6))}, session=np.array([1, 1, 2, 2]))
    return with_sessions(rows, path)


PROGRAMS = ("part.script", "measure.mod", "measure.ls", "measure.jbi", "trajectory.yaml", "targets.csv")
READERS: dict[str, Callable[[Path], object]] = {
    "poses.csv": lambda path: read_dataset(path, shipped("ur10")),
    "poses.parquet": lambda path: read_dataset(path, shipped("ur10")),
    "motion.csv": lambda path: read_dataset(path, shipped("tx40")),
    "runs.csv": lambda path: read_dataset(path, shipped("kr300")),
    "closures.csv": lambda path: read_dataset(path, shipped("ur10")),
    "trajectory.csv": lambda path: read_planned_poses(path, shipped("racer-7-1.4")),
    "racer.toml": load_robot,
    "ur10.toml": load_robot,
    "ur10.urdf": load_robot,
    "path.toml": load_path,
    "line.toml": load_path,
    "fixture.toml": load_fixture,
    "draft.toml": accept,
    "part.src": lambda path: [job.read(Setting(shipped("ur10")))
                              for job in jobs([path, path.with_suffix(".dat")])],
    "camera.csv": lambda path: read_dataset(path, shipped("ur10")),
    "camera.toml": load_fixture,
    "sessions.csv": _in_sessions,
    "experiments.json": lambda path: read_experiments(path, shipped("ur10")),
    "about.toml": lambda path: about_of(path, {}),
    "calibration.conf": lambda path: load_robot(f"{path}#ur10"),
    "points.txt": lambda path: read_points(path, "mm"),
    "log.csv": lambda path: read_joint_log(path, shipped("ur10"), text=("name", "group")),
    "manifest.csv": read_jobs,
    **{name: _program(name) for name in PROGRAMS},
}
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("evaluate", "ur10", "*poses.csv"), ("calibrate", "ur10", "*poses.csv"),
    ("evaluate", "*ur10.toml", "poses.csv"),
    ("calibrate", "*ur10.urdf", "poses.csv"), ("identifiable", "*ur10.toml", "poses.csv"),
    ("identify", "tx40", "*motion.csv"),
    ("gear", "kr300", "*runs.csv", "--kind", "gear_run"),
    ("evaluate", "kr300", "*runs.csv", "--kind", "gear_run"),
    ("calibrate", "ur10", "*closures.csv"),
    ("calibrate", "ur10", "closures.csv", "--fixture", "*fixture.toml"),
    ("plan", "*racer.toml", "path.toml"), ("plan", "racer-7-1.4", "*path.toml"),
    ("simulate", "*racer.toml", "--count", "8"),
    ("simulate", "racer-7-1.4", "*trajectory.csv", "--measure", "poses"),
    ("compensate", "*ur10.toml", "part.script"),
    ("compensate", "ur10", "*part.script"),
    ("corners", "ur10", "*joints.csv", "board.png", "--fixture", "board.toml"),
    ("corners", "ur10", "joints.csv", "*board.png", "--fixture", "*board.toml"),
    ("merge", "ur10", "*log.csv", "points.txt"), ("merge", "ur10", "log.csv", "*points.txt", "--unit", "mm"),
    ("accept", "*draft.toml"), ("batch", "*manifest.csv"), ("batch", "manifest.csv", "*poses.csv"),
    ("certify", "ur10", "*poses.csv"), ("certify", "*ur10.toml", "poses.csv"),
    ("check", "ur10", "*poses.csv", "day.csv"), ("check", "ur10", "poses.csv", "*day.csv"),
    ("design", "*racer.toml", "--count", "12", "--validation", "4"),
    ("diagnose", "ur10", "*poses.csv"), ("export", "*ur10.toml", "--format", "urdf"),
    ("calibrate", "ur10", "*camera.csv", "--fixture", "camera.toml"),
    ("calibrate", "ur10", "camera.csv", "--fixture", "*camera.toml"),
    ("evaluate", "ur10", "*camera.csv", "--fixture", "*camera.toml"),
    ("calibrate", "ur10", "two.csv", "--sessions", "*sessions.csv"),
    ("calibrate", "ur10", "*two.csv", "--sessions", "sessions.csv"),
    ("evaluate", "ur10", "two.csv", "--at", "*points.csv"),
    ("compensate", "ur10.toml", "part.script", "--frames", "*points.csv"),
    ("compensate", "*ur10.toml", "targets.csv", "--frames", "identified"),
    ("compensate", "ur10.toml", "*targets.csv"), ("compensate", "ur10.toml", "*trajectory.yaml"),
    ("design", "ur10", "--for", "*experiments.json", "--program", "urscript"),
    ("certify", "ur10", "two.csv", "--about", "*about.toml"),
    ("export", "*ur10.urdf", "--format", "mjcf"),
    ("study", "*racer.toml", "path.toml", "--nu", "1e-12,1e-9"),
)


@dataclass(frozen=True)
class Trial:
    """seed and what it stood for; failure: empty where everything held; code: of a command, None of a
    reader."""

    seed: int
    what: str
    failure: str
    seconds: float
    code: int | None = None


class _TooLong(BaseException):
    pass


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise _TooLong

    clocks = {signal.ITIMER_PROF: (signal.SIGPROF, seconds), signal.ITIMER_REAL: (signal.SIGALRM, PATIENCE_S)}
    earlier = {number: signal.signal(number, stop) for number, _ in clocks.values()}
    for clock, (_, most) in clocks.items():
        signal.setitimer(clock, most)
    try:
        yield
    finally:
        for clock, (number, _) in clocks.items():
            signal.setitimer(clock, 0.0)
            signal.signal(number, earlier[number])


def run_trial(seed: int, folder: Path, valid: dict[str, bytes] | None = None,
              commands: float = SHARE_OF_COMMANDS) -> Trial:
    """The trial of one seed in `folder`, which is emptied first."""
    random = np.random.default_rng(seed)
    valid = samples() if valid is None else valid
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    started = time.process_time()
    as_command = random.random() < commands
    what, failure, code = "", "", None
    try:
        with _limited(MOST_SECONDS), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # as the command itself does
            if as_command and random.random() < SHARE_OF_WORDS:
                what, code, failure = _words(folder, valid, random)
            elif as_command:
                words = COMMANDS[random.integers(len(COMMANDS))]
                what = " ".join(words)
                code, failure = _command(words, folder, valid, random)
            else:
                what = list(READERS)[random.integers(len(READERS))]
                failure = _reader(what, folder, valid, random)
    except _TooLong:
        failure = f"took more than {MOST_SECONDS:.0f} s of a processor, or {PATIENCE_S:.0f} s"
    return Trial(seed, what, failure, time.process_time() - started, code)


def _reader(name: str, folder: Path, valid: dict[str, bytes], random: np.random.Generator) -> str:
    path = folder / name
    os.environ["EXACTARM_EFFECTS"] = str(folder / "effects")
    if name == "part.src":
        (folder / "part.dat").write_bytes(spoiled(valid["part.dat"], random))
    path.write_bytes(spoiled(valid[name], random))
    try:
        READERS[name](path)
    except InputError as error:
        line = str(error)
        return (
            "" if "\n" not in line and str(folder) in line
            else f"a refusal that names no file, or in several lines: {line!r}"
        )
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def _command(words: tuple[str, ...], folder: Path, valid: dict[str, bytes],
             random: np.random.Generator) -> tuple[int, str]:
    line, change = [], mildly_spoiled if random.random() < SHARE_OF_MILD else spoiled
    for word in words:
        name = word.lstrip("*")
        if name in valid:
            (folder / name).write_bytes(change(valid[name], random) if word != name else valid[name])
            name = str(folder / name)
        line.append(name)
    return _run(line, folder)


def _words(folder: Path, valid: dict[str, bytes],
           random: np.random.Generator) -> tuple[str, int, str]:
    """A spoiled command line of any command on valid files."""
    for name, content in valid.items():
        (folder / name).write_bytes(content)
    names = sorted(set(RUNS) - set(SLOW))
    command = names[random.integers(len(names))]
    words = spoiled_words(RUNS[command], parser_of(import_command(command)), random)
    line = [command, *(str(folder / word) if word in valid else word for word in words)]
    return (f"words {line}", *_run(line, folder))


def _run(line: list[str], folder: Path) -> tuple[int, str]:
    out = folder / "out"
    os.environ["EXACTARM_EFFECTS"] = str(folder / "effects")
    told, errors = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8")
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(errors):
        code = cli.main([*line, "--out", str(out), "--threads", "1", "--quiet"])
    errors.flush()
    said = errors.buffer.getvalue().decode()
    return code, _of_done(out, said) if code == 0 else _of_failed(code, out, said, line)


def _of_failed(code: int, out: Path, said: str, line: list[str]) -> str:
    if code not in (1, 2) or said.count("\n") != 1 or not said.startswith("exactarm: error: "):
        return f"exit {code} with {said!r}"
    if "a fault in exactarm" in said:
        return said.strip()
    if code == 2 and not _named(said.removeprefix("exactarm: error: "), line):
        return f"exit 2 names no file: {said.strip()}"
    if not (out / "result.json").exists():
        return ""
    jobs = json.loads((out / "result.json").read_text()).get("jobs", [])
    failed = [job["why"] for job in jobs if job["state"] == "failed"]
    if code != 1 or not failed:  # only a batch tells of what failed by a result
        return "a result beside an error"
    return next((why for why in failed if why.startswith("unexpected")), "")


def _named(said: str, line: list[str]) -> bool:
    """Whether a refusal says what it is about: a word of the command line in front, or an option."""
    options = ("argument ", "unrecognized arguments", "the following arguments")
    return said.startswith(options) or "--" in said or any(
        said.startswith((f"{word}: ", f"{word}, ", f"{Path(word).parent}/")) for word in line if len(word) > 0
    )


def _of_done(out: Path, said: str) -> str:
    if said:
        return f"exit 0 with {said!r} on stderr"
    result = json.loads((out / "result.json").read_text())
    if bad := [name for name, value in _numbers(result) if not math.isfinite(value)]:
        return f"result.json holds what is no number: {bad[0]}"
    for summary in ("before", "after"):
        if isinstance(result.get(summary), dict):
            rms = result[summary].get("identification", {}).get("rms", 0.0)
            if rms is None:
                return f"exit 0 without a number for the error {summary}"
    if (out / "robot.toml").exists():
        read_robot(out / "robot.toml")
    return ""


def _numbers(value: object, name: str = "") -> Iterator[tuple[str, float]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(item, f"{name}.{key}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{name}[{index}]")
    elif isinstance(value, float):
        yield name, value
