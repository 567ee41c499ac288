"""How far an arm is from its drawing: few poses gain by it, many lose nothing, one far off is let alone."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.effects.frames import Frames
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.declared import geometry_layout
from exactarm.identify.drawing import Drawn
from exactarm.identify.pose_fit import fit_poses
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis
from test_calibrate import deviated_where_identifiable

COARSE_M, FINE_M = 1e-3, 2e-5
OPTIONS = CalibrationOptions(orientation=False, compliance=())


@pytest.fixture(scope="module")
def arm():
    return six_axis(placed=False)


def calibrated(arm, truth, poses, noise, rng, judged=40):
    """The calibration from `poses` poses, the same parameters without a drawing, and both RMS errors (m) on
    exact poses that were not fitted."""
    q = joints_in_limits(arm, poses + judged, rng)
    fitted = np.arange(poses + judged) < poses
    data = measured(arm, [truth], [q], noise, rng, identification=fitted)
    exact = measured(arm, [truth], [q], 0.0, rng, identification=fitted).select(~fitted)
    result = calibrate(arm, data, OPTIONS)
    freely = fit_poses(result.fit.robot, result.fit.layout, data.select(fitted))
    rms = [float(np.sqrt(np.mean(fit.error(exact) ** 2))) for fit in (result.fit, freely)]
    return result, freely, rms


@pytest.mark.slow
def test_few_poses_predict_better_beside_the_drawing(arm):
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(10):
        _, _, (drawn, freely) = calibrated(arm, true_robot(arm, rng, 0.3), 16, COARSE_M, rng)
        ratios.append(drawn / freely)
    assert np.median(ratios) < 0.8 and max(ratios) < 1.05


def test_many_poses_know_more_than_a_drawing(arm):
    rng = np.random.default_rng(2)
    result, freely, rms = calibrated(arm, true_robot(arm, rng), 150, FINE_M, rng)
    spread = np.sqrt(np.diag(freely.fit.covariance))
    assert np.all(np.abs(result.fit.fit.x - freely.fit.x) < 0.2 * spread)
    assert rms[0] < 1.05 * rms[1]


@pytest.mark.parametrize("scale", [0.1, 1.0, 4.0])
def test_the_scale_follows_the_arm(arm, scale):
    rng = np.random.default_rng(3)
    result, _, _ = calibrated(arm, true_robot(arm, rng, scale), 60, FINE_M, rng)
    fit, drawn = result.fit, result.fit.drawn
    own = [(x - drawn.to[name][0]) / p.plausible
           for name, x, p in zip(fit.layout.names, fit.layout.values, fit.layout.parameters)
           if name in drawn.to]
    # one parameter as plausible as declared is counted with them; the tails weigh those far off less
    ratio = drawn.scale / np.sqrt((np.sum(np.square(own)) + 1.0) / (len(own) + 1.0))
    assert 0.6 < ratio < 1.1
    assert 0.9 * len(own) < drawn.told <= len(own)


def test_a_zero_that_was_set_anew_is_let_alone(arm):
    """One joint offset 6 degrees off, the rest a third of what is plausible: it comes back as without a
    drawing."""
    rng = np.random.default_rng(4)
    true = true_robot(arm, rng, 0.3)
    joints = list(true.joints)
    joints[3] = replace(joints[3], q_offset=joints[3].q_offset + 0.1)
    result, freely, _ = calibrated(arm, replace(true, joints=tuple(joints)), 25, COARSE_M, rng)
    place = result.names.index("q_offset_4_rad")
    assert freely.fit.x[place] > 0.09  # it was there to be found
    spread = np.sqrt(freely.fit.covariance[place, place])
    assert abs(result.fit.fit.x[place] - freely.fit.x[place]) < spread
    low, high = result.intervals[place]
    assert low < joints[3].q_offset < high


@pytest.mark.slow
@pytest.mark.parametrize(("poses", "noise"), [(14, COARSE_M), (14, 1e-4), (25, COARSE_M)])
def test_intervals_of_few_poses_hold_the_truth(arm, poses, noise):
    """Between 14 poses, of which the data tell a third of the parameters and the drawing the rest, and 25."""
    rng = np.random.default_rng(5)
    names = calibrated(arm, arm, 60, FINE_M, rng)[0].names
    inside = []
    for _ in range(40):
        true = at_random_place(deviated_where_identifiable(arm, names, rng), rng)
        result, _, _ = calibrated(arm, true, poses, noise, rng, judged=1)
        layout = Layout.of((Frames.of(1, true.base, true.tool, False),)).joined(geometry_layout(true))
        # a frame with a beta has its d in the tables, and in no layout
        truth = {f"d_{i}_m": joint.d for i, joint in enumerate(true.joints, start=1)}
        truth |= dict(zip(layout.names, layout.values))
        values = np.array([truth[name] for name in result.names])
        inside.append(np.mean((result.intervals[:, 0] < values) & (values < result.intervals[:, 1])))
    # 40 sets of some 29 parameters, which hang together: a standard deviation of the mean of 0.01
    assert 0.92 < np.mean(inside) < 0.98, f"{np.mean(inside):.3f}"


def test_a_fit_that_was_drawn_tells_the_same_scale(arm):
    """What it was drawn to is no news. Any seed: 0 to 7 were tried."""
    rng = np.random.default_rng(5)
    data = measured(arm, [true_robot(arm, rng, 0.3)], [joints_in_limits(arm, 60, rng)], FINE_M, rng)
    layout = calibrate(arm, data, OPTIONS).fit.layout
    geometry = geometry_layout(arm)
    freely = fit_poses(arm, layout, data)
    told = Drawn.around(geometry, layout, freely.fit)
    to = {name: (value, p.plausible) for name, value, p in zip(geometry.names, geometry.values,
                                                              geometry.parameters)}
    drawn = fit_poses(arm, layout, data, drawn=Drawn(to))
    again = Drawn.around(geometry, layout, drawn.fit, to)
    assert again.scale == pytest.approx(told.scale, rel=0.02)
    assert again.told == pytest.approx(told.told, rel=0.02)
