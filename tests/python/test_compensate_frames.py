"""Base and flange of a compensation: what each choice makes of a shift that no calibration can tell from
geometry."""

from dataclasses import replace

import numpy as np
import pytest

from compensation_cell import identified, reachable
from exactarm.compensate.frames import cell_frames, with_nominal
from exactarm.compensate.law import CompensationModel
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp
from exactarm.robot.mdh_frames import compose
from exactarm.robot.robot import Controller, Placement
from exactarm.robot_file import load_robot


def arms(shift=(0.0012, -0.0009, 0.0015), turn=(4e-4, -3e-4, 6e-4), end=(5e-4, -7e-4, 4e-4)):
    """The true arm, and one whose calibration has put a shift of base and flange into other frames."""
    true = identified(effects=False)
    model = CompensationModel.of(true)
    base, flange = Placement(exp(np.array(turn)), np.array(shift)), Placement(np.eye(3), np.array(end))
    return true, model, base, flange


def touched(tmp_path, robot, model, base, flange, q):
    """Reference points as the real arm touches them, in the controller's base frame."""
    reached = CompensationModel.of(robot, base, flange).reached(q)
    data = Dataset.of_arrays("poses", {"q": q}, position=reached.position)
    write_dataset(tmp_path / "points.csv", data, robot)
    return str(tmp_path / "points.csv")


def missed(robot, base, flange, chosen, q):
    """Largest error of the flange, m, of an arm that stands at `base` and ends at `flange`, commanded with
    the chosen frames."""
    true, used = CompensationModel.of(robot, base,
                                      flange), CompensationModel.of(robot, chosen.base, chosen.flange)
    targets = true.controller.poses(q)
    commands = used.commands(targets, q).q
    return np.linalg.norm(true.reached(commands).position - targets.position, axis=1).max()


def test_reference_points_remove_the_gauge(tmp_path):
    robot, model, base, flange = arms()
    q = reachable(robot, 60)
    path = touched(tmp_path, robot, model, base, flange, q[:12])
    nominal = cell_frames(robot, "nominal", Placement())
    points = cell_frames(robot, path, Placement())
    assert missed(robot, base, flange, nominal, q[12:]) > 1e-3
    assert missed(robot, base, flange, points, q[12:]) < 5e-6
    assert "reference points" in points.choice and "remove it" in nominal.choice


def test_reference_points_that_are_copies_are_left_out_and_said(tmp_path):
    robot, model, base, flange = arms()
    path = touched(tmp_path, robot, model, base, flange, np.repeat(reachable(robot, 12), 2, axis=0))
    (warning,) = cell_frames(robot, path, Placement()).warnings
    assert warning.startswith("points.csv: 12 of 24 rows are copies of others")


def test_three_points_improve_what_they_can(tmp_path):
    robot, model, base, flange = arms()
    q = reachable(robot, 60)
    points = cell_frames(robot, touched(tmp_path, robot, model, base, flange, q[:3]), Placement())
    assert missed(robot, base, flange, points, q[:3]) < 1e-4
    assert missed(robot, base, flange, points,
                  q[12:]) < 0.6 * missed(robot, base, flange, cell_frames(robot, "nominal", Placement()),
                                         q[12:])


def test_identified_frames_bring_the_models_together_over_the_work_space():
    robot = identified(effects=False)
    shifted = replace(robot,
                      joints=tuple(replace(j, d=j.d + 0.002) if i == 0 else j
                                   for i, j in enumerate(robot.joints)))
    q = reachable(robot, 60)
    frames = cell_frames(shifted, "identified", Placement())
    assert np.linalg.norm(frames.base.position) > 1e-3
    size = lambda chosen: np.linalg.norm(
        CompensationModel.of(shifted, chosen.base, chosen.flange).reached(q).position
        - CompensationModel.of(shifted).controller.poses(q).position, axis=1)
    assert size(frames).mean() < 0.8 * size(cell_frames(shifted, "nominal", Placement())).mean()


def test_points_of_another_frame_are_refused(tmp_path):
    robot, model, base, flange = arms()
    far = compose(Placement(np.eye(3), np.array([1.0, 0.0, 0.0])), base)
    with pytest.raises(InputError, match="base frame"):
        cell_frames(robot, touched(tmp_path, robot, model, far, flange, reachable(robot, 6)), Placement())
    with pytest.raises(InputError, match="at least 3"):
        cell_frames(robot, touched(tmp_path, robot, model, base, flange, reachable(robot, 2)), Placement())


def test_the_nominal_frames_of_another_file_become_the_controllers():
    robot = replace(identified(), controller=Controller(absolute_accuracy=True))
    merged = with_nominal(robot, load_robot("racer-7-1.4"))
    assert (
        merged.controller.frames[0].d == load_robot("racer-7-1.4").joints[0].d
        and merged.controller.absolute_accuracy
    )
    with pytest.raises(InputError, match="no geometry"):
        with_nominal(robot, load_robot("kr300"))
