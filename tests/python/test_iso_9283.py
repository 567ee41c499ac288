"""Measures of ISO 9283 against numbers that were worked out by hand from the standard's definitions."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.data.dataset import Dataset
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement
from exactarm.verify.iso_9283 import iso_9283
from exactarm.verify.iso_orientation import iso_orientation
from exactarm.verify.iso_path import EDGE, measures
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis

MM = 1e-3


def test_distances_are_judged_visit_by_visit():
    """D = 100, 102, 101 mm, 99 mm commanded: AD = 101 - 99 = 2 mm, S = 1 mm, RD = 3 mm. Between the mean
    positions, turned against each other, the distance would be shorter."""
    far = MM * np.array([[100.0, 0, 0], [0, 102.0, 0], [0, 0, 101.0]])
    position = np.concatenate([np.zeros((3, 3)), far])
    commanded = np.concatenate([np.zeros((3, 3)), np.tile([0.099, 0, 0], (3, 1))])
    data = Dataset.of_arrays("poses", {"q": np.repeat([[0.0], [1.0]], 3, axis=0)}, position=position)
    found = iso_9283(data, position - commanded, position - commanded, commanded, commanded, 1).distances
    assert found.length == pytest.approx([0.101]) and found.after == pytest.approx([2 * MM])
    assert found.repeatability == pytest.approx(3 * MM) and found.repeated == 1


def test_what_differs_between_directions_scatters_no_distance():
    """Two poses 100 mm apart, three visits from each side, 0.4 mm apart by the side: RD of each pair is zero,
    the distances are those of four pairs; a pose's own two sides are no pair."""
    position = np.zeros((12, 3))
    position[:, 0] = MM * (np.repeat([0.0, 100.0], 6) + np.tile(np.repeat([0.0, 0.4], 3), 2))
    joints = {"q": np.repeat([[0.0], [1.0]], 6, axis=0),
              "approach": np.tile(np.repeat([[-1.0], [1.0]], 3, axis=0), (2, 1))}
    data = Dataset.of_arrays("poses", joints, position=position)
    found = iso_9283(data, position, position, 0.0 * position, 0.0 * position, 1).distances
    assert found.repeatability == pytest.approx(0.0, abs=1e-12) and found.repeated == 4
    assert sorted(found.length) == pytest.approx([0.0996, 0.1, 0.1, 0.1004])


def test_what_differs_between_directions_is_no_drift():
    """Six visits from one side, 1 mm off, then six from the other, 3 mm off: AP of each stays, vAP = 2 mm."""
    error = np.zeros((12, 3))
    error[:, 0] = MM * np.repeat([1.0, 3.0], 6)
    joints = {"q": np.zeros((12, 1)), "approach": np.repeat([[-1.0], [1.0]], 6, axis=0)}
    data = Dataset.of_arrays("poses", joints, position=error, time=200.0 * np.arange(12))
    found = iso_9283(data, error, error, 0.0 * error, 0.0 * error, 1)
    assert found.directions[0] == pytest.approx(2 * MM)
    assert found.drift[0] == pytest.approx(0.0) and found.drift[2] == pytest.approx(0.0)


def test_pose_accuracy_repeatability_and_drift_of_four_visits():
    """Visits 1, 3, 1, 3 mm off along x: AP = 2 mm, l = 1 mm each, S = 0, RP = 1 mm."""
    error = np.zeros((4, 3))
    error[:, 0] = MM * np.array([1.0, 3.0, 1.0, 3.0])
    data = Dataset.of_arrays("poses", {"q": np.zeros((4, 1))}, position=error)
    (test,) = iso_9283(data, error, 0.0 * error, 0.0 * error, 0.0 * error, 1).poses
    assert (test.accuracy_before, test.accuracy_after) == (pytest.approx(2 * MM), 0.0)
    assert test.repeatability == pytest.approx(MM)


