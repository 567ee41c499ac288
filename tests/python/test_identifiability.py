"""Identifiability: what is dropped, why, and that the selection is a basis of the column space."""

import numpy as np
import pytest

from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.identify.identifiability import preference, select_identifiable, still_axes
from identification_poses import RIGHT, racer_like, random_joints, robot_of, stacked_jacobian


def analyse(robot, frames=True, orientation=False, count=200, seed=5, **options):
    jacobian, layout = stacked_jacobian(robot, random_joints(robot, count, seed), frames, orientation)
    first = (12 if orientation else 9) * frames
    result = select_identifiable(jacobian, layout.names, keep_first=first, robot=robot, **options)
    return jacobian, layout, result


def why(result, name):
    return next(entry for entry in result.dropped if entry.name == name)


@pytest.mark.parametrize("orientation", [False, True])
def test_kept_columns_span_all_columns(orientation):
    jacobian, _, result = analyse(racer_like(), orientation=orientation)
    unit = jacobian / np.linalg.norm(jacobian, axis=0)
    assert np.linalg.matrix_rank(unit, tol=1e-8) == result.kept.sum() == len(result.identifiable)
    assert np.linalg.matrix_rank(unit[:, result.kept], tol=1e-8) == result.kept.sum()
    assert np.sum(result.singular_values < 1e-8) == len(result.dropped)


def test_frames_absorb_what_an_engineer_expects():
    _, _, result = analyse(racer_like(hayati=False))
    assert set(result.dropped_names) == {
        "d_1_m", "q_offset_1_rad", "d_3_m", "d_6_m", "a_6_m", "alpha_6_rad", "q_offset_6_rad"
    }
    assert "base frame" in why(result, "d_1_m").why and "base frame" in why(result, "q_offset_1_rad").why
    assert all("tool frame" in why(result, name).why
               for name in ("d_6_m", "a_6_m", "alpha_6_rad", "q_offset_6_rad"))


def test_parallel_axes_are_named():
    _, _, result = analyse(racer_like(hayati=False))
    entry = why(result, "d_3_m")
    assert entry.collides_with == ("d_2_m",) and entry.exact
    assert entry.why == "d_3_m and d_2_m move the tool alike: axes 2 and 3 are parallel"


def test_three_parallel_axes_collide_in_one_class():
    rows = [(0.13, 0.0, RIGHT), (0.0, -0.61, 0.0), (0.0, -0.57, 0.0), (0.16, 0.0, RIGHT), (0.12, 0.0, -RIGHT),
            (0.09, 0.0, 0.0)]
    _, _, result = analyse(robot_of(rows))
    assert "axes 2 and 4 are parallel" in why(result, "d_4_m").why
    assert "axes 2 and 3 are parallel" in why(result, "d_3_m").why


def test_collinear_axes_are_named():
    rows = [(0.4, 0.1, RIGHT), (0.1, 0.5, RIGHT), (0.3, 0.0, 0.0), (0.2, 0.0, RIGHT), (0.1, 0.2, -RIGHT),
            (0.1, 0.1, 0.0)]
    _, _, result = analyse(robot_of(rows))
    assert "axes 3 and 4 are collinear" in why(result, "q_offset_4_rad").why


def test_nearly_parallel_axes_are_dropped_by_the_noise_only():
    robot = racer_like(hayati=False).with_joint(1, alpha=2e-3)
    _, layout, free = analyse(robot)
    assert "d_3_m" in free.identifiable
    plausible = [parameter.plausible for parameter in layout.parameters]
    _, _, noisy = analyse(robot, sigma=1e-4, plausible=plausible)
    entry = why(noisy, "d_3_m")
    assert (
        not entry.exact and "d_2_m" in entry.collides_with and "nearly parallel (0.11 degrees)" in entry.why
    )
    assert np.all(noisy.sigma_parameter[noisy.kept] <= np.array(plausible)[noisy.kept])
    assert np.all(np.isnan(noisy.sigma_parameter[~noisy.kept]))


def test_deviations_are_those_of_least_squares():
    robot = racer_like(hayati=False)
    jacobian, layout, result = analyse(robot, sigma=2e-4, plausible=[10.0] * 40)
    kept = jacobian[:, result.kept]
    expected = 2e-4 * np.sqrt(np.diag(np.linalg.inv(kept.T @ kept)))
    np.testing.assert_allclose(result.sigma_parameter[result.kept], expected, rtol=1e-8)


def test_weights_scale_the_rows():
    robot = racer_like()
    jacobian, layout = stacked_jacobian(robot, random_joints(robot, 100, 3))
    names = layout.names
    doubled = select_identifiable(jacobian, names, weights=np.full(300, 2.0), sigma=2e-4,
                                  plausible=[10.0] * 40)
    plain = select_identifiable(jacobian, names, sigma=1e-4, plausible=[10.0] * 40)
    np.testing.assert_allclose(doubled.sigma_parameter, plain.sigma_parameter, rtol=1e-9)


def test_source_table_3_5():
    """Not identifiable in the source: d_1, d_3, d_6, a_6, alpha_6. All of them, and three offsets, by the
    SVD."""
    _, _, result = analyse(racer_like(), count=1000)
    geometry = {name for name in result.dropped_names if not name.startswith("q_offset")}
    assert geometry == {"d_1_m", "d_6_m", "a_6_m", "alpha_6_rad"}  # frame 3 has beta and no d
    offsets = {name for name in result.dropped_names if name.startswith("q_offset")}
    assert offsets == {"q_offset_1_rad", "q_offset_3_rad", "q_offset_6_rad"}
    entry = why(result, "q_offset_3_rad")
    assert set(entry.collides_with) == {"beta_3_rad", "d_4_m"} and "right angle" in entry.why
    assert {"ratio_4", "ratio_5", "ratio_6"} <= set(result.identifiable)


