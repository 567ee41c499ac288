"""The usual mistakes, made in shipped data: every one is told with the right guess, refused, or proved to be harmless.

No threshold of the checks was chosen on the racer or on series C.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exactarm import cli
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset, read_dataset, write_dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.suspicion import Suspicion, in_order
from exactarm.identify.dynamics import identify_dynamics
from exactarm.identify.evaluate import evaluate_poses
from exactarm.identify.frames import find_frames
from exactarm.identify.gear import identify_gears
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_tracked_motion
from exactarm.simulate.profiles import excitation

DEGREE = np.pi / 180.0


@pytest.fixture(scope="module")
def ur10():
    return load_robot("ur10"), read_dataset(data_path("ur10/series_B.csv"), load_robot("ur10"))


@pytest.fixture(scope="module")
def tx40():
    return load_robot("tx40"), read_dataset(data_path("tx40/motion.parquet"), load_robot("tx40"))


@pytest.fixture(scope="module")
def kr300():
    robot = load_robot("kr300")
    return robot, read_dataset(
        [data_path("kr300/run_A.parquet"), data_path("kr300/run_B.parquet")], robot, "gear_run"
    )


def column(data: Dataset, name: str, change) -> Dataset:
    return replace(data, joints=data.joints | {name: change(data.joints[name].copy())})


def scaled(axes, factor):
    def change(values):
        values[:, axes] *= factor
        return values

    return change


def shifted(axis, by):
    def change(values):
        values[:, axis] += by
        return values

    return change


def order(*axes):
    return lambda values: values[:, [axis - 1 for axis in axes]]


def position(data: Dataset, change) -> Dataset:
    return replace(data, position=change(data.position.copy()))


def quaternion(data: Dataset, change) -> Dataset:
    wxyz = change(Rotation.from_matrix(data.rotation).as_quat()[:, [3, 0, 1, 2]])
    return replace(data, rotation=Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).as_matrix())


def one_cell(value):
    def change(values):
        values[500, 1] = value
        return values

    return change


def other_tool(data: Dataset) -> Dataset:
    robot = load_robot("ur10")
    part = data.select(np.arange(0, len(data), 10))
    base = find_frames(robot, part).base.rotation
    flange = predict_poses(robot, Layout.of(()), data, tangents=False).rotation
    moved = np.where((np.arange(len(data)) >= 700)[:, None], base @ flange @ [0.03, 0.0, 0.02], 0.0)
    return replace(data, position=data.position + moved)


POSES = {
    "degrees as radians": (lambda d: column(d, "q", scaled(slice(None), 1 / DEGREE)),
                           "degrees labelled as radians"),
    "radians as degrees": (
        lambda d: column(d, "q", scaled(slice(None), DEGREE)),
        "radians labelled as degrees",
    ),
    "degrees on one axis": (
        lambda d: column(d, "q", scaled(2, 1 / DEGREE)),
        "degrees labelled as radians on axis 3",
    ),
    "millimetres": (lambda d: position(d, lambda p: 1e3 * p), "millimetres labelled as metres"),
    "metres as millimetres": (lambda d: position(d, lambda p: 1e-3 * p), "metres labelled as millimetres"),
    "one column in millimetres": (
        lambda d: position(d, lambda p: p * [1, 1, 1e3]),
        "millimetres labelled as metres in z",
    ),
    "axes 5 and 6 exchanged": (lambda d: column(d, "q", order(1, 2, 3, 4, 6, 5)), "axes 5 and 6 exchanged"),
    "axes 1 and 2 exchanged": (lambda d: column(d, "q", order(2, 1, 3, 4, 5, 6)), "axes 1 and 2 exchanged"),
    "reverse order": (lambda d: column(d, "q", order(6, 5, 4, 3, 2, 1)), "all axes in reverse order"),
    "one column further": (
        lambda d: column(d, "q", order(2, 3, 4, 5, 6, 1)),
        "all axes one column further on",
    ),
    "sign of one axis": (lambda d: column(d, "q", scaled(4, -1)), "the opposite sign of axis 5"),
    "sign of the last axis": (lambda d: column(d, "q", scaled(5, -1)), "the opposite sign of axis 6"),
    "signs of two axes": (lambda d: column(d, "q", scaled([3, 5], -1)), "the opposite sign of axes 4 and 6"),
    "another zero": (
        lambda d: column(d, "q", shifted(1, np.pi / 2)),
        "another zero of axis 2 (by -90 degrees)",
    ),
    "coupled axes": (
        lambda d: column(d, "q", lambda q: q + np.eye(6)[2] * q[:, [1]]),
        "axis 3 counted from axis 2",
    ),
    "a gear ratio 10 % wrong": (lambda d: column(d, "q", scaled(2, 1.1)), "axis 3 turning 0.909"),
    "x and y exchanged": (
        lambda d: position(d, lambda p: p[:, [1, 0, 2]]),
        "one of x, y, z with the opposite sign, or two",
    ),
    "y negated": (
        lambda d: position(d, lambda p: p * [1, -1, 1]),
        "one of x, y, z with the opposite sign, or two",
    ),
    "conjugate quaternion": (
        lambda d: quaternion(d, lambda w: w * [1, -1, -1, -1]),
        "a conjugate quaternion",
    ),
    "quaternion x, y, z, w": (
        lambda d: quaternion(d, lambda w: w[:, [1, 2, 3, 0]]),
        "a quaternion in the order x, y, z, w",
    ),
    "shuffled quaternions": (
        lambda d: replace(d, rotation=np.random.default_rng(1).permutation(d.rotation)),
        "orientations do not follow",
    ),
    "rows one later": (
        lambda d: position(d, lambda p: np.roll(p, 1, axis=0)),
        "positions one row later than the angles",
    ),
    "an arm of another size": (
        lambda d: position(d, lambda p: 1.2 * p),
        "the file of an arm 0.833 times as large",
    ),
    "the tool changed halfway": (other_tool, "from about row 70"),
    "a gross error": (lambda d: position(d, one_cell(40.0)), "in row 501"),
    "a cell of 1e20": (lambda d: column(d, "q", one_cell(1e20)), "row 501"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", POSES)
def test_a_mistake_in_poses_is_told(ur10, name):
    robot, data = ur10
    change, words = POSES[name]
    found = first_aid(robot, change(data))
    assert found and any(words in line for line in found), found


def test_the_file_of_another_robot_is_told_by_name(ur10):
    _, data = ur10
    assert "with data of ur10 the data would fit" in first_aid(load_robot("tx40"), data)[0]


@pytest.mark.slow
def test_effects_that_need_masses_are_not_asked_of_an_arm_without_any(ur10):
    robot = load_robot("ur10")
    loaded = replace(robot, effects=(effect_from_table({"effect": "base_compliance", "rad_per_Nm": 1e-6}),))
    assert first_aid(loaded, read_dataset([str(data_path("ur10/series_B.csv"))], robot)) == ()


def test_gravity_means_nothing_to_poses_of_a_rigid_arm(ur10):
    robot, data = ur10
    up = replace(robot, gravity=-robot.gravity)
    part = data.select(np.arange(0, len(data), 20))
    assert all(joint.spring_linear is None for joint in robot.joints)
    assert evaluate_poses(up, part).overall == evaluate_poses(robot, part).overall


def test_the_order_of_rows_means_nothing_to_poses(ur10):
    robot, data = ur10
    part = data.select(np.arange(0, len(data), 20))
    shuffled = part.select(np.random.default_rng(2).permutation(len(part)))
    assert evaluate_poses(robot, shuffled).overall.rms == pytest.approx(
        evaluate_poses(robot, part).overall.rms, rel=1e-9
    )


MOTION = {
    "degrees as radians": (
        lambda d: column(d, "theta", scaled(slice(None), 1 / DEGREE)),
        "degrees labelled as radians",
    ),
    "radians as degrees": (
        lambda d: column(d, "theta", scaled(slice(None), DEGREE)),
        "radians labelled as degrees",
    ),
    "angles exchanged": (
        lambda d: column(d, "theta", order(1, 3, 2, 4, 5, 6)),
        "the angles of axes 2 and 3 exchanged",
    ),
    "torques exchanged": (
        lambda d: column(d, "tau_motor", order(2, 1, 3, 4, 5, 6)),
        "of axes 1 and 2 exchanged",
    ),
    "sign of an angle": (lambda d: column(d, "theta", scaled(1, -1)), "the friction of axis 2 drives"),
    "sign of a torque": (lambda d: column(d, "tau_motor", scaled(4, -1)), "the friction of axis 5 drives"),
    "sign of all torques": (
        lambda d: column(d, "tau_motor", scaled(slice(None), -1)),
        "do the torques have the opposite sign",
    ),
    "millinewton metres": (
        lambda d: column(d, "tau_motor", scaled(slice(None), 1e3)),
        "in another unit (mNm",
    ),
    "milliseconds as seconds": (lambda d: replace(d, time=1e3 * d.time), "is the time in milliseconds"),
    "seconds as milliseconds": (
        lambda d: replace(d, time=1e-3 * d.time),
        "a time in seconds labelled as milliseconds",
    ),
    "a cell of 1e20": (lambda d: column(d, "tau_motor", one_cell(1e20)), "row 501"),
    "a torque that was never measured": (
        lambda d: column(d, "tau_motor", scaled(2, 0.0)),
        "tau_motor_3 is 0 Nm in every row",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTION)
def test_a_mistake_in_a_motion_is_told(tx40, name):
    robot, data = tx40
    change, words = MOTION[name]
    found = first_aid(robot, change(data))
    assert found and any(words in line for line in found), found


def test_gravity_that_points_up_is_told(tx40):
    robot, data = tx40
    assert "gravity pointing the other way" in first_aid(replace(robot, gravity=-robot.gravity), data)[0]


GEAR = {
    "motor and link exchanged": (
        lambda d: replace(
            d,
            joints=d.joints
            | {
                "theta": np.where(np.arange(6) == 0, d.joints["q"], d.joints["theta"]),
                "q": np.where(np.arange(6) == 0, d.joints["theta"], d.joints["q"]),
            },
        ),
        "are the columns theta_1 and q_1 exchanged?",
    ),
    "link in degrees": (lambda d: column(d, "q", scaled(1, 1 / DEGREE)), "is q in degrees"),
    "opposite sign": (lambda d: column(d, "q", scaled(2, -1)), "axis 3: theta_3 goes"),
    "a ratio 10 % wrong": (
        lambda d: column(d, "theta", scaled(0, 1.1)),
        "is the ratio in the robot file that of this arm?",
    ),
}


@pytest.mark.parametrize("name", GEAR)
def test_a_mistake_between_encoders_is_told(kr300, name):
    robot, data = kr300
    change, words = GEAR[name]
    found = first_aid(robot, change(data))
    assert found and words in found[-1], found


@pytest.fixture(scope="module")
def tracked():
    robot = load_robot("racer-7-1.4")
    virtual = VirtualRobot.of(robot)
    time, q = excitation(robot, 10.0, 100.0, np.random.default_rng(6))
    return robot, measure_tracked_motion(
        virtual, time, virtual.motor_angles(q), Sensors(), np.random.default_rng(7), quasi_static=True
    )


@pytest.mark.parametrize(
    "share, words", [(1.0, ""), (1.01, "does its clock run"), (0.99, "does its clock run")]
)
def test_a_clock_that_drifts_is_told(tracked, share, words):
    robot, data = tracked
    late = np.stack([np.interp(share * data.time, data.time, data.position[:, k]) for k in range(3)], axis=1)
    found = first_aid(robot, replace(data, position=late) if words else data)
    assert any(words in line for line in found) if words else found == ()


@pytest.mark.parametrize(
    "files", [["ur10/series_B.csv"], ["ur10/series_C.parquet"], ["ur10/series_B.csv", "ur10/series_C.parquet"]]
)
def test_good_poses_are_not_suspected(files):
    robot = load_robot("ur10")
    assert first_aid(robot, read_dataset([data_path(file) for file in files], robot)) == ()


def test_good_series_are_not_suspected(tx40, kr300):
    assert first_aid(*tx40) == () and first_aid(*kr300) == ()


def test_a_warning_stands_in_result_and_report_and_nothing_is_corrected(ur10, tmp_path, capsys):
    robot, data = ur10
    wrong = position(data, one_cell(-3.0))
    write_dataset(tmp_path / "poses.csv", wrong, robot)
    assert cli.main(["evaluate", "ur10", str(tmp_path / "poses.csv"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "warning: with a gross error of" in told and "in row 501" in " ".join(told.split())
    assert "gross error" in (tmp_path / "out/result.json").read_text()
    assert "gross error" in (tmp_path / "out/report.html").read_text()


@pytest.mark.slow
def test_a_refusal_says_what_is_suspected(kr300, tmp_path, capsys):
    robot, data = kr300
    swapped = GEAR["motor and link exchanged"][0](data)
    write_dataset(tmp_path / "runs.csv", swapped, robot)
    words = [
        "gear",
        "kr300",
        str(tmp_path / "runs.csv"),
        "--kind",
        "gear_run",
        "--out",
        str(tmp_path / "out"),
        "--quiet",
    ]
    code = cli.main(words)
    told = (
        capsys.readouterr().err + (tmp_path / "out/result.json").read_text()
        if code == 0
        else capsys.readouterr().err
    )
    assert "are the columns theta_1 and q_1 exchanged?" in told


def test_data_that_no_check_can_read_are_left_to_the_command():
    robot = load_robot("ur10")
    few = Dataset.of_arrays("poses", {"q": np.zeros((3, 6))}, position=np.zeros((3, 3)))
    assert first_aid(robot, few) == ()
    with pytest.raises(InputError):
        evaluate_poses(robot, few)


def test_of_mistakes_that_explain_as_much_the_first_is_named():
    found = in_order([Suspicion("simple", 90.0), Suspicion("odd", 100.0), Suspicion("weak", 4.0)])
    assert [each.words for each in found] == ["simple", "odd", "weak"] and in_order([]) == []
    assert "90 times better" in found[0].text and "without a rest" in Suspicion("x", 1e9).text
    assert axes_in_words([0]) == "axis 1" and axes_in_words([0, 2, 5]) == "axes 1, 3 and 6"


def test_an_axis_that_stands_still_is_said(kr300):
    robot, data = kr300
    still = column(column(data, "theta", scaled(0, 0.0)), "q", scaled(0, 0.0))
    found = identify_gears(robot, still).warnings
    assert found[0] == "axis 1 stands still beside the others in these runs: its gear is left as declared"


def test_a_run_of_one_row_is_refused_by_its_number(kr300, tmp_path):
    robot, data = kr300
    write_dataset(tmp_path / "runs.csv", replace(data.select(np.arange(40)), run=np.arange(1, 41)), robot)
    with pytest.raises(InputError, match="runs.csv, row 1, column run: run 1 has 1 rows; expected at least 8 samples"):
        read_dataset(tmp_path / "runs.csv", robot, "gear_run")


def test_torques_of_an_arm_without_geometry_prove_nothing(kr300):
    robot, data = kr300
    for work in (diagnose, identify_dynamics):
        with pytest.raises(InputError, match="expected a declared geometry, found drives only"):
            work(robot, replace(data, kind="motion"))


@pytest.mark.parametrize("command", ["evaluate", "calibrate"])
def test_a_cell_that_no_device_measures_is_refused(ur10, tmp_path, capsys, command):
    robot, data = ur10
    write_dataset(tmp_path / "poses.csv", position(data, one_cell(1e20)), robot)
    assert cli.main([command, "ur10", str(tmp_path / "poses.csv"), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    assert "poses.csv, row 501, column y_m: 1e+20 in SI units; expected at most 1e+06" in capsys.readouterr().err
