"""Robot and data that do not belong together are refused, and the unit that was meant is named."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import cli
from exactarm.data.dataset import write_dataset
from exactarm.errors import InputError
from exactarm.first_aid.first_aid import with_cause
from exactarm.identify.calibrate import calibrate
from exactarm.identify.evaluate import evaluate_poses
from exactarm.identify.match import WORST_SHARE, Mismatch
from exactarm.robot.writer import write_robot
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis


@pytest.fixture(scope="module")
def arm():
    return six_axis(springs=True, placed=False)


def data_of(robot, scale=1.0, count=30, seed=30):
    rng = np.random.default_rng(seed)
    return measured(robot, [true_robot(robot, rng, scale)], [joints_in_limits(robot, count, rng)], 1e-4, rng)


def scaled(data, length=1.0, angle=1.0):
    return replace(data, position=length * data.position, joints={"theta": angle * data.joints["theta"]})


def refusal_of(work, *given):
    """The line of the refusal, with its question."""
    with pytest.raises(Mismatch) as raised:
        work(*given)
    return str(with_cause(raised.value))


def test_reach_is_that_of_the_stretched_arm(arm):
    assert arm.reach == pytest.approx(np.hypot(0.43, 0.15) + 0.59 + 0.13 + 0.684 + 0.1)


@pytest.mark.parametrize("factors, words", [
    ({"length": 1e3}, "millimetres labelled as metres"),
    ({"length": 1e-3}, "metres labelled as millimetres"),
    ({"angle": 180.0 / np.pi}, "degrees labelled as radians"),
    ({"angle": np.pi / 180.0}, "radians labelled as degrees"),
], ids=lambda value: value if isinstance(value, str) else "")
@pytest.mark.slow
def test_wrong_unit_is_named(arm, factors, words):
    line = refusal_of(evaluate_poses, arm, scaled(data_of(arm), **factors))
    assert "robot and data do not match: " in line and words in line


@pytest.mark.parametrize("other", ["ur10", "tx40", "kr300"])
def test_another_robot_is_refused(arm, other):
    data = data_of(arm)
    reported = data.joints["theta"] / arm.controller_ratios + arm.controller_offsets
    data = replace(data, joints={"q": reported})
    robot = load_robot(other)
    if not robot.has_geometry:
        with pytest.raises(InputError, match="expected a declared geometry"):
            calibrate(robot, data)
        return
    line = refusal_of(calibrate, robot, data)
    assert "robot and data do not match: " in line and "is it data of racer-7-1.4?" in line


def test_exchanged_axes_are_refused(arm):
    data = data_of(arm)
    swapped = data.joints["theta"][:, [0, 2, 1, 3, 4, 5]]
    line = refusal_of(calibrate, arm, replace(data, joints={"theta": swapped}))
    assert "is it axes 2 and 3 exchanged?" in line


@pytest.mark.slow
def test_badly_mastered_robot_passes(arm):
    """Zeros off by half a degree on every axis and lengths by millimetres: bad, but this robot."""
    data = data_of(arm, scale=9.0, count=60)
    error = evaluate_poses(arm, data).overall.rms
    assert 0.2 * WORST_SHARE * arm.reach < error < WORST_SHARE * arm.reach
    assert calibrate(arm, data).after["validation"].rms < 1e-3


def test_session_at_fault_is_named(arm):
    rng = np.random.default_rng(31)
    truth = true_robot(arm, rng)
    data = measured(arm, [truth, truth], [joints_in_limits(arm, 30, rng) for _ in range(2)], 1e-4, rng)
    position = np.where((data.session == 2)[:, None], 1e3, 1.0) * data.position
    line = refusal_of(calibrate, arm, replace(data, position=position))
    assert "base and tool of session 2" in line and "millimetres labelled as metres" in line


@pytest.mark.parametrize("command", ["calibrate", "evaluate", "identifiable", "diagnose"])
@pytest.mark.slow
def test_every_command_on_poses_asks_first(arm, tmp_path, capsys, command):
    write_robot(tmp_path / "robot.toml", arm)
    write_dataset(tmp_path / "poses.csv", scaled(data_of(arm), length=1e3), arm)
    words = [command, tmp_path / "robot.toml", tmp_path / "poses.csv", "--out", tmp_path / "out", "--quiet"]
    assert cli.main([str(word) for word in words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and "poses.csv" in lines[0] and "millimetres labelled as metres" in lines[0]
    assert not (tmp_path / "out" / "result.json").exists()


@pytest.mark.slow
def test_what_all_rows_show_is_said_where_the_fitted_ones_show_nothing(arm, tmp_path, capsys):
    """A tracker without its target repeats what it saw last, in more of the fitted rows than gross errors are
    looked for among."""
    data = replace(data_of(arm, count=60), identification=np.arange(60) < 42)
    position = data.position.copy()
    for row in (10, 25, 40):
        position[row] = position[row - 1]
    write_robot(tmp_path / "robot.toml", arm)
    write_dataset(tmp_path / "poses.csv", replace(data, position=position), arm)
    words = ["calibrate", tmp_path / "robot.toml", tmp_path / "poses.csv", "--out", tmp_path / "out"]
    assert cli.main([*map(str, words), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "robot and data do not match" in line and "another robot" not in line
    assert "had the device lost its target?" in line or "gross errors" in line
