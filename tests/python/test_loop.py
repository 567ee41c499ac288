"""The circle on a virtual robot: with the cause in the model, the arm misses by less."""

import json

import numpy as np
import pytest

from exactarm.cli import main
from exactarm.data.dataset import Dataset
from exactarm.simulate import Sensors, VirtualRobot, measure_tracked_motion, parse_effect
from exactarm.simulate.measure import true_path
from exactarm.simulate.profiles import excitation
from six_axis import six_axis


@pytest.mark.slow
def test_the_loop_closes(tmp_path):
    words = ["loop", "racer-7-1.4", "--effect",
             "gear_eccentricity joint=2 first_cos_rad=3e-4 first_sin_rad=1e-4",
             "--count", "120", "--out", str(tmp_path), "--quiet", "--threads", "1"]
    assert main(words) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    drawn, calibrated, diagnosed = (entry["tracking"]["rms"] for entry in result["rounds"])
    # A calibration that bends the geometry to a hidden cause need not help on a path; the diagnosis has to.
    assert diagnosed < 0.5 * min(drawn, calibrated)
    assert [(e["effect"], e["joint"]) for e in result["effects"]][0] == ("gear_eccentricity", 2)
    page = (tmp_path / "report.html").read_text()
    assert "What was hidden, and what was found" in page and page.count("gear eccentricity of axis 2") >= 2


def test_the_loop_wants_a_hidden_cause(tmp_path, capsys):
    assert main(["loop", "racer-7-1.4", "--out", str(tmp_path)]) == 2
    assert "--effect" in capsys.readouterr().err


def test_what_the_device_adds_is_measured_but_the_target_does_not_go_there():
    robot = six_axis()
    time, q = excitation(robot, 1.0, 200.0, np.random.default_rng(2))
    plain = VirtualRobot.of(robot)
    hidden = VirtualRobot.of(robot, [parse_effect("tracker_scale x_scale=0 y_scale=0 z_scale=1e-3", 6)])
    theta = plain.motor_angles(q)
    data = Dataset.of_arrays("tracked_motion", {"theta": theta}, time=time)
    paths = [true_path(virtual, data) for virtual in (plain, hidden)]
    assert np.array_equal(*paths)
    exact = Sensors(position_m=0.0)
    read = measure_tracked_motion(hidden, time, theta, exact, np.random.default_rng(1)).position
    assert np.allclose(read, paths[0] * [1.0, 1.0, 1.001], atol=1e-12)
    bent = VirtualRobot.of(robot, [parse_effect("link_compliance joint=2 rad_per_Nm=2e-6", 6)])
    assert np.max(np.abs(true_path(bent, data) - paths[0])) > 5e-6
