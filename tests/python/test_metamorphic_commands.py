"""What is done to poses and must come back in the answer, for every command that judges them: rows in another
order, a moved tracker, an axis that counts the other way, doubled rows, noise of another size; and files in
other units, for every kind of data."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from exactarm.commands.calibrate import calibrate
from exactarm.commands.certify import certify
from exactarm.commands.check import check
from exactarm.commands.diagnose import diagnose
from exactarm.commands.evaluate import evaluate
from exactarm.commands.plain import plain
from exactarm.data.dataset import Dataset, read_dataset, write_dataset
from exactarm.files.examples import data_path
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.profiles import limit

NOISE_M = 2e-5
POSES, DAY = 60, 10  # of the reference, and of a later day
SAME = 1e-3  # relative, of a robust estimate whose search begins elsewhere
REVERSED = 3  # the axis that counts the other way, from 0


def measured(noise_m: float = NOISE_M) -> Dataset:
    robot, random = load_robot("ur10"), np.random.default_rng(8)
    q = random.uniform(0.4 * limit(robot, "q_min"), 0.4 * limit(robot, "q_max"), (POSES, 6))
    data = measure_poses(VirtualRobot.of(robot), q, Sensors(position_m=noise_m, counts=0), random)
    return replace(data, identification=np.arange(POSES) % 3 > 0)


def again(data: Dataset, noise_m: float) -> Dataset:
    """The first poses on a later day."""
    part = data.select(np.arange(0, DAY))
    moved = np.random.default_rng(5).normal(0.0, noise_m, part.position.shape)
    return replace(part, position=part.position + moved, sources=())


def noise_of(result) -> float:
    return plain(result.json)["after"]["validation"]["rms"]


def answers(robot, data: Dataset, command, noise_m: float = NOISE_M) -> tuple[str, list[float]]:
    """The verdict, and lengths that a command gives of poses."""
    if command is check:
        found = check(robot, data, [again(data, noise_m)])
        return found["verdict"], [found["noise_m"]]
    found = command(robot, data, threads=1)
    if command is evaluate:
        return "", [found["error"]["rms"]]
    return found.json.get("verdict", ""), [noise_of(found)]


@cache
def reference(command, noise_m: float) -> tuple[str, list[float]]:
    """What every law is compared with, once a command."""
    return answers(load_robot("ur10"), measured(noise_m), command, noise_m)


def shuffled(robot, data):
    return robot, data.select(np.random.default_rng(1).permutation(len(data)))


def tracker_moved(robot, data):
    turn = Rotation.random(random_state=9).as_matrix()
    rotation = None if data.rotation is None else turn @ data.rotation
    return robot, replace(data, position=data.position @ turn.T + [3.0, -1.0, 0.5], rotation=rotation)


def axis_reversed(robot, data):
    """The same arm with an axis that counts the other way, and the angles of its controller."""
    joints = list(robot.joints)
    one = joints[REVERSED]
    low, high = one.q_min, one.q_max
    joints[REVERSED] = replace(one, sign=-one.sign, q_offset=-one.q_offset,
                               q_min=None if high is None else -high, q_max=None if low is None else -low)
    signs = np.where(np.arange(6) == REVERSED, -1.0, 1.0)
    changed = {name: values * signs for name, values in data.joints.items()}
    return replace(robot, joints=tuple(joints)), replace(data, joints=changed)


def doubled(robot, data):
    return robot, data.select(np.repeat(np.arange(len(data)), 2))


COMMANDS, LAWS = (evaluate, calibrate, certify, check), (shuffled, tracker_moved, axis_reversed, doubled)
# A day is told by its first poses, and a pose that is there twice measures the noise.
MARKS = {command: pytest.mark.slow if command is calibrate else () for command in COMMANDS}
CASES = [pytest.param(command, law, marks=MARKS[command]) for command in COMMANDS for law in LAWS
         if (command, law) not in ((check, shuffled), (check, doubled))]
CASES += [pytest.param(diagnose, law, marks=pytest.mark.slow) for law in (shuffled, axis_reversed)]


@pytest.mark.slow
@pytest.mark.parametrize("command, law", CASES)
def test_the_answer_follows(command, law):
    one, other = reference(command, NOISE_M), answers(*law(load_robot("ur10"), measured()), command)
    few = 0.1 if law is doubled else SAME  # twice the rows weigh the priors less
    assert other[0] == one[0] and other[1] == pytest.approx(one[1], rel=few)


@pytest.mark.parametrize("command", [pytest.param(each, marks=MARKS[each]) for each in COMMANDS])
@pytest.mark.slow
def test_errors_grow_with_the_noise(command):
    one, three = (reference(command, noise) for noise in (NOISE_M, 3.0 * NOISE_M))
    assert three[0] == one[0] and three[1] == pytest.approx([3.0 * value for value in one[1]], rel=0.1)


FILES = {"poses": ("ur10", "ur10/series_B.csv"), "motion": ("tx40", "tx40/motion.parquet"),
         "gear_run": ("kr300", "kr300/run_A.parquet")}
UNITS = {"_rad": ("_deg", 180.0 / np.pi), "_m": ("_mm", 1e3), "_rad_s": ("_deg_s", 180.0 / np.pi)}


@pytest.mark.parametrize("kind", ["poses", pytest.param("motion", marks=pytest.mark.slow), "gear_run"])
def test_units_of_a_file_mean_nothing_to_any_command(kind, tmp_path):
    name, file = FILES[kind]
    robot = load_robot(name)
    data = read_dataset(data_path(file), robot, kind)
    data = data.select(np.arange(0, len(data), 10))
    write_dataset(tmp_path / "si.csv", data, robot)
    table, changed = pd.read_csv(tmp_path / "si.csv"), {}
    for column, values in table.items():
        unit = next((unit for unit in sorted(UNITS, key=len, reverse=True) if column.endswith(unit)), None)
        other, factor = UNITS.get(unit, ("", 1.0))
        changed[column.removesuffix(unit or "") + (other or "")] = values * factor
    assert list(changed) != list(table)
    pd.DataFrame(changed).to_csv(tmp_path / "shop.csv", index=False)
    one, two = (read_dataset(tmp_path / each, robot, kind) for each in ("si.csv", "shop.csv"))
    for quantity, values in one.joints.items():
        assert two.joints[quantity] == pytest.approx(values, rel=1e-12, abs=1e-12, nan_ok=True)
    for field in ("position", "rotation", "gyro", "time", "session", "run"):
        if getattr(one, field) is not None:
            assert getattr(two, field) == pytest.approx(getattr(one, field), rel=1e-12, abs=1e-12)
