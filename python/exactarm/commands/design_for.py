"""What `exactarm design --for RESULT.json` says: the experiment that a diagnosis has planned, as poses to
drive."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.commands.result import CommandResult
from exactarm.compensate.measuring_program import measuring_program, stops_of
from exactarm.data.columns import MOST, PAYLOAD
from exactarm.design.joint_limits import violations
from exactarm.design.pose_space import PoseSpace
from exactarm.diagnose.next_poses import MINUTES, Experiment
from exactarm.errors import InputError
from exactarm.files.file_bytes import path_of
from exactarm.files.toml_file import is_number
from exactarm.report import Report, Table, Text
from exactarm.robot.robot import Robot
from exactarm.robot_file import shipped_robots

_EXPECTED = "expected result.json of `exactarm diagnose`"
_LONGEST_NAME = 60  # of a robot, in a message
_MOST_BITS = 64.0  # of what is open between causes: the library has some hundred of them
_KEYS = ("poses_rad", "payload_kg", "bits", "open_bits", "between")


def experiment_json(experiment: Experiment) -> dict:
    """An experiment as it stands in result.json."""
    return {"experiment": experiment.title, "between": experiment.between,
            "poses_rad": np.round(experiment.q, 9).tolist(),
            "payload_kg": experiment.payload_kg, "bits": experiment.bits, "open_bits": experiment.open_bits,
            "minutes": experiment.minutes(), "bits_per_minute": experiment.bits_per_minute()}


def experiments_table(experiments: tuple[Experiment, ...], cost: Mapping[str, float] = MINUTES) -> Table:
    rows = tuple((e.title, str(len(e.q)), f"{e.bits:.2f} of {e.open_bits:.2f}", f"{e.minutes(cost):.1f}",
                  f"{e.bits_per_minute(cost):.2f}")
                 for e in experiments)
    return Table("Experiments that would tell", ("experiment", "poses", "bits", "minutes", "bits per minute"),
                 rows,
                 f"Is it {experiments[0].between}? Each pose is approached from both directions. Bits: what "
                 "the experiment is expected to tell of what is not known about the cause. Minutes: "
                 + ", ".join(f"{minutes:g} {_COSTS[name]}" for name, minutes in cost.items())
                 + " (assumed; `design --for --minutes` changes them).")


_COSTS = {"visit": "to drive to a pose and measure", "payload": "to mount a payload"}


def _told(path: Path) -> dict[str, Any]:
    """A result.json. Raises InputError where it is none."""
    path_of(path, _EXPECTED.removeprefix("expected "))
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise InputError(f"is nested too deeply; {_EXPECTED}", file=str(path)) from None
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read ({error}); {_EXPECTED}", file=str(path)) from None
    if not isinstance(told, dict):
        raise InputError(f"cannot be read (it holds no table); {_EXPECTED}", file=str(path))
    return told


def other_robot(path: Path, robot: Robot) -> tuple[str, ...]:
    """A line where the diagnosis of that result.json is of a robot with another name; older files tell that
    of a shipped robot alone."""
    told = _told(path)
    name = told.get("robot_name", told.get("robot") if told.get("robot") in shipped_robots() else None)
    if not isinstance(name, str) or name == robot.name:
        return ()
    return (f"{path.name} is the diagnosis of {_short(name)}, and these poses are for {_short(robot.name)}: "
            "is it the same arm?",)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}..."


def read_experiments(path: Path, robot: Robot) -> tuple[Experiment, ...]:
    """The experiments of a diagnosis' result.json. Raises InputError where none are for this robot."""
    entries = _told(path).get("experiments")
    if not isinstance(entries, list):
        raise InputError(f"no experiments; {_EXPECTED}", file=str(path))
    if not entries:
        raise InputError("no causes are left that poses could tell apart: nothing to design", file=str(path))
    found = []
    for number, entry in enumerate(entries, start=1):
        try:
            q, *rest = (entry[key] for key in _KEYS)
            experiment = Experiment(np.array(q, float), *rest)
            fits = _fits(experiment, robot)
        except (KeyError, TypeError, ValueError, OverflowError):
            fits = False
        if not fits:
            raise InputError(f"experiment {number} does not fit a robot of {robot.axes} axes; {_EXPECTED}",
                             file=str(path))
        _require_in_limits(experiment, number, robot, path)
        found.append(experiment)
    return tuple(found)


