"""What one effect does by itself: its own signal, its size, its share that nothing else makes up for; and the
words for it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm.commands.diagnose_report import _between, _many_left_out, _outliers, found_effects, report_of
from exactarm.commands.effect_sections import (
    _at_tool_note,
    _row,
    _size,
    causes_in_words,
    on_axes,
    orders_table,
    percent,
)
from exactarm.diagnose.contribution import (
    _at_tool,
    _follows,
    _less_mean,
    _loaded_without_spring,
    _own_direction,
    _own_signals,
    _told_over,
    _waves,
)
from exactarm.diagnose.diagnosis import Diagnosis, diagnose
from exactarm.diagnose.signal import Quantity, Signal, axis_of, measured_of, turn_of
from exactarm.effects.base import Station
from exactarm.effects.expression import Expression
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.joint_compliance import RelativeCompliance
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.effects.order_source import likely_source
from exactarm.effects.tracker_step import TrackerStep
from exactarm.effects.units_in_names import words_of

EFFECTS = ["gear_eccentricity joint=3 first_cos_rad=6e-4 first_sin_rad=3e-4",
           "joint_compliance joint=2 linear_rad_per_Nm=8e-6"]


@pytest.fixture(scope="module")
def result():
    made = ea.simulate("racer-7-1.4", effects=EFFECTS, count=150, noise=2e-5, counts=0, deviation=0.5)
    return diagnose(ea.load_robot("racer-7-1.4"), made.data)


@pytest.mark.slow
def test_every_picture_has_its_own_axis_on_the_abscissa_and_lowers_its_own_error(result):
    assert {c.effect.joint for c in result.contributions} >= {3}
    for c in result.contributions:
        assert c.effect.joint is None or c.signal.axis == c.effect.joint, (c.effect.title, c.signal)
        assert c.rms[1] < c.rms[0]


@pytest.mark.slow
def test_an_angle_error_has_its_peak_to_peak_with_an_interval_that_holds_the_truth(result):
    (own,) = [c for c in result.contributions if c.effect.joint == 3 and c.effect.orders()]
    value, half = own.peak_to_peak
    # over the angles that were measured
    phi = np.linspace(own.x.min(), own.x.max(), 2000) - ea.load_robot("racer-7-1.4").joints[2].q_offset
    truth = np.ptp(6e-4 * np.cos(phi) + 3e-4 * np.sin(phi))
    assert own.signal == Signal(Quantity.ANGLE, 3) and own.curve and abs(value - truth) < 1.5 * half + 5e-5
    assert np.all(own.half > 0.0) and own.at_tool > 2e-5


@pytest.mark.slow
def test_the_report_tells_one_line_an_effect_and_a_verdict_in_words(result):
    robot = ea.load_robot("racer-7-1.4")
    report = report_of(robot, [result], "", [])
    table = next(s for s in report.sections if getattr(s, "heading", "") == "Causes found")
    assert len(table.rows) == len(result.findings)
    assert "run-out" in report.verdict or "angle errors that repeat every turn" in report.verdict
    assert causes_in_words(result, found_effects(result), 6) in report.verdict
    assert {"effects", "arm"} <= {figure.name for figure in report.figures}


@pytest.mark.slow
def test_errors_in_space_are_those_of_the_held_out_rows(result):
    np.testing.assert_allclose(np.linalg.norm(result.in_space.after, axis=1),
                               result.errors_after["validation"][
                                   np.isfinite(result.errors_after["validation"])
                               ], atol=1e-9)
    assert result.in_space.which == "validation" and result.in_space.arm.shape[1] == 3


@pytest.mark.parametrize("joints, words", [
    ([2], " on axis 2"), ([1, 2, 3, 4], " on axes 1 to 4"), ([6, 1, 3], " on axes 1, 3 and 6"),
    ([1, 2], " on axes 1 and 2"),
    ([1, 2, 3, 4, 5, 6], " on all six axes"), ([None], ""),
])
def test_axes_are_told_as_a_person_would(joints, words):
    assert on_axes(joints, 6) == words


def test_probabilities_are_not_told_beyond_what_they_mean():
    assert [percent(p) for p in (0.0, 0.0004, 0.123, 0.999,
                                 0.99999)] == ["< 0.1 %", "< 0.1 %", "12.3 %", "99.9 %", "> 99.9 %"]


def test_a_signal_is_followed_by_its_own_functions_only():
    random = np.random.default_rng(1)
    one, other = random.uniform(-2, 2, 800), random.uniform(-2, 2, 800)
    assert _follows(one, np.sin(9 * one)) > 0.95 and abs(_follows(other, np.sin(9 * one))) < 0.2
    assert _follows(np.sign(one), 3.0 * np.sign(one)) == pytest.approx(1.0)


@pytest.mark.parametrize("order, ratio, word", [
    (1.0, 100.0, "run-out"), (2.0, None, "ovality"), (100.0, 100.0, "motor"),
    (200.0, -100.0, "wave generator"),
    (37.0, 100.0, "gear"), (5.0, 100.0, "output side"),
    (199.7, None, "twice at 100:1"), (99.3, None, "once at 100:1 or twice at 50:1"),
    (99.3, 72.0, "teeth"), (84.0, None, "teeth"),
])
def test_the_usual_source_of_an_order_follows_from_the_ratio(order, ratio, word):
    assert word in likely_source(order, ratio)


def test_what_is_smooth_in_time_follows_no_direction():
    """A base that gives way was drawn over the direction of an axis, which passes through values between -1
    and 1 at reversals and stays at these for seconds."""
    time = np.linspace(0.0, 20.0, 2000)
    direction, load = np.clip(30.0 * np.sin(time), -1.0, 1.0), np.sin(0.37 * time + 0.5)
    assert len(np.unique(direction)) > 8
    assert _follows(direction, load) < 0.5 < 0.99 < _follows(load, load)


def test_a_drift_is_drawn_over_what_drives_it():
    names = (Signal(Quantity.ANGLE, 1), Signal(Quantity.TIME), Signal("temperature"))
    signals = dict.fromkeys(names, np.arange(3.0))
    for driver in ("time", "temperature"):
        found = _own_signals(SimpleNamespace(joint=None, driven_by=None, driver=driver), signals, None)
        assert list(found) == [Signal(driver)]
    assert _own_signals(SimpleNamespace(joint=None, driven_by=None), signals, None) is signals
    rows = SimpleNamespace(view=SimpleNamespace(data=SimpleNamespace(row=np.array([4, 7, 9]))))
    found = _own_signals(SimpleNamespace(joint=2, driven_by=2, driver="row"), signals, rows)
    assert list(found) == [Signal(Quantity.ORDER)] and list(found[Signal(Quantity.ORDER)]) == [4.0, 7.0, 9.0]


def test_what_another_axis_drives_is_drawn_over_that_axis():
    """A coupling stood over the speed of the axis that is turned."""
    names = (Signal(Quantity.ANGLE, 1), Signal(Quantity.ANGLE, 3), Signal(Quantity.SPEED, 3),
             Signal(Quantity.TIME))
    signals = dict.fromkeys(names, np.arange(3.0))
    coupling = JointCoupling(3, (1.0, 1e-4))
    formula = Expression(3, (1e-4,), form="a*q_1", of=("q_1",), names=("a",), plausible=(1e-4,))
    for effect in (coupling, formula):
        assert list(_own_signals(effect, signals, None)) == [Signal(Quantity.ANGLE, 1), Signal(Quantity.TIME)]
    of_two = Expression(3, (1e-4,), form="a*q_1*q_2", of=("q_1", "q_2"), names=("a",), plausible=(1e-4,))
    assert list(_own_signals(of_two, signals, None)) == [
        Signal(Quantity.ANGLE, 3), Signal(Quantity.SPEED, 3), Signal(Quantity.TIME)]


def test_the_size_of_a_cause_is_a_number_that_is_not_zero_within_its_interval():
    def told(*intervals, by=""):
        parameters = [SimpleNamespace(name=f"m_{k}_kg", fixed=False) for k in range(1, len(intervals) + 1)]
        effect = SimpleNamespace(orders=lambda: (), parameters=lambda: parameters,
                                 values=[0.5 * sum(interval) for interval in intervals],
                                 in_units_of=lambda robot, name: name, told_by=by)
        measure, size = _size(SimpleNamespace(effect=effect, derived={}, intervals=intervals), None, None)
        return measure, size.low, size.high

    assert told((-1.5, 1.5), (0.8, 1.2)) == ("m 2", 0.8, 1.2)
    assert told((-1.5, 1.5), (-0.2, 0.4)) == ("m 2", -0.2, 0.4)
    assert told((0.1, 0.3), (0.8, 1.2), by="m_1_kg") == ("m 1", 0.1, 0.3)
    assert told((0.0, 0.3), (0.8, 1.2), by="m_1_kg") == ("m 2", 0.8, 1.2)  # a spring loaded at the tip


@pytest.mark.parametrize("name, words", [
    ("width_rad", "width"), ("x_rad_s", "x"), ("my_2_kg_m", "my 2"), ("growth_1_per_h", "growth"),
    ("drift_x_rad_s_per_h", "drift x"), ("mass_kg", "mass"), ("scale", "scale"), ("zero_rad_per_row", "zero"),
])
def test_a_measure_is_told_without_its_unit(name, words):
    assert words_of(name) == words


def test_a_value_is_told_over_time_only_where_nothing_else_explains_half_of_it():
    t = np.linspace(0.0, 6.0, 400)
    named = {Signal(Quantity.TIME): t, Signal(Quantity.LOAD, 2): np.sin(3.0 * t),
             Signal(Quantity.SPEED, 2): np.cos(7.0 * t)}
    assert _told_over(named, 2.0 * np.sin(3.0 * t) + 0.2 * np.sin(20.0 * t)) == Signal(Quantity.LOAD, 2)
    assert _told_over(named, np.exp(-t)) == Signal(Quantity.TIME)


def test_an_effect_of_no_axis_stands_over_signals_of_the_axis_along_which_it_is_drawn():
    names = (Signal(Quantity.LOAD, 1), Signal(Quantity.LOAD, 2), Signal(Quantity.TIME),
             Signal(Quantity.SPEED, 12))
    signals = dict.fromkeys(names, np.arange(3.0))
    of_none = SimpleNamespace(joint=None, driven_by=None)
    own = _own_signals(of_none, signals, None, measured_of(2))
    assert list(own) == [Signal(Quantity.LOAD, 2), Signal(Quantity.TIME)]
    pushed = axis_of("base", "z")
    assert list(_own_signals(of_none, signals, None, pushed)) == list(names)


def test_a_direction_that_no_row_shows_is_not_the_own_one():
    """Rows of one number each, as of a face, show nothing along y: 0 / 0 was computed there."""
    at = lambda size: SimpleNamespace(sigma=np.ones((4, 2)), residual=np.tile([size, 0.0], (4, 1)))
    directions = {"the base's y axis": np.zeros((4, 2)), "the base's x axis": np.tile([1.0, 0.0], (4, 1))}
    name, before, after = _own_direction(at(1.0), at(2.0), SimpleNamespace(joint=None, station=Station.LOAD),
                                         directions)
    assert name == "the base's x axis" and before.tolist() == [2.0] * 4 and after.tolist() == [1.0] * 4
    del directions[name]
    none = _own_direction(at(1.0), at(2.0), SimpleNamespace(joint=None, station=Station.LOAD), directions)
    assert none == (None, None, None)


def test_an_effect_of_the_device_is_drawn_along_the_device():
    """A longer range was drawn as a turn of axis 6, which the target hardly shows in some rows."""
    fitted, without = (SimpleNamespace(sigma=np.ones(2), residual=np.tile(row, (4, 1)))
                       for row in ([0.5, 0.0], [1.0, 1.0]))
    device, turn = axis_of("device", "x"), turn_of(6)
    directions = {device: np.tile([1.0, 0.0], (4, 1)), turn: np.tile([0.0, 1e-3], (4, 1))}
    along = lambda station: _own_direction(fitted, without, SimpleNamespace(joint=None, station=station),
                                           directions)[0]
    assert along(Station.DEVICE) == device and along(Station.LOAD) == turn


@pytest.mark.slow
def test_a_torque_has_the_size_at_the_tool_that_it_has_through_a_declared_spring():
    """3 Nm of axis 3 (which act alike, whichever way it turns) over its stiffness, times the distance of the
    flange from the axis."""
    robot = ea.load_robot("racer-7-1.4")
    # any seed: 3 Nm stand far above the noise (4 to 6 tried)
    made = ea.simulate(robot, measure="motion", runs=3, seconds=4.0, seed=4, rate_hz=200.0, effects=[
        "asymmetric_friction joint=3 coulomb_Nm=3 viscous_Nm_s=0"])
    found = diagnose(robot, made.data)
    (own,) = [c for c in found.contributions if c.effect.name == "asymmetric_friction"]
    q = np.array([made.data.joints["theta"][row] / robot.ratios for row in range(0, len(made.data), 40)])
    place = lambda angles: np.array([robot.fk(each).position for each in angles])
    lever = np.median(np.linalg.norm(place(q + 1e-4 * np.eye(6)[2]) - place(q), axis=1)) / 1e-4
    assert own.at_tool == pytest.approx(3.0 / robot.joints[2].spring_linear * lever, rel=0.1)


def test_torques_through_a_joint_of_unknown_stiffness_have_no_size_at_the_tool():
    robot = ea.load_robot("racer-7-1.4").with_joint(2, spring_linear=None)
    fitted = SimpleNamespace(robot=robot, measured=np.array([0, 2, 4]))
    torque = np.outer(np.sin(np.arange(50.0)), [1.0, 2.0, 1e-3])
    assert _loaded_without_spring(fitted, torque) == (3,)
    assert _loaded_without_spring(fitted, torque * [1.0, 0.0, 1.0]) == ()
    told = [SimpleNamespace(tool=None, rigid=axes) for axes in ((3,), ())]
    note = _at_tool_note(SimpleNamespace(unit="Nm", robot=robot), told)
    assert note.startswith("No size at the tool where the robot file declares no stiffness")
    assert note.endswith("none on axis 3. ")


def test_a_fast_wave_beside_slow_errors_is_judged_without_what_changes_more_slowly():
    """1e-5 rad of order 300 beside a slow wave of 1e-4 rad that happens to speak against it."""
    phi = np.linspace(0.0, 1.0, 3000)
    wave, slow = 1e-5 * np.sin(300.0 * phi), 1e-4 * np.sin(3.0 * phi)
    parameters = [SimpleNamespace(name="order_per_rev")]
    effect = SimpleNamespace(index=0, value_of=lambda name: 300.0, parameters=lambda: parameters)
    fitted = SimpleNamespace(layout=SimpleNamespace(effects=[effect]), view=SimpleNamespace(phi=phi[:, None]))
    waves = _waves(fitted, 0)
    assert waves[-1] == 47  # 300 / 2 pi of them in one rad, cut from 0 on
    rms = lambda values: np.sqrt(np.mean(_less_mean(values, waves) ** 2))
    steepest = 3.0 * 1e-4 * 2.0 * np.pi / 300.0  # of the slow one over a wave: a ramp's RMS is a part of it
    assert rms(slow) < steepest / np.sqrt(12.0) and rms(wave) > 0.99 * np.sqrt(np.mean(wave**2))
    assert _waves(SimpleNamespace(layout=fitted.layout, view=SimpleNamespace(phi=phi[::30, None])), 0) is None


@pytest.mark.slow
def test_every_finding_of_the_shipped_gear_runs_has_a_picture_that_lowers_its_own_error():
    """A wave of 24 urad beside slow errors of 60 urad had none: it does not lower the plain residual."""
    robot = ea.load_robot("kr300")
    runs = [ea.example(f"kr300/run_{name}") for name in "AB"]
    data = ea.read(runs, robot, kind="gear_run")
    found = diagnose(robot, data)
    shown = {c.effect.label: c for c in found.contributions}
    assert {finding.effect.label for finding in found.findings} == set(shown) and len(shown) >= 2
    assert all(c.rms[1] < c.rms[0] for c in shown.values())


def test_of_a_push_the_largest_component_is_told():
    values = (14.5, -0.4e-3, 3.2e-3, -0.1e-3, 0.0, 0.0, 0.0)
    half = np.array([1.0, 0.1e-3, 0.1e-3, 0.2e-3, 0.0, 0.0, 0.0])
    finding = SimpleNamespace(effect=TrackerStep(None, values), derived={},
                              intervals=np.stack([values - half, values + half], axis=1))
    measure, size = _size(finding, None, ea.load_robot("ur10"))
    assert measure == "y" and size.value == 3.2e-3


def test_of_a_joint_that_gives_way_the_compliance_is_told_and_no_correction_of_its_load():
    """`tip`, what the guessed mass at the flange is off by, stood for the stiffness where it was larger."""
    effect = RelativeCompliance(3, (3.8e-6, 4.9e-6, 0.0, 0.0), False, False, True)
    half = np.array([4e-7, 1e-6, 0.0, 0.0])
    finding = SimpleNamespace(effect=effect, derived={},
                              intervals=np.stack([effect.values - half, effect.values + half], axis=1))
    measure, size = _size(finding, None, ea.load_robot("gen3lite"))
    assert measure == "linear" and size.value == 3.8e-6


def test_waves_of_an_axis_that_slides_are_told_by_their_length():
    robot = ea.load_robot("ur10")
    wave = GearHarmonics(1, (100.0 * np.pi, -0.03, 0.04))
    finding = SimpleNamespace(effect=wave, probability=1.0)
    rail = replace(robot, joints=(replace(robot.joints[0], type="prismatic"), *robot.joints[1:]))
    (axis, each, size, source), = orders_table([(finding, None)], rail).rows
    assert (axis, each, source) == ("1", "every 20.0 mm", "")
    assert (size.value, size.unit) == (pytest.approx(0.05 / (100.0 * np.pi)), "m")
    (_, each, size, _), = orders_table([(finding, None)], robot).rows
    assert (each.value, size.unit) == (pytest.approx(100.0 * np.pi), "rad")


def test_the_size_at_the_tool_is_that_of_the_rows_that_are_moved():
    """A zero that moved in the last quarter of the rows: their median, not that of all."""
    moved = np.zeros((40, 3))
    moved[30:, 1] = 2e-3
    without = SimpleNamespace(whiten=lambda rows: rows.reshape(-1, 1) / 1e-4, cleared=lambda columns: columns,
                              data_numbers=120, sigma=np.full(3, 1e-4))
    assert np.allclose(_at_tool(without, moved), np.full(10, 2e-3))


def test_rows_left_out_are_told_of_both_sets_and_many_in_the_verdict():
    def result(excluded, before, after, undecided=()):
        sets = [{"identification": SimpleNamespace(n=50), "validation": SimpleNamespace(n=n)}
                for n in (before, after)]
        elsewhere = tuple(f"row {k}" for k in range(before - after - len(undecided)))
        return SimpleNamespace(excluded=excluded, before=sets[0], after=sets[1], excluded_elsewhere=elsewhere,
                               excluded_more=False, undecided=undecided)

    assert _outliers(result(0, 18, 18)) == () and _many_left_out(result(0, 18, 18), "validation") == ""
    assert _outliers(result(1, 18, 18)) == ("1 identification row was left out as an outlier",)
    many = result(1, 18, 15)
    often = SimpleNamespace(**vars(many) | {"excluded_more": True})
    assert _outliers(often)[0].startswith(_outliers(many)[0] + "; of the rows that were not fitted")
    assert _outliers(many) == (
        "1 identification row and 3 validation rows (row 0, row 1, row 2) were left out as outliers",)
    assert _many_left_out(many, "validation") == " (3 of the 18 left out as outliers)"
    assert _many_left_out(result(2, 450, 449), "validation") == ""
    beside = result(0, 18, 16, ("row 7", "row 8"))
    assert _outliers(beside) == _between(many) == () and _many_left_out(beside, "validation") == ""
    assert _between(beside) == ("2 validation rows judge nothing (row 7, row 8): between the fitted rows "
                                "before and after what happened at once",)


def test_two_waves_of_one_axis_keep_their_own_sizes():
    """Failed before: both had the size of the overtone."""
    waves = [GearHarmonics(2, (order, size, 0.0)) for order, size in ((154.0, 0.020), (308.0, 0.018))]
    moves = [SimpleNamespace(effect=wave, peak_to_peak=(2.0 * wave.orders()[0][1], 1e-6), unit="rad",
                             at_tool=None) for wave in waves]
    findings = [SimpleNamespace(effect=wave, probability=1.0, intervals=np.zeros((3, 2)), derived={})
                for wave in waves]
    found = SimpleNamespace(contributions=moves, findings=findings, robot=ea.load_robot("ur10"), unit="m")
    found.contribution_of = lambda finding: Diagnosis.contribution_of(found, finding)
    assert [own for _, own in found_effects(found)] == moves
    rows = [_row(found, *pair) for pair in found_effects(found)]
    assert [row[2] for row in rows] == ["peak to peak, order 154", "peak to peak, order 308"]
    assert [row[3].value for row in rows] == [2.0 * wave.orders()[0][1] for wave in waves]
