"""What the signals of a gear run are worth: encoder counts in a steady motion, the passage at reversals, and
how much of a residual is noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import butter, lfilter, sosfiltfilt

from exactarm import _core
from exactarm.chain import gear_record
from exactarm.chain.encoder_counts import smoothest
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.noise.broadband import broadband_noise, oscillation, strongest_line
from exactarm.numerics.signals import derivative, gaussian_filter, step_of_quantisation
from exactarm.robot.robot import GearTable
from exactarm.robot_file import load_robot

COUNT = 2.0 * np.pi / 65536
STEP_S = 1e-3
AXIS = 2  # of the gear under test, from 0


@pytest.fixture(scope="module")
def racer():
    return load_robot("racer-7-1.4")


def trapezoid(time, cruise, ramp=0.3):
    """Angle of a motion that starts and ends at rest."""
    rate = cruise * np.clip(np.minimum(time, time[-1] - time) / ramp - 0.3, 0.0, 1.0)
    return np.cumsum(gaussian_filter(rate, time, 10.0)) * STEP_S


def counted(angle):
    return np.round(angle / COUNT) * COUNT


@pytest.mark.parametrize("cruise", [34.65, 48.7, 11.3, 3.91])
def test_counts_of_a_steady_motion_leave_no_wave_in_its_rate(cruise):
    """One filter leaves the folded sawtooth of the counts; what is left here is what the slowest one cannot
    take out, and corners keep their rate."""
    time = np.arange(0.0, 4.0, STEP_S)
    angle = trapezoid(time, cruise)
    counts = counted(angle)[:, None]
    plain = derivative(gaussian_filter(counts, time, 100.0), time)[:, 0]
    # of the same noise: putting back what the filter rounds asks for a cutoff lower by (131.9 / 60.6)^(1/3)
    smooth = derivative(smoothest(counts, time, 77.2), time)[:, 0]
    true = derivative(angle, time)
    steady = slice(600, 3400)
    assert np.std((plain - true)[steady]) > 5.0 * np.std((smooth - true)[steady])
    assert np.std((smooth - true)[steady]) < 20.0 * COUNT
    assert np.max(np.abs(smooth - true)[50:-50]) < 1.2 * np.max(np.abs(plain - true)[50:-50])


def test_of_a_ripple_of_the_motor_no_more_than_a_quarter_of_a_count_is_lost():
    time = np.arange(0.0, 4.0, STEP_S)
    for amplitude in (0.5, 1.0, 2.0, 20.0):
        ripple = COUNT * np.sin(2.0 * np.pi * 30.0 * time)
        angle = trapezoid(time, 34.65) + amplitude * ripple
        smooth = smoothest(counted(angle)[:, None], time, 100.0)[:, 0]
        plain = gaussian_filter(counted(angle), time, 100.0)
        wave = derivative(ripple, time)[600:3400]
        lost = derivative(plain - smooth, time)[600:3400] @ wave / (wave @ wave)
        assert lost < 0.3


def test_the_counts_of_a_fast_motion_are_seen():
    """Hundreds of counts a sample: few differences are small."""
    time = np.arange(0.0, 4.0, STEP_S)
    assert_allclose(step_of_quantisation(np.round(counted(trapezoid(time, 34.65)), 9)), COUNT, rtol=1e-7)
    assert step_of_quantisation(trapezoid(time, 34.65)) == 0.0


# -- passage ---------------------------------------------------------------------------------------------
def to_and_fro(robot, passage_s, encoders):
    """Runs of one axis whose gear takes `passage_s` behind each reversal to pass from table to table."""
    orders = np.array([3.0, 40.0])
    joint = replace(robot.joints[AXIS], cw=GearTable(orders, np.array([8e-2, 2e-2]), np.zeros(2)),
                    ccw=GearTable(orders, np.array([-5e-2, 1e-2]), np.array([4e-2, 0.0])))
    joints = list(robot.joints)
    joints[AXIS] = joint
    robot = replace(robot, joints=tuple(joints), links=None)
    random, noise = np.random.default_rng(1), 3e-6 if encoders else 3e-4
    thetas, readings, times, runs = [], [], [], []
    for run in range(4):
        time = np.arange(0.0, 9.0, 0.004)
        output = 0.9 * np.sin(2.0 * np.pi * time / (2.2 + 0.3 * run)) + 0.2 * np.sin(1.3 * time + run)
        theta = np.zeros((time.size, robot.axes))
        theta[:, AXIS] = output * joint.ratio
        sign = np.sign(np.gradient(output))
        cw, ccw = (_core.gear_outputs(joint.ratio, table.core(), theta[:, AXIS])[0]
                   for table in (joint.cw, joint.ccw))
        share = _behind(sign, passage_s / 0.004)
        angle = 0.5 * (1.0 - share) * cw + 0.5 * (1.0 + share) * ccw
        thetas.append(theta), times.append(time), runs.append(np.full(time.size, run))
        if encoders:
            reading = np.full(theta.shape, np.nan)
            reading[:, AXIS] = angle + robot.offsets[AXIS] + random.normal(0.0, noise, time.size)
        else:
            reading = random.normal(0.0, noise, (time.size, 3))
            reading[:, 2] += np.gradient(angle, time)
        readings.append(reading)
    theta, reading, time, run = map(np.concatenate, (thetas, readings, times, runs))
    joints = {"theta": theta} | ({"q": reading} if encoders else {})
    return robot, Dataset.of_arrays("gear_run", joints, time=time, run=run + 1,
                                    gyro=None if encoders else reading)


def _behind(sign, rows):
    """Direction behind a moving mean over the rows before."""
    rows = max(1, round(rows))
    total = np.cumsum(np.concatenate([np.full(rows, sign[0]), sign]))
    return (total[rows:] - total[:-rows]) / rows


@pytest.mark.parametrize("encoders", [True, False])
@pytest.mark.parametrize("passage_s", [0.03, 0.12, 0.25])
@pytest.mark.slow
def test_rows_of_a_passage_are_left_out_as_long_as_it_lasts(racer, encoders, passage_s):
    robot, data = to_and_fro(racer, passage_s, encoders)
    instant = to_and_fro(racer, 0.0, encoders)[1]
    column = (lambda d: d.joints["q"][:, AXIS]) if encoders else (lambda d: d.gyro[:, 2])
    off = np.abs(column(data) - column(instant))
    noise = 3e-6 if encoders else 3e-4
    keep = gear_record(robot, data).keep
    assert np.quantile(off[keep], 0.99) < 3.0 * noise < np.quantile(off, 0.99)
    kept_before = gear_record(robot, instant).keep.mean()
    assert kept_before - keep.mean() < 1.6 * passage_s * 8.0 / 9.0 + 0.02  # about eight reversals in 9 s


@pytest.mark.parametrize("encoders", [True, False])
def test_without_a_passage_no_row_is_lost(racer, encoders):
    robot, data = to_and_fro(racer, 0.0, encoders)
    record = gear_record(robot, data)
    slow = np.abs(record.theta_dot[:, AXIS]) < 0.03 * np.max(np.abs(record.theta_dot[:, AXIS]))
    assert record.keep[~slow].mean() > 0.99


# -- noise -----------------------------------------------------------------------------------------------
def coloured(kind, count, random):
    white = random.normal(size=count)
    if kind == "low-passed in the sensor":
        values = sosfiltfilt(butter(2, 0.12, output="sos"), white)
    elif kind == "autoregression":
        values = lfilter([1.0], [1.0, -np.exp(-1.0 / 25.0)], white)
    else:
        values = random.standard_t(4, size=count)
    return values / values.std()


@pytest.mark.parametrize("kind", ["low-passed in the sensor", "autoregression", "heavy tails"])
def test_noise_of_any_colour_is_noise_and_lines_are_not(kind):
    random = np.random.default_rng(4)
    pieces = [coloured(kind, 3000, random) for _ in range(4)]
    assert_allclose(broadband_noise(pieces), 1.0, rtol=0.05)
    wave = 2.0 * np.sin(0.21 * np.arange(3000))
    assert_allclose(broadband_noise([piece + wave for piece in pieces]), 1.0, rtol=0.06)


def test_short_pieces_say_nothing_of_the_noise():
    random = np.random.default_rng(5)
    assert broadband_noise([random.normal(size=40) for _ in range(50)]) is None
    assert broadband_noise([random.normal(size=40), random.normal(size=400)]) is not None


def test_the_strongest_line_is_found_in_coloured_noise():
    random = np.random.default_rng(6)
    piece = coloured("autoregression", 4000, random)
    piece += 0.4 * np.sin(2.0 * np.pi * 31.0 * np.arange(4000) * 2e-3)
    assert_allclose(strongest_line([piece, piece[:200]], 2e-3), 31.0, atol=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("shaken", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_vibration_in_time_is_told_and_no_gear_is_blamed_alone(racer, shaken):
    """A floor that shakes at 23 Hz in every run, whatever the speed: the verdict is `unexplained`. The clean
    runs, whose gyroscope low-passes its own noise, lack nothing."""
    robot, data = to_and_fro(racer, 0.0, False)
    random = np.random.default_rng(8)
    gyro = data.gyro.copy()
    gyro[:, 2] += lfilter([1.0], [1.0, -0.9], random.normal(0.0, 2e-4, len(data)))
    if shaken:
        gyro[:, 2] += 6e-4 * np.sin(2.0 * np.pi * 23.0 * data.time + 1.3 * data.run)
    result = diagnose(robot, replace(data, gyro=gyro))
    assert result.verdict == ("unexplained" if shaken else "no_undeclared_effect")
    assert (result.findings == ()) or shaken
    assert ("23" in " ".join(map(str, result.unknown))) == shaken


@pytest.mark.parametrize("wave_rad", [0.0, pytest.param(2e-5, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_counts_of_both_encoders_are_no_gear(racer, wave_rad):
    """Nothing but rounding, to 6 urad at the link: seven waves of the gear at 1.00 before. A wave above it is
    found."""
    random = np.random.default_rng(2)
    joint, link = racer.joints[AXIS], 2.0 * np.pi / 2**20
    robot = replace(racer, links=None, joints=tuple(replace(j, cw=None, ccw=None) for j in racer.joints))
    parts = []
    for run in range(6):
        time = np.arange(0.0, 4.0, STEP_S)
        output = trapezoid(time, 0.6 + 0.25 * run) * (1.0 if run % 2 else -1.0)
        theta, q = np.zeros((time.size, 6)), np.full((time.size, 6), np.nan)
        theta[:, AXIS] = np.round(output * joint.ratio / COUNT) * COUNT
        angle = output + wave_rad * np.cos(3.0 * output) + racer.offsets[AXIS]
        q[:, AXIS] = np.round((angle + random.normal(0.0, 1e-8, time.size)) / link) * link
        parts.append((theta, q, time, np.full(time.size, run + 1)))
    theta, q, time, run = map(np.concatenate, zip(*parts))
    result = diagnose(robot, Dataset.of_arrays("gear_run", {"theta": theta, "q": q}, time=time, run=run))
    if wave_rad:
        assert result.verdict == "explained" and {f.effect.joint for f in result.findings} == {AXIS + 1}
        assert result.after["validation"].rms < 0.4 * result.before["validation"].rms
    else:
        assert result.findings == () and result.verdict == "no_undeclared_effect"


@pytest.mark.parametrize("kind", ["low-passed in the sensor", "autoregression", "heavy tails", "random walk"])
@pytest.mark.slow
def test_noise_of_any_colour_is_no_oscillation(kind):
    random = np.random.default_rng(11)
    for _ in range(20):
        noise = [np.cumsum(random.normal(size=400)) if kind == "random walk" else coloured(kind, 400, random)
                 for _ in range(6)]
        assert not oscillation(noise)


def test_a_wave_whose_frequency_wanders_is_an_oscillation_and_no_noise():
    """Its lines run into each other in short runs: their level is taken for coloured noise."""
    random, time = np.random.default_rng(12), 0.004 * np.arange(400)
    pieces = []
    for _ in range(6):
        turn = 2.0 * np.pi * 3.7 * time + 5.0 * np.sin(2.0 * np.pi * 1.7 * time) + random.uniform(0.0, 6.0)
        pieces.append(3.0 * np.sin(turn) + random.normal(size=time.size))
    assert broadband_noise(pieces) > 2.0  # of 1
    assert oscillation(pieces)


def test_the_cut_ends_of_a_run_in_motion_carry_no_spike(racer):
    """The derivative falls to the second order there, which does not follow a wave of 60 Hz: 40 times the
    noise at the last row before."""
    order, ripple, joint = 400.0, 3e-2, racer.joints[AXIS]
    table = GearTable(np.array([order]), np.array([ripple]), np.zeros(1))
    joints = list(racer.joints)
    joints[AXIS] = replace(joint, cw=table, ccw=table)
    robot, random, noise = replace(racer, joints=tuple(joints), links=None), np.random.default_rng(9), 3e-4
    time = np.arange(0.0, 3.0, 0.0025)
    parts = []
    for run, speed in enumerate((0.94, -0.94)):
        theta, gyro = np.zeros((time.size, robot.axes)), random.normal(0.0, noise, (time.size, 3))
        theta[:, AXIS] = speed * time * joint.ratio
        fine = np.arange(-1e-3, 3.001, 1e-4)
        angle = _core.gear_outputs(joint.ratio, table.core(), speed * fine * joint.ratio)[0]
        gyro[:, 2] += np.interp(time, fine, np.gradient(angle, fine))
        parts.append((theta, gyro, time, np.full(time.size, run + 1)))
    theta, gyro, times, run = map(np.concatenate, zip(*parts))
    data = Dataset.of_arrays("gear_run", {"theta": theta}, time=times, run=run, gyro=gyro)
    record = gear_record(robot, data)
    phi = _core.gear_outputs(joint.ratio, table.core(), record.theta[:, AXIS])[0]
    off = np.abs(gyro[:, 2] - record.rate(phi)) / noise
    assert np.max(off[record.keep]) < 6.0 < np.max(off)
    assert record.keep.mean() > 0.99


@pytest.mark.slow
def test_smooth_ramps_keep_their_samples_and_show_a_delay(racer):
    """A filter that lets a tenth of the gyroscope's noise through rounds ramps by six times the noise: all of
    them were left out, and a delay shows nowhere else."""
    random, noise, delay, joint = np.random.default_rng(10), 1e-3, 4e-3, racer.joints[AXIS]
    time, parts = np.arange(0.0, 4.0, 0.0025), []
    robot = replace(racer, links=None, joints=tuple(replace(j, cw=None, ccw=None) for j in racer.joints))
    fine = np.arange(-0.1, 4.0, 1e-4)
    rate = gaussian_filter(np.clip(np.minimum(fine, 3.9 - fine) / 0.25, 0.0, 1.0), fine, 6.0)
    output = np.cumsum(rate) * 1e-4
    for run, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
        theta, gyro = np.zeros((time.size, robot.axes)), random.normal(0.0, noise, (time.size, 3))
        # the sum lags the rate by half of a fine step
        theta[:, AXIS] = np.round(sign * np.interp(time, fine + 5e-5, output) * joint.ratio / 1.5e-3) * 1.5e-3
        gyro[:, 2] += sign * np.interp(time - delay, fine, rate)
        parts.append((theta, gyro, time, np.full(time.size, run + 1)))
    theta, gyro, times, run = map(np.concatenate, zip(*parts))
    data = Dataset.of_arrays("gear_run", {"theta": theta}, time=times, run=run, gyro=gyro)
    record = gear_record(robot, data)
    assert record.cutoff_hz < 60.0 and record.keep.mean() > 0.97
    result = diagnose(robot, data)
    assert [finding.effect.name for finding in result.findings] == ["time_delay"]
    assert_allclose(result.findings[0].effect.values[0], delay, atol=1e-4)
