"""Two arms that touch each other: derivatives, the arm found through a calibrated partner, what its errors
do, wrong partner files, mixed data, files and words."""

import json
from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout
from exactarm.cli import main
from exactarm.data.dataset import Dataset, dataset_columns, read_dataset
from exactarm.data.fixture import Fixture, Partner, load_fixture
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING
from exactarm.errors import InputError
from exactarm.files.table import write_table
from exactarm.identify import closures
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.closure_scale import scale_is_known
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.declared import geometry_layout
from exactarm.identify.evaluate import evaluate_closures, evaluate_poses
from exactarm.identify.match import WORST_SHARE
from exactarm.identify.partner_misfit import distances, partner_misfit
from exactarm.identify.partner_prior import NO_SCALE, prior_of
from exactarm.measurement.closures import device_of, predict_closures, touches
from exactarm.measurement.partner import FRAMES, partner_robot, placed_by
from exactarm.measurement.partner import Partner as Contact
from exactarm.measurement.target import Target
from exactarm.numerics.rotation import exp
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.closures import measure_closures
from exactarm.simulate.virtual_robot import placed
from spoiled_rows import PANDA
from test_closures import ECCENTRICITY, covered, together, virtual

NOISE_M = 5e-5
SENSE = Sensors(position_m=NOISE_M, counts=0)


def touched(name: str, seed: int, *effects: str, count: int = 200, slipped: float = 0.0):
    robot, random = virtual(name, seed, *effects)
    sensors = replace(SENSE, wrong_rows=slipped)
    return robot, measure_closures(robot, "partner", 1, count, sensors, random)[0], random


def with_partner(data: Dataset, robot) -> Dataset:
    return replace(data, fixture=replace(data.fixture, partner=replace(data.fixture.partner, robot=robot)))


@pytest.mark.slow
@pytest.mark.parametrize("open_arm", [False, True])
def test_derivatives_by_every_parameter_agree_with_differences(open_arm):
    """Another arm of six axes and with springs, beside one of seven."""
    random = np.random.default_rng(2)
    other = load_robot("ur10")
    contact = Contact(None, (0.9, -0.2, 0.1, 0.2, -0.1, 0.3, 0.03, -0.02, 0.1, 1e-4), 0, 0,
                      declared_as=Partner("ur10", 0.03, robot=other),
                      reference=tuple(tuple(map(float, row)) for row in exp(np.array([0.1, 0.2, 3.0]))))
    if open_arm:
        arm, factor = prior_of(other)
        contact = contact.open_to(arm, factor)
        contact = contact.with_values([*contact.values[:FRAMES], *random.normal(size=factor.shape[1])])
    layout = Layout.of((Target(None, (0.01, 0.02, 0.1), (1,)), contact)).joined(geometry_layout(PANDA))
    data = Dataset.of_arrays("closures", {"q": random.uniform(-1.0, 1.0, (5, 7))},
                             contacts={"partner": np.zeros(5, int)}, partner=random.uniform(-1, 1, (5, 6)))
    prediction = predict_closures(PANDA, layout, data)
    at = lambda x: predict_closures(PANDA, layout.at(x), data, tangents=False).residual[:, :1]
    assert_derivative(at, layout.values, -prediction.jacobian[:, :1], 1e-4, relative=1e-6)


def test_the_base_and_the_ball_of_a_partner_are_found_without_starting_values():
    random = np.random.default_rng(3)
    flange, turned = random.normal(0.0, 0.4, (40, 3)), exp(random.normal(0.0, 1.0, (40, 3)))
    base, ball = np.array([1.0, 0.2, -0.1]), np.array([0.05, -0.03, 0.12])
    turn = exp(np.array([0.1, 2.0, 1.0]))
    points = base + (flange + turned @ ball) @ turn.T
    found = placed_by(points, flange, turned, np.zeros(3))
    for got, true in zip(found, (turn, base, ball)):
        np.testing.assert_allclose(got, true, atol=1e-6)


