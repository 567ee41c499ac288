"""Diagnosis of static poses: a hidden cause is named with its axis, clean data and unknown causes are told as
such."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.chain import Layout
from exactarm.commands.diagnose_report import report_of
from exactarm.commands.next_steps import HEADING
from exactarm.data.dataset import write_dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.diagnose.signal import Quantity
from exactarm.diagnose.verdict import held_out_excess
from exactarm.effects import effect_from_table
from exactarm.identify.pose_fit import fit_poses
from exactarm.noise.model import NoiseModel
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M = 5e-5
COUNT, FITTED = 140, 100
HIDDEN = {
    "backlash": {"effect": "backlash", "joint": 2, "width_rad": 4e-4, "friction_Nm": 2.4},
    "gear_eccentricity": {"effect": "gear_eccentricity", "joint": 3, "first_cos_rad": 3e-4,
                          "first_sin_rad": -2e-4},
    "joint_compliance": {"effect": "joint_compliance", "joint": 3, "linear_rad_per_Nm": 1e-5,
                         "cubic_rad_per_Nm3": 0.0},
    "gear_ratio": {"effect": "gear_ratio", "joint": 2, "scale": 6e-4},
    "tracker_scale": {"effect": "tracker_scale", "x_scale": 0.0, "y_scale": 0.0, "z_scale": 8e-4},
}


@cache
def ur10():
    return load_robot("ur10")


def data_with(effects, seed, push=None):
    """100 poses to fit and 40 to judge by, `effects` hidden in them; push(position): what no library
    holds."""
    rng = np.random.default_rng(seed)
    robot = ur10()
    truth = true_robot(robot, rng, 0.5)
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
    approach = rng.choice([-1.0, 1.0], (COUNT, robot.axes))
    data = measured(robot, [truth], [q], NOISE_M, rng, layout=Layout.of(tuple(effects), estimate=False),
                    joints={"approach": approach}, identification=np.arange(COUNT) < FITTED)
    if push is not None:
        data = replace(data, position=data.position + push(data.position))
    return data, truth


def hidden(name):
    return effect_from_table(HIDDEN[name])


@cache
def diagnosis_of(name):
    data, truth = data_with((hidden(name),), 80)
    return diagnose(ur10(), data), data, truth


@pytest.mark.slow
@pytest.mark.parametrize("seed, driver", [(84, "row"), (85, "row"), (86, "room_degC"), (87, "room_degC")])
def test_an_axis_warms_up_by_its_own_work_or_with_the_room(seed, driver):
    """A thermometer beside the arm is no reason that a drift follows it: half a degree up and down. The seeds
    behind those of clean data below, the first tried; 84 and 85 were given no cause before."""
    size = {"row": 4e-6, "room_degC": 1.2e-3}[driver]  # some 0.2 mrad RMS at the axis, either way
    rng = np.random.default_rng(seed)
    room = 21.0 + 0.25 * np.sin(np.linspace(0.0, 20.0, COUNT)) + rng.normal(0.0, 0.02, COUNT)
    data = data_with((), seed)[0]
    slow = room - room.mean() if driver != "row" else np.arange(COUNT) - COUNT / 2
    theta = data.joints["theta"].copy()
    theta[:, 2] -= ur10().ratios[2] * size * slow  # the log says where it was told to go
    result = diagnose(ur10(), replace(data, joints=dict(data.joints) | {"theta": theta},
                                      covariates={"room_degC": room}))
    (found,) = result.findings
    assert (found.effect.name, found.effect.joint, found.effect.driver) == ("thermal_drift", 3, driver)
    assert result.verdict == "explained" and found.effect.values[0] == pytest.approx(size, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [81, 82, 83])
def test_clean_data_lack_nothing(seed):
    result = diagnose(ur10(), data_with((), seed)[0])
    assert result.verdict == "no_undeclared_effect" and not result.findings and not result.alternatives
    assert result.before == result.after
    assert result.noise.value == pytest.approx(np.sqrt(3.0) * NOISE_M, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(HIDDEN))
def test_hidden_cause_is_named_with_its_axis(name):
    result, _, _ = diagnosis_of(name)
    truth = hidden(name)
    first = result.findings[0]
    assert result.verdict == "explained" and len(result.findings) == 1
    assert (first.effect.name, first.effect.joint) == (truth.name, truth.joint)
    assert first.probability > 0.9 and first.rms_after < first.rms_before
    assert first.effect.describe() in first.evidence
    (doing,) = (part for part in report_of(ur10(), [result], "", []).sections
                if getattr(part, "heading", "") == HEADING)
    # No pose was visited twice: that the rest is noise is the fit's own word.
    assert not result.noise.measured
    assert any("what the fit says of itself" in said for said in doing.paragraphs)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(HIDDEN))
def test_validation_error_is_that_of_the_true_model(name):
    """At most 1.1 times what the true model leaves with its effect in and every declared parameter fitted
    anew."""
    result, data, _ = diagnosis_of(name)
    fitted = result.problem.declared().joined(Layout.of((hidden(name),)))
    best = fit_poses(ur10(), fitted,
                     data.select(data.identification)).error(data.select(~data.identification))
    assert result.after["validation"].rms < 1.1 * np.sqrt(np.mean(best**2))
    assert result.after["validation"].rms < 0.85 * result.before["validation"].rms


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(HIDDEN))
def test_size_comes_back(name):
    """Free values within twice their 95 % intervals of the truth."""
    first, truth = diagnosis_of(name)[0].findings[0], hidden(name)
    half = 0.5 * np.ptp(first.intervals, axis=1)
    for parameter, value, reach in zip(first.effect.parameters(), first.effect.values, half):
        known = {p.name: v for p, v in zip(truth.parameters(), truth.values)}
        if reach > 0.0:
            assert abs(value - known.get(parameter.name, 0.0)) < 2.0 * reach, parameter.name


@pytest.mark.slow
@pytest.mark.parametrize("friction_Nm", [0.6, 2.4, 6.0])
def test_backlash_rests_on_its_flank_whatever_the_friction(friction_Nm):
    """The approach decides where the friction exceeds the load; how much it is, nobody declared."""
    clearance = effect_from_table(HIDDEN["backlash"] | {"friction_Nm": friction_Nm})
    result = diagnose(ur10(), data_with((clearance,), 88)[0])
    first = result.findings[0].effect
    assert (first.name, first.joint, result.verdict) == ("backlash", 2, "explained")
    # Of a hundred poses only some carry less load than this, and only the largest friction has enough of
    # them.
    assert friction_Nm < 6.0 or 0.6 * friction_Nm < first.value_of("friction_Nm") < 1.7 * friction_Nm


@pytest.mark.slow
def test_cause_outside_the_library_is_unexplained_and_followed():
    """Something pushes the arm aside in one corner of its workspace."""
    way = np.array([0.6, -0.48, 0.64])

    def push(position):
        far = np.sum((position - position[5]) ** 2, axis=1) / 0.45**2
        return 1e-3 * np.exp(-0.5 * far)[:, None] * way

    result = diagnose(ur10(), data_with((), 84, push)[0])
    strongest = result.dossier_after.strongest
    assert result.verdict == "unexplained" and strongest.significant
    assert strongest.signal.quantity == Quantity.PLACE and str(strongest.signal) in result.sentence
    assert "nothing in the library explains" in result.sentence


@pytest.mark.slow
def test_two_angles_that_act_together_are_unexplained():
    """A cable that two axes of the wrist wind up: no single angle shows it."""
    data, truth = data_with((), 89)
    q = data.joints.get("q", data.joints.get("theta"))
    lift = 2e-4 * (q[:, 4] - q[:, 4].mean()) * (q[:, 5] - q[:, 5].mean())
    result = diagnose(ur10(),
                      replace(data, position=data.position + lift[:, None] * np.array([0.0, 0.6, 0.8])))
    assert result.verdict == "unexplained"
    assert result.dossier_after.strongest.signal.quantity == Quantity.TWO_ANGLES


@pytest.mark.slow
def test_noise_that_neighbours_share_is_noise_and_widens_the_frames_intervals():
    """Half of its variance wanders with a memory of eight poses; nothing is hidden."""
    rng, keeps = np.random.default_rng(92), np.exp(-1.0 / 8.0)
    shared = rng.standard_normal((COUNT, 3))
    for row in range(1, COUNT):
        shared[row] = keeps * shared[row - 1] + np.sqrt(1.0 - keeps**2) * shared[row]
    result = diagnose(ur10(), data_with((), 91, lambda position: NOISE_M * shared)[0])
    assert result.verdict == "no_undeclared_effect" and result.causes.noise.wandering is not None
    fitted = result.selection.fits[-1]
    alone = result.problem.fit(fitted.layout).fit.covariance
    wider = np.sqrt(np.diag(fitted.fit.covariance) / np.diag(alone))
    frames = np.array(["base" in name for name in fitted.layout.names])
    assert wider[frames].max() > 1.3 and np.all(wider > 0.7) and np.median(wider) < 1.3


@pytest.mark.slow
def test_a_slow_drift_that_no_effect_describes_is_not_noise():
    """The tripod sways once and a half while the poses are measured, by twice the noise."""
    sway = 1.0e-4 * np.sin(np.linspace(0.0, 3.0 * np.pi, COUNT) + 0.4)[:, None] * np.array([0.6, -0.48, 0.64])
    result = diagnose(ur10(), data_with((), 93, lambda position: sway)[0])
    assert result.verdict == "unexplained" and "drifts with time" in result.sentence


@pytest.mark.slow
def test_validation_rows_choose_nothing():
    result, data, _ = diagnosis_of("joint_compliance")
    held = ~data.identification
    rng = np.random.default_rng(85)
    broken = data.position.copy()
    broken[held] = rng.permutation(broken[held]) + rng.normal(0.0, 0.3, (held.sum(), 3))
    other = diagnose(ur10(), replace(data, position=broken))
    assert [f.effect for f in other.findings] == [f.effect for f in result.findings]
    assert [f.probability for f in other.findings] == [f.probability for f in result.findings]
    assert other.after["identification"] == result.after["identification"]
    assert other.after["validation"].rms > 0.1


@pytest.mark.slow
def test_same_seed_same_answer():
    result, data, _ = diagnosis_of("gear_ratio")
    again = diagnose(ur10(), data)
    assert again.before == result.before and again.after == result.after and again.sentence == result.sentence
    for one, other in zip(again.findings, result.findings, strict=True):
        assert one.effect == other.effect and np.array_equal(one.intervals, other.intervals)


@pytest.mark.slow
def test_never_worse_than_before():
    for name in HIDDEN:
        result = diagnosis_of(name)[0]
        assert result.after["validation"].rms <= result.before["validation"].rms


# -- the command -------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """Folder in which the command has diagnosed a hidden compliance, and a fresh measurement of the same
    robot."""
    folder = tmp_path_factory.mktemp("diagnosis")
    data, truth = data_with((hidden("joint_compliance"),), 86)
    write_dataset(folder / "poses.csv", data, ur10())
    rng = np.random.default_rng(87)
    fresh = measured(ur10(), [truth], [np.clip(joints_in_limits(ur10(), 60, rng), -2.2, 2.2)], NOISE_M, rng,
                     layout=Layout.of((hidden("joint_compliance"),), estimate=False))
    write_dataset(folder / "fresh.csv", fresh, ur10())
    assert run("diagnose", "ur10", folder / "poses.csv", folder / "diagnosed") == 0
    return folder


def run(command, robot, data, out):
    return cli.main([command, str(robot), str(data), "--out", str(out), "--quiet"])


@pytest.mark.slow
def test_each_effect_says_what_it_takes_away_by_itself():
    """Not what all of its step take away together: the model without it, the others fitted anew."""
    made = ea.simulate("ur10", count=120, seed=4, effects=[
        "gear_eccentricity joint=2 first_cos_rad=4e-4 first_sin_rad=3e-4",
        "gear_eccentricity joint=4 first_cos_rad=1e-4 first_sin_rad=-3e-4"])
    result = diagnose(load_robot("ur10"), made.data)
    assert sorted(f.effect.joint for f in result.findings) == [2, 4]
    problem, last = result.problem, result.selection.fits[-1]
    for finding in result.findings:
        index = last.layout.effects.index(finding.effect)
        without = problem.fit(last.layout.only(k for k in range(len(last.layout.effects)) if k != index))
        left = problem.errors(without, problem.held_out)
        assert finding.rms_before == pytest.approx(np.sqrt(np.nanmean(left**2)), rel=0.05)
        assert finding.rms_after == result.after["validation"].rms


@pytest.mark.slow
def test_result_has_the_agreed_keys(command):
    result = json.loads((command / "diagnosed" / "result.json").read_text())
    common = {"exactarm", "command", "robot", "inputs", "seed", "seconds"}
    agreed = {"data_kind", "unit", "noise_floor", "before", "after", "effects", "alternatives", "verdict",
              "next_experiment"}
    assert common | agreed <= set(result)
    assert (result["data_kind"], result["unit"], result["verdict"]) == ("poses", "m", "explained")
    for part in ("before", "after"):
        for rows in ("identification", "validation"):
            assert {"n", "mean", "rms", "max", "min", "std"} <= set(result[part][rows])
    effect = result["effects"][0]
    assert set(effect) == {"effect", "joint", "parameters", "validation_rms_before", "validation_rms_after",
                           "probability",
                           "evidence", "compensable", "set", "own_share", "at_tool_um"}
    assert 0.0 < effect["own_share"] < 1.0 and effect["at_tool_um"] > 0.0
    assert effect["validation_rms_after"] == result["after"]["validation"]["rms"]
    assert (
        effect["set"][0]["effect"] == effect["effect"]
        and effect["set"][0]["probability"] == effect["probability"]
    )
    assert result["probability_nothing"] < 0.01 and result["probability_something_else"] < 0.5
    assert 0.0 <= result["false_alarm_rate"] < 0.2 and result["self_test"]["sets"] > 50
    assert (effect["effect"], effect["joint"], effect["compensable"]) == ("joint_compliance", 3, True)
    low, high = effect["parameters"]["linear_rad_per_Nm"]["ci95"]
    assert low < effect["parameters"]["linear_rad_per_Nm"]["value"] < high
    for other in result["alternatives"]:
        assert {"effect", "joint", "validation_rms_after", "probability"} <= set(other)
    assert isinstance(result["next_experiment"], str)


@pytest.mark.slow
def test_diagnosed_robot_works_in_evaluate_and_calibrate(command):
    robot = command / "diagnosed" / "robot.toml"
    assert [effect.label for effect in load_robot(robot).effects] == ["joint_compliance_3"]
    assert run("evaluate", robot, command / "fresh.csv", command / "evaluated") == 0
    error = json.loads((command / "evaluated" / "result.json").read_text())["error"]
    assert error["rms"] < 1.3 * np.sqrt(3.0) * NOISE_M
    assert run("calibrate", robot, command / "fresh.csv", command / "calibrated") == 0
    before = json.loads((command / "calibrated" / "result.json").read_text())["before"]["validation"]
    assert before["rms"] < 1.4 * np.sqrt(3.0) * NOISE_M
    assert run("diagnose", robot, command / "fresh.csv", command / "again") == 0
    again = json.loads((command / "again" / "result.json").read_text())
    assert again["verdict"] == "no_undeclared_effect" and again["effects"] == []


def test_what_does_not_carry_over_is_no_explanation():
    rng = np.random.default_rng(3)
    fitted, held = rng.normal(size=200), rng.normal(size=80)
    assert held_out_excess({"identification": fitted, "validation": held}, 1.0) < 1.3
    assert held_out_excess({"identification": fitted, "validation": 3.0 * held}, 1.0) > 2.0
    held[:4] = 50.0  # wrong rows
    assert held_out_excess({"identification": fitted, "validation": held}, 1.0) < 1.3
    # Half of the numbers are spent on parameters: the fit errs less on its own rows, and more on others.
    assert held_out_excess({"identification": fitted * 0.5**0.5, "validation": held * 1.5**0.5}, 1.0) < 1.3
    assert held_out_excess({"identification": fitted, "validation": np.zeros(0)}, 1.0) == 1.0


def narrow_data(gross_m):
    """100 poses in a narrow range, the geometry off by millimetres; eight are wrong by themselves."""
    rng = np.random.default_rng(84)
    robot, wrong = ur10(), np.arange(FITTED) % 12 == 5
    q = np.array([0.4, -1.2, 1.1, -0.6, 0.8, 0.2]) + rng.uniform(-0.35, 0.35, (COUNT, robot.axes))
    data = measured(robot, [true_robot(robot, rng, 3.0)], [q], NOISE_M, rng,
                    identification=np.arange(COUNT) < FITTED)
    position = data.position.copy()
    position[:FITTED][wrong] += gross_m * rng.standard_normal((wrong.sum(), 3))
    return replace(data, position=position), np.flatnonzero(wrong)


def test_gross_rows_hide_no_declared_parameter_once_they_are_known():
    fitted = [narrow_data(gross)[0].select(np.arange(FITTED)) for gross in (0.0, 3e-3)]
    clean, spoiled = (PoseProblem(ur10(), data, data) for data in fitted)
    told, hidden = clean.declared(), spoiled.declared()
    assert hidden.size < told.size
    noise = NoiseModel(np.full(3, NOISE_M), np.ones(FITTED))
    assert spoiled.declared_under(hidden, noise.of_a_row).names == told.names
    assert clean.declared_under(told, noise.of_a_row).names == told.names


@pytest.mark.slow
def test_gross_rows_in_a_narrow_range_are_all_that_is_named():
    data, wrong = narrow_data(3e-3)
    result = diagnose(ur10(), data)
    assert [finding.effect.name for finding in result.findings] == ["outliers"]
    assert np.all(result.selection.fits[-1].weight[wrong] == 0.0) and result.verdict == "explained"
    # Its size is that of the gross errors: the median of |3 mm * normal(3)| is 4.6 mm, of these few 3 to 7.
    assert 3e-3 < result.excluded_error < 7e-3
    report = report_of(ur10(), [result], "", [])
    (table,) = (section for section in report.sections if getattr(section, "heading", "") == "Causes found")
    row = dict(zip(table.header, table.rows[0]))
    assert row["measure"] == f"median error of {result.excluded} rows left out"
    assert row["size (95 %)"].value == result.excluded_error
    assert row["at the tool"].value == pytest.approx(1e6 * result.excluded_error)
    assert "median error of the rows that are left out" in table.note
    assert f"single wrong measurements ({result.excluded} rows, " in report.verdict


@pytest.mark.slow
def test_the_overtone_of_a_wave_is_found_beyond_the_orders_that_are_searched():
    """As a wave generator has it at four times the motor's turn."""
    order = 130.0
    waves = [effect_from_table({"effect": "gear_harmonics", "joint": 2, "order_per_rev": k * order,
                                "a_1": a, "b_1": 0.0}) for k, a in ((1, 0.08), (2, 0.1))]
    data, _ = data_with(waves, 21)
    result = diagnose(ur10(), data)
    orders = sorted(finding.effect.values[0] for finding in result.findings)
    assert result.verdict == "explained" and {f.effect.name for f in result.findings} == {"gear_harmonics"}
    assert np.allclose(orders, [order, 2.0 * order], atol=0.2)
    assert result.sentence.count("gear harmonics of axis 2") == 1


@pytest.mark.slow
def test_poses_without_any_noise_lack_nothing():
    exact = ea.simulate("ur10", count=25, noise=0.0).data  # failed before: a matrix not positive definite
    assert ea.diagnose("ur10", exact, threads=1)["verdict"] == "no_undeclared_effect"