def test_without_frames_the_base_stays_identifiable():
    _, _, result = analyse(racer_like(target_on_axis=True), frames=False)
    assert {"d_1_m", "q_offset_1_rad"} <= set(result.identifiable)
    assert why(result, "q_offset_6_rad").why.endswith("the target lies on axis 6")
    assert "measured orientation" in why(result, "alpha_6_rad").why


def test_seven_axes_and_a_prismatic_one():
    rows = [(0.34, 0.0, -RIGHT), (0.0, 0.0, RIGHT), (0.4, 0.0, RIGHT), (0.0, 0.0, -RIGHT), (0.4, 0.0, -RIGHT),
            (0.0, 0.0, RIGHT), (0.13, 0.0, 0.0)]
    jacobian, _, result = analyse(robot_of(rows, ratios=False), orientation=True)
    assert result.kept.sum() == np.linalg.matrix_rank(jacobian / np.linalg.norm(jacobian, axis=0),
                                                      tol=1e-8) == 4 * 7 + 6
    rows = [(0.3, 0.2, RIGHT), (0.2, 0.1, 0.7), (0.1, 0.1, 0.8), (0.1, 0.0, -RIGHT), (0.1, 0.0, RIGHT),
            (0.1, 0.0, 0.0)]
    types = ["revolute", "revolute", "prismatic", "revolute", "revolute", "revolute"]
    _, _, result = analyse(robot_of(rows, types, ratios=False), orientation=True)
    assert result.kept.sum() == 4 * 5 + 2 * 1 + 6  # complete: beta stands for the DH angle of the slide
    assert any("axis 3 slides" in entry.why for entry in result.dropped)


def test_an_axis_that_stands_still_is_named():
    robot = racer_like()
    q = random_joints(robot, 100, 4)
    q[:, 3] = 0.7
    jacobian, layout = stacked_jacobian(robot, q)
    assert still_axes(q) == (4,)
    result = select_identifiable(jacobian, layout.names, keep_first=9, robot=robot, still=still_axes(q))
    assert why(result, "a_4_m").why.endswith("axis 4 stands still in these poses")
    assert why(result, "ratio_4").collides_with == ("q_offset_4_rad",)
    assert "base frame" in why(result, "d_1_m").why and "tool frame" in why(result, "d_6_m").why
    assert len(result.dropped) == np.sum(result.singular_values < 1e-8) > 7


def test_a_parameter_without_effect_is_dropped_and_said_so():
    jacobian, layout = stacked_jacobian(racer_like(), random_joints(racer_like(), 50, 1))
    wider = np.column_stack([jacobian, np.zeros(150)])
    names = (*layout.names, ParameterId("backlash_4.width_rad", axis=4))
    result = select_identifiable(wider, names, keep_first=9)
    reason = why(result, "backlash_4.width_rad").why
    assert reason == "backlash_4.width_rad changes nothing that is measured in these poses"


def test_an_effect_is_given_up_before_the_geometry_it_imitates():
    jacobian, layout = stacked_jacobian(racer_like(), random_joints(racer_like(), 50, 1))
    twin = jacobian[:, layout.names.index("a_2_m")]
    result = select_identifiable(np.column_stack([twin, jacobian]),
                                 (ParameterId("gear_eccentricity_2.first_rad", axis=2), *layout.names))
    assert why(result, "gear_eccentricity_2.first_rad").collides_with == ("a_2_m",)


def test_preference_goes_from_frames_to_effects():
    names = (ParameterId("backlash_1.width_rad"), ParameterId("ratio_1", Group.RATIO, "ratio", 1),
             *(ParameterId(f"q_offset_{k}_rad", Group.OFFSET, "q_offset", k) for k in (2, 1)),
             ParameterId("d_2_m", Group.GEOMETRY, "d", 2),
             ParameterId("alpha_1_rad", Group.GEOMETRY, "alpha", 1),
             ParameterId("session_1.tool_x_m", Group.FRAME, "tool", session=1))
    assert [names[j] for j in preference(names)] == [
        "session_1.tool_x_m", "alpha_1_rad", "d_2_m", "q_offset_1_rad", "q_offset_2_rad", "ratio_1",
        "backlash_1.width_rad"
    ]


def test_fewer_rows_than_columns_keep_no_more_than_the_rows():
    robot = racer_like()
    jacobian, layout = stacked_jacobian(robot, random_joints(robot, 5, 1))
    result = select_identifiable(jacobian, layout.names, keep_first=9, robot=robot)
    assert result.kept.sum() <= 15 and len(result.singular_values) == len(layout.names)


def test_is_deterministic():
    first, second = analyse(racer_like())[2], analyse(racer_like())[2]
    assert first.dropped == second.dropped and first.observability == second.observability
    np.testing.assert_array_equal(first.singular_values, second.singular_values)


def test_order_of_rows_does_not_matter():
    robot = racer_like()
    jacobian, layout = stacked_jacobian(robot, random_joints(robot, 100, 3))
    shuffled = jacobian[np.random.default_rng(2).permutation(len(jacobian))]
    one, other = (select_identifiable(rows, layout.names, keep_first=9, robot=robot)
                  for rows in (jacobian, shuffled))
    assert one.dropped == other.dropped
    np.testing.assert_allclose(one.observability.O1, other.observability.O1, rtol=1e-10)
