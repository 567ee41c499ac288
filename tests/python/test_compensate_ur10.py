"""Held-out poses of the measured UR10 as targets: the command that comes back is the one that was driven,
within the model's error."""

import numpy as np
import pandas
import pytest

import exactarm as ea
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset

# smallest |q5| and |q3| in mrad of the poses that are asked for: close to zero the wrist or the elbow is in
# line
SINGULAR = 50.0


def held_out(robot, seed=1):
    """Rows of the series that no fit has seen and that are not close to singular."""
    data = ea.read(ea.example("ur10/series_B"), robot)
    rows = data.select(~data.split(seed))
    q = rows.joints["q"]
    return rows.select((np.abs(np.sin(q[:, 4])) > 0.2) & (np.abs(np.sin(q[:, 2])) > 0.2))


def commanded(robot, rows, tmp_path):
    """What `compensate` commands for the measured poses, in the tracker's frame."""
    columns = {f"q_{i + 1}_rad": rows.joints["q"][:, i] for i in range(6)}
    columns |= {f"{axis}_m": rows.position[:, k] for k, axis in enumerate("xyz")}
    path = tmp_path / "held_out.csv"
    pandas.DataFrame(columns).to_csv(path, index=False)
    result = ea.compensate(robot, path, frame="device", keep_refused=True, threads=1)
    result.save(tmp_path / "out")
    commands = pandas.read_csv(tmp_path / "out" / path.name)[[f"q_{i + 1}_rad" for i in range(6)]].to_numpy()
    return commands, result


def distances(robot, q, other):
    """(N,) m between the targets of two sets of joint angles, by the model."""
    layout = Layout.of(tuple(effect for effect in robot.effects if not effect.record), estimate=False)
    here, there = (predict_poses(robot, layout, Dataset.of_arrays("poses", {"q": angles}), tangents=False)
                   for angles in (q, other))
    return np.linalg.norm(here.position - there.position, axis=1)


def check(robot, result, tmp_path):
    rows = held_out(robot)
    commands, report = commanded(robot, rows, tmp_path)
    good = ~np.isnan(commands).any(axis=1)
    assert good.mean() > 0.9
    found = distances(robot, rows.joints["q"][good], commands[good])
    model = result.after["validation"].mean
    assert found.mean() < 1.2 * model, (found.mean(), model)
    assert report["as_written_max_m"] < 1e-6
    return found.mean(), model


@pytest.mark.slow
def test_the_calibrated_arm_is_sent_where_it_was(tmp_path):
    result = ea.calibrate("ur10", ea.example("ur10/series_B"), threads=1)
    check(result.robot, result, tmp_path)


@pytest.mark.slow
def test_the_diagnosed_arm_is_sent_where_it_was(tmp_path):
    result = ea.diagnose("ur10", ea.example("ur10/series_B"), threads=1)
    found, model = check(result.robot, result, tmp_path)
    # 0.098 mm measured, the aim is 0.10; another machine rounds otherwise
    assert found < 1.1e-4, (found, model)