@pytest.mark.parametrize("size", [0.0, 1e-8, 1.0])
def test_derivatives_of_the_distance_of_two_balls(size):
    random = np.random.default_rng(2)
    places, turns = random.normal(size=(2, 5, 3)), exp(random.normal(size=(2, 5, 3)))
    v = random.normal(size=12)
    v[3:6] *= size
    about = (places[0], turns[0], places[1], turns[1], exp(random.normal(size=3)))
    assert_derivative(lambda v: distances(v, *about)[0], v, distances(v, *about)[1], 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("slipped", [0.0, pytest.param(0.05, marks=pytest.mark.slow)])
def test_an_arm_of_another_size_is_refused_before_any_fit(slipped, monkeypatch):
    robot, data, _ = touched("ur10", 3, count=60, slipped=slipped)
    rows, tools = touches(data), [np.zeros(3), np.array([0.1, -0.2, 0.3])]
    enough = WORST_SHARE * robot.nominal.reach
    assert partner_misfit(robot.nominal, Layout.of(()), rows, tools, enough) < 0.1 * enough
    for other in ("racer-7-1.4", "tx40"):
        wrong = with_partner(data, load_robot(other))
        missed = partner_misfit(robot.nominal, Layout.of(()), touches(wrong), tools, enough)
        assert missed > 5 * enough
        monkeypatch.setattr(closures, "fit_closures", None)
        with pytest.raises(InputError, match="is the robot file of the partner that of another arm"):
            calibrate_closures(robot.nominal, wrong)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "slipped"), [("panda", 0.0), ("ur10", 0.03)])
def test_a_calibrated_partner_shows_the_hidden_geometry(name, slipped):
    """Median distances of rows never fitted come down to the noise of one number (0.67 of 0.05 mm), and the
    intervals hold the truth; nothing is suspected."""
    robot, data, _ = touched(name, 1, slipped=slipped)
    result = calibrate_closures(robot.nominal, data)
    judged = ~result.identification
    assert result.fit.fit.converged
    assert np.median(result.error_before[judged]) > 5 * NOISE_M
    assert np.median(result.error_after[judged]) < 1.2 * NOISE_M
    inside = covered(robot, result)
    assert len(inside) >= 16 and np.mean(inside) >= 0.8
    assert not any("partner" in warning or "factor" in warning for warning in result.warnings)


@pytest.mark.slow
def test_what_the_partner_does_not_know_of_itself_stands_in_the_intervals_of_the_arm():
    robot, data, _ = touched("panda", 4)
    partner = data.fixture.partner.robot
    vague = {name: (low - 10 * (high - low), high + 10 * (high - low))
             for name, (low, high) in partner.intervals.items()}
    width = lambda each: dict(zip(each.names, each.intervals[:, 1] - each.intervals[:, 0]))
    sharp = width(calibrate_closures(robot.nominal, data))
    wide = width(calibrate_closures(robot.nominal, with_partner(data, replace(partner, intervals=vague))))
    lengths = [name for name in sharp if name in wide and name[:2] in ("a_", "d_")]
    ratios = [wide[name] / sharp[name] for name in lengths]
    assert max(ratios) > 2.0 and min(ratios) > 0.9  # most are told by the touches themselves, d_3 is not


@pytest.mark.slow
def test_a_partner_from_a_drawing_is_estimated_too_and_tells_no_scale():
    robot, data, _ = touched("panda", 2)
    drawn = with_partner(data, load_robot("panda"))
    result = calibrate_closures(robot.nominal, drawn)
    assert NO_SCALE in result.warnings and any("holds the scale" in entry.why
                                               for entry in result.identifiability.dropped)
    assert scale_is_known(result.fit.layout, touches(data))
    assert result.after["validation"].mean < 2 * NOISE_M
    contact = next(effect for effect in result.fit.layout.effects if isinstance(effect, Contact))
    found, true = partner_robot(contact), data.fixture.partner.robot
    alpha = lambda arm: np.array([joint.alpha for joint in arm.joints[1:-1]])
    assert np.abs(alpha(found) - alpha(true)).max() < 0.5 * np.abs(alpha(PANDA) - alpha(true)).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "ur10"])
def test_the_calibrated_file_of_another_arm_is_suspected(name):
    """Same type, other individual."""
    robot, data, _ = touched(name, 1)
    other = touched(name, 61, count=3)[1].fixture.partner.robot
    result = calibrate_closures(robot.nominal, with_partner(data, other))
    assert any("is partner.toml the file of this arm" in warning for warning in result.warnings)


@pytest.mark.slow
def test_a_partner_of_another_size_is_refused():
    robot, data, _ = touched("panda", 1, count=60)
    long = data.fixture.partner.robot.with_joint(2, d=0.9)
    with pytest.raises(InputError, match="partner that of another arm"):
        calibrate_closures(robot.nominal, with_partner(data, long))