def test_orientation_accuracy_repeatability_and_directions():
    """Turns about the base's z of 1, 2, 3 mrad from one side, 5, 5, 5 mrad from the other: AP_c = 2 and
    5 mrad, RP_c = 3 * 1 mrad and 0, vAP_c = 3 mrad; the base stands askew in the device's frame."""
    base = exp(np.array([0.4, -1.0, 2.0]))
    turn = np.zeros((6, 3))
    turn[:, 2] = MM * np.array([1.0, 2.0, 3.0, 5.0, 5.0, 5.0])
    commanded = exp(np.array([0.3, 0.2, 0.1]))
    data = Dataset.of_arrays(
        "poses", {"q": np.zeros((6, 1)), "approach": np.repeat([[-1.0], [1.0]], 3, axis=0)},
        position=np.zeros((6, 3)), rotation=base @ exp(turn) @ commanded)
    found = iso_orientation(data, turn, 0.0 * turn, np.tile(base, (6, 1, 1)))
    assert found.poses == 2 and found.error == (pytest.approx(3.5 * MM), 0.0)
    np.testing.assert_allclose(found.accuracy_before, [0, 0, 5 * MM], atol=1e-12)
    np.testing.assert_allclose(found.accuracy_after, 0.0, atol=1e-15)
    np.testing.assert_allclose(found.repeatability, [0, 0, 3 * MM], atol=1e-9)
    np.testing.assert_allclose(found.directions[0], [0, 0, 3 * MM], atol=1e-12)


def straight(offset_mm, samples=400):
    """A path of one metre along x, beside its line by offset_mm (3,)."""
    along = np.linspace(-0.001, 1.001, samples)
    return np.stack([along, np.zeros(samples), np.zeros(samples)], axis=1) + MM * np.array(offset_mm)


def test_a_straight_path_beside_its_line():
    """y = 0.1, 0.2, 0.3 mm: AT = 0.2 mm; l = 0.1, 0, 0.1 mm, mean 1/15, S = 0.1 / sqrt 3, RT = 0.23987 mm.
    Along the path an error does not count."""
    command = np.stack([np.linspace(0.0, 1.0, 201), np.zeros(201), np.zeros(201)], axis=1)
    paths = [straight([shift, y, 0.0]) for shift, y in ((0.0, 0.1), (0.4, 0.2), (-0.4, 0.3))]
    accuracy, repeatability = measures(command, paths)
    assert accuracy == pytest.approx(0.2 * MM, rel=1e-9)
    assert repeatability == pytest.approx(MM * (0.2 / 3 + 3 * 0.1 / np.sqrt(3.0)), rel=1e-9)
    assert measures(command, paths[:2])[1] is None


def test_a_circle_of_another_radius():
    angle = np.linspace(0.0, 1.9 * np.pi, 201)
    circle = lambda radius, angles: radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    fine = np.linspace(-0.05, 1.9 * np.pi + 0.05, 3000)
    accuracy, repeatability = measures(circle(0.2, angle), [circle(0.2 + 0.5 * MM, fine)] * 3)
    assert accuracy == pytest.approx(0.5 * MM, rel=1e-3) and repeatability == pytest.approx(0.0, abs=1e-12)
    bump = circle(0.2, fine) * (1.0 + 2e-3 * np.exp(-(((fine - 3.0) / 0.2) ** 2)))[:, None]
    assert measures(circle(0.2, angle), [bump])[0] == pytest.approx(0.4 * MM, rel=1e-2)
    ends = circle(0.2, fine) * (1.0 + 2e-3 * (fine < EDGE * 1.5 * np.pi))[:, None]
    assert measures(circle(0.2, angle), [ends])[0] < 0.4 * MM


@pytest.fixture(scope="module")
def cell():
    """A calibrated arm and its poses with orientation, and a path driven five times."""
    rng = np.random.default_rng(31)
    arm = six_axis(springs=False, placed=False)
    truth = true_robot(arm, rng)
    q = np.concatenate([np.repeat(joints_in_limits(arm, 5, rng), 6, axis=0), joints_in_limits(arm, 60, rng)])
    poses = measured(arm, [truth], [q], 2e-5, rng, noise_rad=2e-5)
    start = joints_in_limits(arm, 1, rng)[0] * 0.5
    share = np.concatenate([np.zeros(20), np.linspace(0.0, 1.0, 300), np.ones(20)])[:, None]
    one = start + share * np.array([0.3, 0.2, -0.2, 0.3, 0.2, 0.4])
    driven = measured(arm, [truth], [np.tile(one, (5, 1))], 2e-5, rng)
    time = np.tile(np.arange(len(one)) * 0.01, 5)
    path = Dataset.of_arrays(
        "tracked_motion", driven.joints, position=driven.position, time=time, session=driven.session,
        run=np.repeat(np.arange(1, 6), len(one)))
    return arm, truth, poses, path


