"""The robots and data that come with the package, against the numbers of their sources."""

import numpy as np
import pandas as pd
import pytest

from exactarm import _core
from exactarm.data.dataset import read_dataset, read_planned_poses
from exactarm.errors import InputError
from exactarm.files.examples import data_path, example
from exactarm.robot_file import load_robot, shipped_robots, write_robot

RACER = load_robot("racer-7-1.4")


def table(name: str) -> pd.DataFrame:
    return pd.read_csv(data_path(f"racer/{name}.csv"))


def column(field: str, robot=RACER) -> list:
    return [getattr(joint, field) for joint in robot.joints]


def test_these_robots_are_shipped():
    assert shipped_robots() == ("gen3lite", "kr300", "panda", "racer-7-1.4", "tx40", "ur10")


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_files_are_as_the_writer_writes_them(tmp_path, name):
    write_robot(tmp_path / "again.toml", load_robot(name))
    assert load_robot(tmp_path / "again.toml").core.axes == (7 if name == "panda" else 6)
    shipped = data_path().parent / "robots" / f"{name}.toml"
    assert (tmp_path / "again.toml").read_text() == shipped.read_text()


@pytest.mark.parametrize("name", ("panda", "gen3lite"))
def test_arms_from_their_makers_descriptions_stand_as_those_say(name):
    described, shipped = load_robot(data_path(f"ball_in_socket/{name}.urdf")), load_robot(name)
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (20, shipped.axes))
    for one, other in zip(_core.forward_kinematics(described.core, q),
                          _core.forward_kinematics(shipped.core, q)):
        np.testing.assert_array_equal(one, other)


