"""A device whose lengths or whose time is wrong by a factor, on slow motions along a line, and right ones."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.files.table import write_table
from exactarm.first_aid.first_aid import first_aid
from exactarm.robot_file import load_robot


@pytest.fixture(scope="module", params=[
    pytest.param(("racer-7-1.4", "line", 5.0), id="line"),
    pytest.param(("racer-7-1.4", "spiral", 40.0), id="slow spiral", marks=pytest.mark.slow),
])
def motion(request, tmp_path_factory):
    """A tracked motion of an arm whose geometry is off as usual, 50 um of noise."""
    name, path, seconds = request.param
    planned = ea.plan(name, path, duration_s=seconds, rate_hz=50).tables["trajectory.csv"]
    file = tmp_path_factory.mktemp("plan") / "trajectory.csv"
    write_table(file, planned)  # its pictures take longer than the plan
    return load_robot(name), ea.simulate(name, file, noise=5e-5, deviation=1).data


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.2, 1.0 / 1.2])
def test_lengths_of_another_scale_are_told_with_their_factor(motion, factor):
    robot, data = motion
    (said,) = first_aid(robot, replace(data, position=factor * data.position))
    assert f"lengths of the device {factor:.2g}" in said


@pytest.mark.parametrize("factor", [1.2, 1.0 / 1.2, 1.05])
@pytest.mark.slow
def test_a_time_that_runs_otherwise_is_told_with_its_factor(motion, factor):
    robot, data = motion
    meant = data.time[0] + factor * (data.time - data.time[0])
    late = np.stack([np.interp(meant, data.time, values) for values in data.position.T], axis=1)
    said = first_aid(robot, replace(data, position=late))
    assert f"a device whose time runs {factor:.3g}" in said[0]


@pytest.mark.slow
def test_a_delay_throughout_is_no_other_time(motion):
    """30 ms on a line of 10 s were once told as a time that runs 0.9947 times as fast."""
    robot, data = motion
    for delay in (0.03, -0.06):
        late = np.stack([np.interp(data.time - delay, data.time, values) for values in data.position.T], 1)
        assert not any("runs" in said for said in first_aid(robot, replace(data, position=late)))


@pytest.mark.slow
def test_right_motions_are_not_suspected(motion):
    """Lags of a slow motion are hardly known: 25 and -51 ms were once told as a clock that drifts."""
    robot, data = motion
    random = np.random.default_rng(1)
    for noise in (0.0, 1e-4, 3e-4):
        noisy = replace(data, position=data.position + random.normal(0.0, noise, data.position.shape))
        assert first_aid(robot, noisy) == ()