@pytest.mark.slow
def test_a_certificate_judges_orientation_and_paths(cell):
    arm, truth, poses, path = cell
    known = replace(truth, base=Placement(), tool=Placement())
    result = ea.certify(known, poses, before=arm, path=path, threads=1)
    iso = result["iso_9283"]
    turned = iso["orientation"]
    assert turned["tested_poses"] >= 3
    assert max(turned["AP_after_max_rad"]) < 4e-5 < 3e-4 < max(turned["AP_before_max_rad"])
    # three standard deviations of 20 urad from six visits, the largest of some poses
    assert 6e-5 < max(turned["RP_max_rad"]) < 1.5e-4
    (one,) = iso["paths"]
    assert one["cycles"] == 5 and 0.1 < one["length_m"] < 3.0 and 0.02 < one["speed_m_s"] < 1.0
    assert one["AT_after_m"] < 8e-5 < 3e-4 < one["AT_before_m"]
    assert 4e-5 < one["RT_m"] < 3e-4
    assert "path accuracy AT and repeatability RT" not in iso["missing"]
    page = result.summary()
    assert "AP_a" in page and "AT after" in page
    assert any("10 cycles" in warning for warning in result.warnings)
    with pytest.raises(InputError, match="session 2 is not among those of the poses"):
        ea.certify(known, poses, before=arm, path=replace(path, session=path.session + 1), threads=1)


@pytest.mark.parametrize("mistake, words", [
    (lambda p: 1e3 * p, "in another unit [(]1000"),
    (lambda p: p * [1.0, -1.0, 1.0], "set-up, robot or unit|mirror"),
    (lambda p: 1.2 * p, "set-up, robot or unit"), (lambda p: p + [0.0, 0.3, 0.0], "set-up, robot or unit"),
])
@pytest.mark.slow
def test_a_path_where_no_calibrated_arm_goes_is_refused_with_a_guess(cell, mistake, words):
    arm, truth, poses, path = cell
    known = replace(truth, base=Placement(), tool=Placement())
    line = rf"run 1 lies .* from where the frames of the poses have it.*({words})"
    with pytest.raises(InputError, match=line):
        ea.certify(known, poses, before=arm, path=replace(path, position=mistake(path.position)), threads=1)


@pytest.mark.slow
def test_a_path_that_lies_beside_as_one_body_is_told(cell):
    """By 5 mm of another set-up; as it is, nothing is said."""
    arm, truth, poses, path = cell
    known = replace(truth, base=Placement(), tool=Placement())
    moved = replace(path, position=path.position + [5 * MM, 0.0, 0.0])
    said = [[w for w in ea.certify(known, poses, before=arm, path=each, threads=1).warnings if "beside" in w]
            for each in (path, moved)]
    assert said[0] == [] and len(said[1]) == 1 and said[1][0].startswith("path 1 lies ")


def test_without_orientation_and_paths_both_are_named_as_missing(cell):
    arm, truth, poses, _ = cell
    known = replace(truth, base=Placement(), tool=Placement())
    missing = ea.certify(known, replace(poses, rotation=None), before=arm, threads=1)["iso_9283"]["missing"]
    assert {"orientation accuracy and repeatability", "path accuracy AT and repeatability RT"} <= set(missing)


def test_the_place_of_the_device_does_not_matter(cell):
    """Orientation is judged about the axes of the base, wherever the device stands."""
    arm, truth, _, _ = cell
    known, found = replace(truth, base=Placement(), tool=Placement()), []
    q = np.repeat(joints_in_limits(arm, 40, np.random.default_rng(2)), 3, axis=0)
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        there = replace(truth, base=at_random_place(arm, rng).base)
        data = measured(arm, [there], [q], 1e-9, rng, noise_rad=1e-9)
        found.append(ea.certify(known, data, before=arm, threads=1)["iso_9283"]["orientation"])
    np.testing.assert_allclose(found[0]["AP_before_max_rad"], found[1]["AP_before_max_rad"], rtol=1e-3)