# -- Racer -------------------------------------------------------------------------------------------
def test_racer_reproduces_the_pose_of_E1():
    q = np.deg2rad([[0.0, 90.0, 0.0, 0.0, 90.0, 0.0]])
    position, rotation = _core.forward_kinematics(RACER.core, q)
    np.testing.assert_allclose(rotation[0], np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
    np.testing.assert_allclose(position[0], [0.834, 0.0, 1.25], atol=1e-12)


def test_all_poses_of_the_thesis_are_above_the_floor():
    poses = read_planned_poses(data_path("racer/thesis_poses.csv"), RACER)
    q = poses.joints["theta"] / RACER.ratios + RACER.offsets
    position, _ = _core.forward_kinematics(RACER.core, q)
    assert len(poses) == 50
    np.testing.assert_allclose(position[:, 2].min(), 0.289, atol=5e-4)
    assert (q >= np.array(column("q_min")) - 1e-3).all() and (q <= np.array(column("q_max")) + 1e-3).all()


def test_racer_geometry_and_limits():
    mdh = table("mdh")
    for field, name in (("a", "a_m"), ("alpha", "alpha_rad"), ("q_offset", "q_offset_rad")):
        np.testing.assert_array_equal(column(field), mdh[name])
    np.testing.assert_array_equal(column("d"), mdh["d_m"].fillna(0.0))
    assert [beta is None for beta in column("beta")] == list(mdh["beta_rad"].isna())
    limits = {"q_min": "q_min_deg", "q_max": "q_max_deg", "q_dot_max": "qdot_max_deg_s",
              "q_ddot_max": "qddot_max_deg_s2"}
    for field, name in limits.items():
        np.testing.assert_allclose(column(field), np.deg2rad(mdh[name]), rtol=1e-15)
    np.testing.assert_array_equal(column("torque_max"), mdh["motor_torque_limit_link_side_Nm"])


def test_racer_gears_springs_and_drives():
    np.testing.assert_array_equal(column("ratio"), table("gear_ratio")["ratio"])
    harmonics = table("gear_harmonics")
    for number, joint in enumerate(RACER.joints, start=1):
        for direction in ("cw", "ccw"):
            rows = harmonics[(harmonics.joint == number) & (harmonics.direction == direction)]
            gear = getattr(joint, direction)
            if rows.empty:
                assert gear is None
                continue
            np.testing.assert_array_equal(gear.order, rows["order_per_link_rev"])
            np.testing.assert_array_equal(gear.a, rows["a_rel"])
            np.testing.assert_array_equal(gear.b, rows["b_rel"])
    drive = table("drive")
    fields = ("spring_linear", "spring_cubic", "rotor_inertia", "coulomb", "viscous")
    for field, name in zip(fields, drive.columns[1:]):
        np.testing.assert_array_equal(column(field), drive[name])


def test_racer_masses():
    for link, row in zip(RACER.links, table("inertials").itertuples(), strict=True):
        assert link.mass == row.mass_kg
        np.testing.assert_array_equal(link.centre_of_mass, [row.com_x_m, row.com_y_m, row.com_z_m])
        upper = [row.ixx_kg_m2, row.ixy_kg_m2, row.ixz_kg_m2, row.iyy_kg_m2, row.iyz_kg_m2, row.izz_kg_m2]
        np.testing.assert_array_equal(link.inertia[np.triu_indices(3)], upper)
        assert (np.linalg.eigvalsh(link.inertia) > 0).all()


# -- the others --------------------------------------------------------------------------------------
def test_ur10_is_the_published_one():
    robot = load_robot("ur10")
    np.testing.assert_allclose(column("d", robot), [0.1273, 0, 0, 0.163941, 0.1157, 0.0922], atol=1e-12)
    np.testing.assert_allclose(column("a", robot), [0, -0.612, -0.5723, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(column("alpha", robot)), [90, 0, 0, 90, -90, 0], atol=1e-12)
    # Axes 2, 3 and 4 are parallel: the frames between them are Hayati's.
    assert [beta is not None for beta in column("beta", robot)] == [False, True, True, False, False, False]
    assert [link.mass for link in robot.links] == [7.1, 12.7, 4.27, 2.0, 2.0, 0.365]
    assert robot.joints[0].ratio is None


def test_ur10_agrees_with_its_tracker_to_a_few_millimetres():
    robot = load_robot("ur10")
    data = read_dataset([example(f"ur10/series_{name}") for name in "BC"], robot)
    assert data.kinds == ("poses",) and list(np.unique(data.session)) == [2, 3] and len(data) == 4268
    position, _ = _core.forward_kinematics(robot.core, data.joints["q"])
    # Distances between positions do not depend on where tracker and robot stand; the probe does, a little.
    apart = np.linalg.norm(np.diff(position[:1495], axis=0),
                           axis=1) - np.linalg.norm(np.diff(data.position[:1495], axis=0), axis=1)
    assert np.median(np.abs(apart)) < 0.05
    assert np.isfinite(data.rotation).all() and "temperature_degC" in data.covariates


def test_kr300_joints_follow_its_motors():
    robot = load_robot("kr300")
    assert not robot.has_geometry
    runs = read_dataset([example(f"kr300/run_{name}") for name in "AB"], robot)
    assert runs.kinds == ("gear_run", "motion") and list(np.unique(runs.run)) == [1, 2]
    error = (runs.joints["q"] - runs.joints["theta"] / robot.ratios)[:, :3]
    assert np.isnan(runs.joints["q"][:, 3:]).all()
    for run in (1, 2):
        part = error[runs.run == run]
        assert (np.std(part, axis=0) < 1e-3).all()


def test_tx40_is_the_described_one():
    robot = load_robot("tx40")
    np.testing.assert_array_equal(robot.ratios, [32, 32, 45, -48, 45, 32])
    np.testing.assert_allclose(np.rad2deg(robot.offsets), [0, -90, 90, 0, 0, 0], atol=1e-12)
    assert robot.effects == ()
    offsets = [(0, 0, 0.32), (0, 0, 0), (0.225, 0, 0.035), (0, -0.225, 0), (0, 0, 0), (0, 0, 0)]
    turns = [(0, 0, 0), (-90, 0, 0), (0, 0, 0), (90, 0, 0), (-90, 0, 0), (90, 180, 0)]
    for q in np.random.default_rng(5).uniform(-3, 3, (20, 6)):
        place = np.eye(4)
        for offset, (roll, pitch, yaw), angle in zip(offsets, np.deg2rad(turns), q):
            for axis, turn in ((2, yaw), (1, pitch), (0, roll)):
                place = place @ (shift(offset) if axis == 2 else np.eye(4)) @ rotation(axis, turn)
            place = place @ rotation(2, angle)
        position, found = _core.forward_kinematics(robot.core, q[None])
        np.testing.assert_allclose(position[0], place[:3, 3], atol=1e-12)
        np.testing.assert_allclose(found[0], place[:3, :3], atol=1e-12)


def shift(offset) -> np.ndarray:
    out = np.eye(4)
    out[:3, 3] = offset
    return out


def rotation(axis: int, angle: float) -> np.ndarray:
    out = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out[i, i] = out[j, j] = np.cos(angle)
    out[j, i], out[i, j] = np.sin(angle), -np.sin(angle)
    return out


def test_tx40_motion_is_a_motion():
    data = read_dataset(data_path("tx40/motion.parquet"), load_robot("tx40"))
    assert data.kinds == ("motion",) and len(data) == 45000


def test_shipped_data_carry_their_licences():
    for name in ("ur10/LICENSE.md", "kr300/LICENSE", "tx40/LICENSE", "README.md"):
        assert data_path(name).stat().st_size > 300
    with pytest.raises(InputError, match="ur10/series_B.csv"):
        data_path("ur5")


def digits_of(values, count):
    """The same numbers, read again from their first `count` significant digits."""
    return np.array([float(f"{value:.{count}g}") for value in values])


@pytest.mark.parametrize("name, count", [("kr300/run_A", 8), ("kr300/run_B", 8), ("ur10/series_C", 8)])
def test_parquet_holds_the_decimals_of_the_source(name, count):
    table = pd.read_parquet(example(name))
    for column in table.columns:
        values = table[column].to_numpy(float)
        np.testing.assert_array_equal(digits_of(values, count), values)


@pytest.mark.slow
def test_single_precision_gives_the_five_digits_of_the_motion_back():
    """Half a step of the fifth digit is at least 5e-6 of a number; single precision keeps 6e-8."""
    table = pd.read_parquet(example("tx40/motion"))
    singles = [column for column in table.columns if table[column].dtype == np.float32]
    assert len(singles) == 12 and table["time_s"].dtype == np.float64
    for column in singles:
        values = table[column].to_numpy()
        np.testing.assert_array_equal(digits_of(values, 5).astype(np.float32), values)


def test_the_examples_are_small():
    assert sum(path.stat().st_size for path in data_path().rglob("*")) < 2.5e6
