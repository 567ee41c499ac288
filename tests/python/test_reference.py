"""Reference trajectories: derivatives, ends at rest, the source's paths, refusals."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from central_difference import central_difference
from exactarm.errors import InputError
from exactarm.plan.path_file import load_path, shipped_paths
from exactarm.plan.reference import Line, Points, Spiral, sample_reference, time_law

POINTS = np.array([[0.7, -0.2, 1.0], [0.8, 0.0, 1.1], [0.75, 0.2, 0.9], [0.8, 0.3, 1.2], [0.7, 0.4, 1.0]])
CURVES = {
    "line": Line(np.array([0.8, 0.0, 1.0]), np.array([0.8, 0.5, 0.9])),
    "spiral": Spiral(np.array([0.75, 0.0]), 0.1, 1.5, np.pi / 2, 1.1, 1.5),
    "points": Points(POINTS),
    "timed points": Points(POINTS, np.array([0.0, 0.5, 1.1, 1.4, 2.5])),
}


@pytest.mark.parametrize("name", CURVES)
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(name):
    motion = CURVES[name].motion(2.5)
    for t in (0.3, 0.9, 1.25, 2.2):
        for order in (0, 1):
            numeric = central_difference(lambda x: motion(x)[order][0], np.array([t]), 1e-3)[:, 0]
            np.testing.assert_allclose(motion(np.array([t]))[order + 1][0], numeric, atol=1e-6)


@pytest.mark.parametrize("name", CURVES)
def test_a_reference_starts_and_ends_at_rest(name):
    reference = sample_reference(CURVES[name], np.array([0, 0, 0, 1.0]), 2.5, 400.0)
    for end in (0, -1):
        np.testing.assert_allclose(reference.velocity[end], 0.0, atol=1e-12)
        np.testing.assert_allclose(reference.acceleration[end], 0.0, atol=1e-10)


def test_time_law_reaches_its_end_with_the_signs_of_e9():
    law, rate, second = time_law(np.array([0.0, 1.25, 2.5]), 2.5)
    np.testing.assert_allclose(law, [0.0, 0.5, 1.0], atol=1e-15)
    assert rate[1] == pytest.approx(35 / 16 / 2.5)


@pytest.mark.parametrize("name", ("points", "timed points"))
def test_via_points_are_met_and_the_fourth_derivative_has_no_jump(name):
    curve = CURVES[name]
    knots = curve.progress if curve.times is None else curve.times
    spline = curve._spline(knots)
    np.testing.assert_allclose(spline(knots), POINTS, atol=1e-12)
    for knot in knots[1:-1]:
        before, after = spline([knot - 1e-9, knot + 1e-9], nu=4)
        np.testing.assert_allclose(before, after, rtol=1e-5, atol=1e-5 * np.abs(spline(knots, nu=4)).max())


def test_shipped_paths_are_those_of_the_source():
    assert shipped_paths() == ("line", "spiral")
    line, spiral = load_path("line").reference(), load_path("spiral").reference()
    assert len(line.time) == len(spiral.time) == 2501 and line.step == pytest.approx(1e-3, rel=1e-12)
    np.testing.assert_allclose(line.position[-1], [0.834, 0.5, 1.0], atol=1e-12)
    np.testing.assert_allclose(line.rotation[7], np.diag([-1.0, -1.0, 1.0]), atol=1e-15)
    radius = np.linalg.norm(spiral.position[:, :2] - [0.75, 0.0], axis=1)
    assert radius[-1] == pytest.approx(0.1) and spiral.position[-1, 2] == pytest.approx(1.5)


def test_two_orientations_are_interpolated_on_the_sphere():
    wxyz = np.array([[1.0, 0, 0, 0], [np.cos(0.4), np.sin(0.4), 0, 0]])
    reference = sample_reference(CURVES["line"], wxyz, 2.0, 100.0)
    angle = Rotation.from_matrix(reference.rotation).magnitude()
    np.testing.assert_allclose(angle, 0.8 * time_law(reference.time, 2.0)[0], atol=1e-12)


def test_one_orientation_per_point_is_met_at_the_points():
    wxyz = Rotation.random(5, random_state=3).as_quat()[:, [3, 0, 1, 2]]
    curve = CURVES["timed points"]
    reference = sample_reference(curve, wxyz, 2.5, 1000.0)
    for time, quaternion in zip(curve.times, wxyz):
        turn = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
        np.testing.assert_allclose(reference.rotation[int(round(time * 1000))], turn, atol=1e-9)


@pytest.mark.parametrize("text, word", [
    ('kind = "circle"', "kind"),
    ('kind = "line"\nstart_m = [0, 0]\nend_m = [0, 0, 1]\nduration_s = 1', "start_m"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]', "duration_s"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]\nduration_s = -1', "duration_s"),
    ('kind = "line"\nstart_m = [0, 0, nan]\nend_m = [0, 0, 1]\nduration_s = 1', "start_m"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]\nduration_s = 1\nspeed = 3', "speed"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]\nduration_s = 1\nrate_hz = 2', "rate_hz"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]\nduration_s = 1\nsolver = "best"', "solver"),
    ('kind = "points"\npoints_m = [[0, 0, 0], [0, 0, 0]]\nduration_s = 1', "points_m"),
    ('kind = "points"\npoints_m = [[0, 0, 0], [0, 0, 1]]\ntimes_s = [0, -1]', "times_s"),
    ('kind = "line"\nstart_m = [0, 0, 0]\nend_m = [0, 0, 1]\nduration_s = 1\norientation_wxyz = [0, 0, 0, 2]',
     "orientation"),
    ("kind =", "TOML"),
])
def test_a_bad_path_file_is_refused_in_one_line_that_names_the_key(tmp_path, text, word):
    file = tmp_path / "path.toml"
    file.write_text(text)
    with pytest.raises(InputError, match="path.toml") as refusal:
        load_path(file)
    if word != "TOML":
        assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_an_unknown_name_lists_the_shipped_ones():
    with pytest.raises(InputError, match="line, spiral"):
        load_path("circle")
