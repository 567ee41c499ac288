"""A camera and a flat board: lens and derivatives, no starting values, calibration, pictures with one error
each, wrong corners, files."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout
from exactarm.cli import main
from exactarm.data.dataset import Dataset, dataset_columns, read_dataset
from exactarm.data.fixture import CameraSetup, Fixture, load_fixture
from exactarm.diagnose.closure_problem import ClosureProblem
from exactarm.errors import InputError
from exactarm.files.table import write_table
from exactarm.first_aid.first_aid import first_aid
from exactarm.identify.calibrate import CalibrationOptions
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.declared import geometry_layout
from exactarm.identify.evaluate import evaluate_closures, evaluate_poses
from exactarm.measurement.board_pictures import gross_corners, two_frames
from exactarm.measurement.camera import Camera
from exactarm.measurement.closures import noise_classes, predict_closures, touches
from exactarm.measurement.lens import project, undistorted
from exactarm.measurement.pictures import SHARED
from exactarm.numerics.rotation import exp
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.closures import fixture_text, measure_closures
from exactarm.simulate.pictures import SETUP, TRUE_LENS
from exactarm.simulate.profiles import limit
from spoiled_rows import HEADER, PANDA, POSE, assert_refused
from test_closures import covered, virtual

NOISE_RAD = 7e-5  # a tenth of a pixel
SENSE = Sensors(position_m=5e-5, orientation_rad=NOISE_RAD, counts=0)
ALONE = CalibrationOptions(compliance=())
LENS = "[board]\nsquares = [9, 7]\nsquare_mm = 25\n[camera]\nsize_px = [1600, 1200]\n"
BENT = np.array([1400.0, 1390.0, 790.0, 610.0, -0.2, 0.1, 3e-3, -2e-3, 0.02])


def points(count: int = 40) -> np.ndarray:
    random = np.random.default_rng(1)
    depth = random.uniform(0.3, 0.8, (count, 1))
    return np.concatenate([random.uniform(-0.4, 0.4, (count, 2)) * depth, depth], axis=1)


def pictures(name: str, seed: int, count: int, places: int = 1, wobble_rad: float = 0.0, setup=SETUP,
             wrong: float = 0.0) -> tuple[VirtualRobot, Dataset]:
    """wobble_rad: how badly each pose of the arm repeats, one error for all corners of a picture."""
    robot, random = virtual(name, seed)
    sense = replace(SENSE, wrong_rows=wrong)
    data = measure_closures(robot, "camera", places, count, sense, random, setup)[0]
    keys = np.stack([data.session, data.picture], axis=1)
    picture = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    turned = random.normal(0.0, wobble_rad, (picture.max() + 1, data.axes))[picture]
    angle = next(name for name in ("theta", "q") if name in data.joints)
    by = robot.nominal.ratios if angle == "theta" else 1.0
    return robot, replace(data, joints=data.joints | {angle: data.joints[angle] + turned * by})


def test_a_lens_has_the_right_derivatives_and_inverse():
    seen = points()
    pixels, by_point, by_lens = project(seen, BENT)
    for k in range(3):
        at = lambda x, k=k: project(seen + x[0] * np.eye(3)[k], BENT)[0]
        assert_derivative(at, np.zeros(1), by_point[:, :, [k]], 1e-4)
    assert_derivative(lambda lens: project(seen, lens)[0], BENT, by_lens, np.array([1.0] * 4 + [1e-3] * 5))
    np.testing.assert_allclose(undistorted(pixels, BENT), seen[:, :2] / seen[:, 2:], atol=1e-9)


def test_a_strong_lens_is_inverted_and_a_folded_one_has_no_ray():
    strong = np.array([1400.0, 1400.0, 800.0, 600.0, 5.0, 100.0, 0.0, 0.0, 0.0])
    flat = undistorted(np.array([[0.0, 0.0], [1599.0, 600.0]]), strong)
    seen = project(np.column_stack([flat, np.ones(2)]), strong)[0]
    np.testing.assert_allclose(seen, [[0.0, 0.0], [1599.0, 600.0]], atol=1e-6)
    folded = np.array([1400.0, 1400.0, 800.0, 600.0, -5.0, 0.0, 0.0, 0.0, 0.0])  # x g has its largest value
    assert np.isnan(undistorted(np.array([[1599.0, 1199.0]]), folded)).all()  # at 0.26: 364 pixels


def test_corners_outside_of_the_picture_or_of_the_lens_are_refused():
    robot, data = pictures("panda", 3, 4)
    folded = (1400.0, 1400.0, 800.0, 600.0, -5.0, 0.0, 0.0, 0.0, 0.0)
    for setup, words in ((replace(SETUP, size=(1200, 1600)), "row .*outside of a picture of 1200 by 1600"),
                         (replace(SETUP, lens=folded), "row .*no ray through the lens")):
        with pytest.raises(InputError, match=words):
            evaluate_closures(robot.nominal, replace(data, fixture=Fixture(camera=setup)))


def test_a_lens_agrees_with_opencv():
    cv2 = pytest.importorskip("cv2")
    fx, fy, cx, cy = BENT[:4]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    theirs = cv2.projectPoints(points(), np.zeros(3), np.zeros(3), matrix, BENT[4:])[0][:, 0]
    np.testing.assert_allclose(project(points(), BENT)[0], theirs, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("on_flange", [True, False])
def test_derivatives_by_every_parameter_agree_with_differences(on_flange):
    random = np.random.default_rng(5)
    rows = lambda turn: tuple(tuple(map(float, row)) for row in exp(np.array(turn)))
    setup = replace(SETUP, on_flange=on_flange)
    camera = Camera(None, (), 1, 0, setup=setup, mount=rows([0.4, -0.3, 0.2]),
                    world=rows([2.9, 0.3, 0.2] if on_flange else [0.1, 0.2, 0.2]), focal=1400.0)
    values = [*random.normal(0, 0.1, 6), *random.normal(0, 0.1, 3), 0.3, 0.1, -1.5, 0.025, *BENT]
    layout = Layout.of((camera.with_values(values),)).joined(geometry_layout(PANDA))
    data = Dataset.of_arrays(
        "closures", {"q": np.repeat(random.uniform(-0.3, 0.3, (3, 7)), 4, axis=0)},
        contacts={"camera": np.zeros(12, int)}, pixel=np.zeros((12, 2)), picture=np.repeat(np.arange(3), 4),
        corner=np.tile([0, 7, 20, 47], 3),
    )
    prediction = predict_closures(PANDA, layout, data)
    assert prediction.pictures.depth.min() > 0.1  # before the lens
    back = lambda each, values: each.pictures.turned(values, back=True)[:, :2]

    def at(x):
        each = predict_closures(PANDA, layout.at(x), data, tangents=False)
        return back(each, each.residual)

    assert_derivative(at, layout.values, -back(prediction, prediction.jacobian), 1e-4, relative=1e-6)


def test_where_camera_and_board_are_is_told_whole():
    """The rotation vectors among the parameters count from a start."""
    turned = tuple(map(tuple, exp(np.array([0.4, -0.3, 0.2])).tolist()))
    values = [0.1, 0.2, -0.1, 0.01, 0.02, 0.03, *[0.0] * 3, 0.5, 0.6, 0.7, 0.025, *BENT]
    for on_flange, names in ((True, ["camera on the flange", "board in the base"]),
                             (False, ["board on the flange", "camera in the base"])):
        camera = Camera(None, tuple(values), setup=replace(SETUP, on_flange=on_flange), mount=turned)
        told = camera.placements()
        assert list(told) == names
        rotation, place = told[names[0]]
        np.testing.assert_allclose(rotation, exp(np.array(values[:3])) @ np.array(turned), atol=1e-15)
        assert place.tolist() == values[3:6] and told[names[1]][1].tolist() == values[9:12]


def test_two_frames_follow_without_starting_values():
    random = np.random.default_rng(2)
    targets = exp(random.normal(0.0, 1.0, (6, 3))), random.normal(0.0, 0.5, (6, 3))
    mount, world = ((exp(random.normal(0.0, 1.0, 3)), random.normal(0.0, 0.3, 3)) for _ in range(2))
    rotation = world[0].T @ targets[0] @ mount[0]
    place = (targets[1] + targets[0] @ mount[1] - world[1]) @ world[0]
    found = two_frames(targets, (rotation, place))
    for each, true in zip(found, (mount, world)):
        np.testing.assert_allclose(each[0], true[0], atol=1e-9)
        np.testing.assert_allclose(each[1], true[1], atol=1e-9)
    assert found[2] < 1e-9


def test_what_corners_share_is_turned_into_six_numbers_and_nothing_is_lost():
    robot, data = pictures("panda", 3, 4)
    data = touches(replace(data, fixture=Fixture(camera=SETUP)))
    camera = Camera(None, (), 1, 0).started(
        predict_closures(robot.nominal, Layout.of(()), data, tangents=False).view, np.arange(len(data)))
    prediction = predict_closures(robot.nominal, Layout.of((camera,)), data, tangents=False)
    assert np.sum(prediction.residual**2) == pytest.approx(
        np.sum((prediction.seen[:, :2] / prediction.pictures.depth[:, None]) ** 2))
    moved = np.repeat(np.random.default_rng(0).normal(0.0, 1e-4, (4, 6)), np.bincount(data.picture), axis=0)
    numbers = prediction.through(moved[:, :, None])[:, :2, 0]
    shared = np.isin(noise_classes(data), SHARED)
    assert shared.sum() == 4 * 3
    assert np.abs(numbers[~shared]).max() < 1e-9 < 1e-5 < np.abs(numbers[shared]).max()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed", "given", "on_flange"), [
    ("ur10", 3, False, True), ("panda", 5, True, True), ("ur10", 6, False, False)])
def test_pictures_of_a_board_calibrate_the_arm_and_its_scale(name, seed, given, on_flange):
    """Corners never seen are met to some tenths of a pixel; a tracker agrees over the whole work space."""
    setup = replace(SETUP, on_flange=on_flange, lens=TRUE_LENS if given else None, lens_given=given)
    robot, data = pictures(name, seed, 40, wobble_rad=2e-5, setup=setup)
    result = calibrate_closures(robot.nominal, data, ALONE)
    assert result.fit.fit.converged and not result.warnings
    assert result.beside_before["validation"]["reprojection_px"] > 1.5
    # two numbers of 0.1 px, and what the arm does not repeat
    assert result.beside_after["validation"]["reprojection_px"] < 0.35
    assert np.mean(covered(robot, result)) >= 0.8
    random, true = np.random.default_rng(1), robot.true
    q = random.uniform(limit(true, "q_min"), limit(true, "q_max"), (60, true.axes))
    judge = measure_poses(VirtualRobot(robot.nominal, true), q, Sensors(position_m=1e-6, counts=0), random)
    nominal, after = (evaluate_poses(arm, judge).overall.mean for arm in (robot.nominal, result.robot))
    assert after < 0.25e-3 < 1e-3 < nominal
    again = evaluate_closures(result.robot, data)
    assert again.unit == "m" and again.pixels < 0.35


@pytest.mark.slow
def test_intervals_cover_where_all_corners_of_a_picture_share_the_arm_s_error():
    """Six arms that repeat to 3e-5 rad: forty corners of a picture are one pose, not forty."""
    inside = []
    for seed in range(31, 37):
        robot, data = pictures("ur10", seed, 30, wobble_rad=3e-5)
        data = replace(data, identification=np.ones(len(data), bool))
        inside += covered(robot, calibrate_closures(robot.nominal, data, ALONE))
    assert len(inside) >= 100 and 0.88 <= np.mean(inside) <= 1.0  # 100 of 95 %: below 0.88 once in 500


def test_wrongly_found_corners_are_left_out_and_counted():
    random = np.random.default_rng(3)
    board = SETUP.square * SETUP.corner(np.arange(48))[:, :2]
    seen = project(np.column_stack([board - 0.1, np.full(48, 0.4) + 0.3 * board[:, 0]]), BENT)[0]
    seen += random.normal(0.0, 0.1, seen.shape)
    assert not gross_corners(board, seen).any()
    wrong = [5, 17, 30]
    seen[wrong] += [[9.0, 2.0], [-6.0, 14.0], [3.0, -8.0]]
    np.testing.assert_array_equal(np.flatnonzero(gross_corners(board, seen)), wrong)


@pytest.mark.slow
def test_a_file_of_corners_is_read_back(tmp_path):
    robot, data = pictures("panda", 1, 3)
    write_table(tmp_path / "rows.csv", dataset_columns(data, robot.nominal))
    again = read_dataset(tmp_path / "rows.csv", robot.nominal)
    np.testing.assert_allclose(again.pixel, data.pixel, rtol=1e-12)
    np.testing.assert_array_equal(again.corner, data.corner)
    assert again.kind == "closures" and set(np.unique(again.picture)) == set(range(3))


def test_a_fixture_file_of_the_camera_is_read_back(tmp_path):
    (tmp_path / "fixture.toml").write_text(fixture_text(Fixture(camera=SETUP)))
    assert load_fixture(tmp_path / "fixture.toml").camera == SETUP
    (tmp_path / "fixture.toml").write_text(
        "[board]\nsquares = [9, 7]\nsquare_mm = 25\n[camera]\nfocal_px = [900, 901.5]\n"
        "centre_px = [400, 300]\ndistortion = [0.1, 0, 0, 0]\ngiven = true\n")
    camera = load_fixture(tmp_path / "fixture.toml").camera
    assert camera.lens == (900.0, 901.5, 400.0, 300.0, 0.1, 0.0, 0.0, 0.0, 0.0) and camera.lens_given


@pytest.mark.parametrize(("text", "words"), [
    ("[camera]\nsize_px = [640, 480]", r"\[camera\] without \[board\]"),
    ("[board]\nsquares = [9]\nsquare_mm = 25", "squares = .9.; expected columns and rows"),
    ("[board]\nsquares = [9, 7]", "square_mm missing"),
    ("board = 3", "board is no table"),
    ("[board]\nsquares = [9, 7]\nsquare_mm = 25\n[camera]\ngiven = true", "focal_px missing"),
    ("[board]\nsquares = [9, 7]\nsquare_mm = 25\n[camera]\non = 'table'", "expected \"flange\" or \"stand\""),
    ("[board]\nsquares = [9, 7]\nsquare_mm = 25\nsize = 2", "unknown key size"),
    ("[board]\nsquares = [9, 1000000]\nsquare_mm = 25", "at most 1000"),
    ("[board]\nsquares = [9, 7]\nsquare_mm = 1e300", "a length above 0 in mm, 1e-06 to 1e.06"),
    (f"{LENS}focal_px = [0, 1400.0]", "expected fx and fy above 1"),
    (f"{LENS}focal_px = [4.0, 4.0]", "for a picture 1600 px wide; expected pixels"),
    (f"{LENS}focal_px = [-1400.0, -1400.0]", "expected fx and fy above 1"),
    (f"{LENS}focal_px = [nan, 1400.0]", "expected fx and fy above 1"),
    (f"{LENS}focal_px = [1400.0, 1400.0]\ncentre_px = [800.0, 1e300]", "expected cx and cy"),
    (f"{LENS}focal_px = [1400.0, 1400.0]\ndistortion = [inf, 0.0, 0.0, 0.0]", "none beyond 1000"),
])
def test_a_wrong_fixture_is_refused_with_the_reason(tmp_path, text, words):
    (tmp_path / "fixture.toml").write_text(text)
    with pytest.raises(InputError, match=words):
        load_fixture(tmp_path / "fixture.toml")


@pytest.mark.parametrize(("text", "words"), [
    (f"u_px,v_px,corner,{HEADER}\n1,2,3,{POSE}\n", "picture: column missing; expected it beside column u_px"),
    (f"u_px,v_px,corner,picture,{HEADER}\n1,2,-1,0,{POSE}\n", "pixels without a corner"),
    (f"u_px,v_px,corner,picture,{HEADER}\n1,,0,0,{POSE}\n", "a reading of one axis alone"),
    (f"u_mm,v_mm,corner,picture,{HEADER}\n1,2,0,0,{POSE}\n", "unknown unit 'mm'; expected u_px"),
])
def test_wrong_rows_are_refused(tmp_path, text, words):
    assert_refused(tmp_path / "wrong.csv", text, words)


def test_pictures_that_cannot_tell_are_refused_in_words():
    robot, data = pictures("panda", 3, 4)
    all_fitted = np.ones(len(data), bool)
    known = lambda setup: replace(data, fixture=Fixture(camera=setup), identification=all_fitted)
    with pytest.raises(InputError, match=r"pictures of a board, and no \[board\]"):
        calibrate_closures(robot.nominal, known(None))
    with pytest.raises(InputError, match="of a board of 4 by 3 squares; expected 0 to 5, row by row"):
        calibrate_closures(robot.nominal, known(CameraSetup(columns=4, rows=3)))
    few = known(SETUP).select(data.picture < 2)
    with pytest.raises(InputError, match="2 pictures show 6 corners or more"):
        calibrate_closures(robot.nominal, few)


MIRRORED, BOARD = "mirrored pictures", "squares = [9, 7] in the fixture file"


@pytest.mark.slow  # thirty pictures to be drawn; a check takes a third of a second
def test_usual_mistakes_with_pictures_are_named_and_right_data_raise_no_suspicion():
    robot, data = pictures("ur10", 3, 30)
    of = lambda setup: Fixture(camera=setup)
    data = replace(data, fixture=of(SETUP))
    theta = data.joints["theta"]
    angles = lambda values: replace(data, joints=data.joints | {"theta": values})
    upward = np.stack([data.pixel[:, 0], 1199.0 - data.pixel[:, 1]], axis=1)
    for changed, words in (
        (replace(data, pixel=data.pixel[:, ::-1], fixture=of(replace(SETUP, size=None))), MIRRORED),
        (replace(data, pixel=upward), MIRRORED),
        (replace(data, fixture=of(replace(SETUP, on_flange=False))), '[camera] on = "flange"'),
        (replace(data, fixture=of(replace(SETUP, columns=7, rows=9))), BOARD),
        (replace(data, corner=data.corner + 1), "corners numbered from 0"),
        (angles(theta * [1, 1, 1, -1, 1, 1]), "opposite sign of axis 4"),
        (angles(theta[:, [0, 1, 2, 4, 3, 5]]), "axes 4 and 5 exchanged"),
    ):
        found = first_aid(robot.nominal, changed)
        assert len(found) == 1 and words in found[0], (words, found)
    assert first_aid(robot.nominal, data) == ()
    lens = np.array(TRUE_LENS)
    for factor, told in ((0.5, True), (0.93, False), (1.0, False), (1.07, False), (2.0, True)):
        known = replace(SETUP, lens=(*(factor * lens[:2]), *lens[2:]), lens_given=True)
        found = first_aid(robot.nominal, replace(data, fixture=of(known)))
        assert (len(found) == 1 and "with focal_px of some 1.4" in found[0]) if told else found == ()
    with pytest.raises(InputError, match="outside of a picture of 1600 by 1200"):  # the size tells it before
        calibrate_closures(robot.nominal, replace(data, pixel=data.pixel[:, ::-1]))


@pytest.mark.slow
def test_commands_take_pictures_beside_planes(tmp_path):
    """Touched faces and pictures in one estimate; pixels stand beside the distances."""
    words = ["--quiet", "--seed", "2", "--out"]
    common = ["simulate", "panda", "--measure", "closures", "--deviation", "1"]
    for contact, places, count in (("camera", "1", "25"), ("plane", "1", "8")):
        assert main([*common, "--contact", contact, "--places", places, "--count", count, *words,
                     str(tmp_path / contact)]) == 0
    known = tmp_path / "fixture.toml"
    texts = [(tmp_path / name / "fixture.toml").read_text() for name in ("camera", "plane")]
    known.write_text("\n".join(texts))
    plane = (tmp_path / "plane" / "closures.csv").read_text().splitlines()
    at = plane[0].split(",").index("session")  # sessions of the two files are different set-ups
    moved = [line.split(",") for line in plane[1:]]
    rows = [",".join([*row[:at], str(int(row[at]) + 5), *row[at + 1:]]) for row in moved]
    (tmp_path / "plane.csv").write_text("\n".join([plane[0], *rows, ""]))
    files = [str(tmp_path / "camera" / "closures.csv"), str(tmp_path / "plane.csv")]
    assert main(["calibrate", "panda", *files, "--fixture", str(known), *words, str(tmp_path / "c")]) == 0
    made = json.loads((tmp_path / "c" / "result.json").read_text())
    assert made["unit"] == "m" and made["converged"]
    before, after = (made[when]["validation"] for when in ("before", "after"))
    assert after["reprojection_px"] < 0.3 < 1.0 < before["reprojection_px"]
    assert after["distance_error_m"] < 0.5 * before["distance_error_m"]
    assert "session_1.camera_square_m" in made["parameters"]
    assert set(made["placements"]["session_1"]) == {"camera on the flange", "board in the base"}


def test_a_search_counts_pictures_and_asks_for_shares_of_what_an_arm_can_move():
    """960 corners are 20 poses: the search took 12 of them, and a cause that takes all that an arm can move
    would have taken 6 % of the square sum."""
    robot, data = pictures("ur10", 1, 20)
    assert len(data) > 600
    problem = ClosureProblem(robot.nominal, data, data.select(np.zeros(len(data), bool)))
    assert problem.search_rows() is None
    used = np.tile([True, True, False], (len(data), 1))
    vars(problem)["_declared"] = SimpleNamespace(prediction=SimpleNamespace(used=used))
    assert problem.of_the_arm == pytest.approx(20 * 6 / (2 * len(data)))
    assert problem.least_share == problem.least_elsewhere == pytest.approx(0.02 * problem.of_the_arm)
    assert problem.share_left == pytest.approx(0.10 * problem.of_the_arm)