def _fits(experiment: Experiment, robot: Robot) -> bool:
    """Whether it has the shapes and sizes of an experiment with this robot."""
    q, load = experiment.q, experiment.payload_kg
    return (q.ndim == 2 and q.shape[1] == robot.axes and len(q) > 0 and bool(np.all(np.isfinite(q)))
            and all(is_number(value) for value in (load, experiment.bits, experiment.open_bits))
            and 0.0 <= load <= MOST[PAYLOAD] and isinstance(experiment.between, str)
            and 0.0 <= experiment.bits <= _MOST_BITS and 0.0 <= experiment.open_bits <= _MOST_BITS)


def _require_in_limits(experiment: Experiment, number: int, robot: Robot, path: Path) -> None:
    """The poses are to be driven: each axis between its limits, where the robot file has them."""
    for row, words in violations(robot, experiment.q):
        raise InputError(f"experiment {number}, pose {row + 1}: {words}, the limits of {robot.name}",
                         file=str(path))


def minutes_of(words: list[str]) -> dict[str, float]:
    """What visits and payloads cost, by `--minutes NAME=MINUTES`."""
    cost = dict(MINUTES)
    for word in words:
        name, _, text = word.partition("=")
        try:
            minutes = float(text)
        except ValueError:
            minutes = float("nan")
        if name not in cost or not minutes >= 0.0 or (name == "visit" and minutes == 0.0):
            raise InputError(f"--minutes {word}: expected {' or '.join(f'{each}=MINUTES' for each in cost)}")
        cost[name] = minutes
    return cost


def designed_for(robot: Robot, path: Path, cost: Mapping[str, float],
                 program: str | None = None) -> CommandResult:
    """The experiment with the most bits a minute as `poses.csv`: every pose twice, from below and above."""
    experiments = sorted(read_experiments(path, robot), key=lambda e: (not e.parts, -e.bits_per_minute(cost)))
    best = experiments[0]
    both = np.repeat(best.q, 2, axis=0)
    approach = np.tile([[-1], [1]], (len(best.q), robot.axes))
    carried = {PAYLOAD: np.full(len(both), best.payload_kg)} if best.payload_kg else {}
    texts = {}
    if program is not None:
        space = PoseSpace.of(robot)
        texts = dict([measuring_program(robot, program, stops_of(both, approach, space.lower, space.upper))])
    load = f" with {best.payload_kg:g} kg at the flange" if best.payload_kg else ""
    verdict = (f"{len(best.q)} poses{load}, each approached from both directions: in some "
               f"{best.minutes(cost):.0f} minutes they tell "
               f"{best.bits:.2f} of {best.open_bits:.2f} bits about whether it is {best.between}.")
    how = ("Drive to each pose in such a way that every axis moves upwards (approach 1) or downwards (-1) at "
           "the end, add the measured positions to poses.csv as x_m, y_m, z_m, and diagnose it together with "
           "the first file. Both need the same columns: give the first one approach_i (0 where it is not "
           "known)"
           + (" and payload_kg (0)" if best.payload_kg else "") + ". A file is a set-up of its own, whose "
           "frame takes four poses and more: where neither tracker nor arm has moved since, give both files "
           "a column session with the same word.",)
    return CommandResult(
        json={"experiments": [experiment_json(e) for e in experiments], "minutes": dict(cost),
              "poses": len(both)},
        report=Report(f"The next experiment: {robot.name}", verdict,
                      (experiments_table(tuple(experiments), cost), Text("How", how)),
                      "good" if best.parts else "caution"),
        tables={"poses.csv": pose_columns(robot, both, approach) | carried},
        texts=texts).warned(other_robot(path, robot))


def pose_columns(robot: Robot, q: np.ndarray, approach: np.ndarray | None) -> dict[str, np.ndarray]:
    """The angles to command (N, n), the motor angles where a gear is declared, rounded to what no encoder
    resolves, and from which side each axis comes where that is planned."""
    columns, reported = {}, robot.controller.reported(q)
    for i, joint in enumerate(robot.joints):
        columns[f"q_{i + 1}_{'m' if joint.type == 'prismatic' else 'rad'}"] = np.round(reported[:, i], 9)
    theta = (q - robot.controller_offsets) * robot.controller_ratios
    for i, joint in enumerate(robot.joints):
        if joint.has_gear:
            columns[f"theta_{i + 1}_rad"] = np.round(theta[:, i], 9)
    return columns | ({} if approach is None
                      else {f"approach_{i + 1}": approach[:, i] for i in range(robot.axes)})