@pytest.mark.slow
def test_a_partner_with_other_axes_is_refused():
    robot, data, _ = touched("panda", 1, count=20)
    with pytest.raises(InputError, match="angles of 7 axes of the partner; its robot file .* has 6"):
        calibrate_closures(robot.nominal, with_partner(data, load_robot("ur10")))
    with pytest.raises(InputError, match=r"no \[partner\] in the fixture file"):
        calibrate_closures(robot.nominal, replace(data, fixture=Fixture()))


@pytest.mark.slow
def test_a_hidden_cause_is_named_and_none_is_invented():
    robot, data, _ = touched("ur10", 2, ECCENTRICITY, count=250)
    assert [finding.effect.label for finding in diagnose(robot.nominal, data).findings] == [
        "gear_eccentricity_2"]
    robot, data, _ = touched("ur10", 2, count=250)
    result = diagnose(robot.nominal, data)
    assert result.verdict == NOTHING and not result.findings


@pytest.mark.slow
def test_touches_and_a_tracker_are_one_estimate_and_a_tracker_judges_it():
    robot, data, random = touched("ur10", 5)
    seen = VirtualRobot(robot.nominal, placed(robot.true, random))
    lower, upper = (np.array([getattr(joint, key) for joint in robot.nominal.joints])
                    for key in ("q_min", "q_max"))
    draw = lambda count: measure_poses(seen, random.uniform(lower, upper, (count, 6)), SENSE, random)
    few, judge = replace(draw(30), identification=np.ones(30, bool)), draw(100)
    mixed = together(data, few)
    mixed = replace(mixed, partner=np.concatenate([data.partner, np.full((30, 6), np.nan)]))
    assert set(device_of(touches(mixed))) == {"partner", "tracker"}
    error = lambda result: evaluate_poses(result.robot, judge).overall.mean
    only = CalibrationOptions(compliance=())
    alone, both, touching = (error(each) for each in (
        calibrate(robot.nominal, few, only), calibrate_closures(robot.nominal, mixed, only),
        calibrate_closures(robot.nominal, data, only)))
    assert both < 1.02 * alone and touching < 1.5 * alone


@pytest.mark.slow
def test_files_of_two_arms_pass_through_the_commands(tmp_path):
    out = lambda name: ["--out", str(tmp_path / name), "--quiet"]
    made = tmp_path / "made"
    words = ["simulate", "panda", "--measure", "closures", "--contact", "partner", "--count", "150",
             "--deviation", "1", "--noise", "5e-5", "--counts", "0", *out("made")]
    assert main(words) == 0
    files = [str(made / "closures.csv"), "--fixture", str(made / "fixture.toml")]
    assert main(["calibrate", "panda", *files, *out("cal")]) == 0
    found = json.loads((tmp_path / "cal" / "result.json").read_text())
    assert found["after"]["validation"]["mean"] < 0.2 * found["before"]["validation"]["mean"]
    assert main(["evaluate", str(tmp_path / "cal" / "robot.toml"), *files, *out("judged")]) == 0
    assert main(["identifiable", "panda", *files, *out("shown")]) == 0
    shown = json.loads((tmp_path / "shown" / "result.json").read_text())
    assert "d_3_m" in shown["identifiable"] and "d_1_m" not in shown["identifiable"]
    # other rows read the same
    fixture = load_fixture(made / "fixture.toml", load_robot)
    data = read_dataset(made / "closures.csv", PANDA, fixture=fixture)
    write_table(tmp_path / "again.csv", dataset_columns(data, PANDA))
    again = read_dataset(tmp_path / "again.csv", PANDA, fixture=fixture)
    np.testing.assert_allclose(again.partner, data.partner, rtol=1e-12)
    assert evaluate_closures(PANDA, again).unit == "m"


@pytest.mark.parametrize(("text", "words"), [
    ('[partner]\ndistance_mm = 25', "robot missing"),
    ('[partner]\nrobot = "panda"', "distance_mm missing"),
    ('[partner]\nrobot = "panda"\ndistance_mm = 0', "a length above 0"),
    ('[partner]\nrobot = "nobody"\ndistance_mm = 25', "no robot of that name"),
    ('[partner]\nrobot = "panda"\nradius_mm = 25', "unknown key radius_mm"),
    ('partner = 3', "no table"),
])
def test_wrong_partners_are_refused(tmp_path, text, words):
    (tmp_path / "fixture.toml").write_text(text)
    with pytest.raises(InputError, match=words):
        load_fixture(tmp_path / "fixture.toml", load_robot)
