"""Something else under a gyroscope: what the library lacks is told by what turns and what it follows, and no
effect stands for it with certainty."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.signal import LOAD, TIME, Signal
from exactarm.diagnose.something_else import beside_unknown
from exactarm.diagnose.unknown import Wave
from exactarm.diagnose.verdict import UNEXPLAINED
from exactarm.effects import library
from exactarm.effects.gear_harmonics import GearHarmonics
from gear_simulation import DEGREE, GearRuns, joined, simulate
from rigid_arm import rigid

RATE_HZ, NOISE = 400.0, 0.05 * DEGREE
ORDER, SIZE = 23.0, 2e-3


@pytest.fixture(scope="module")
def racer():
    return rigid()


def runs(robot, sizes=(0.0, 0.0)) -> Dataset:
    """Two speeds of axis 2, to and fro, twice at 20 and twice at 40 degrees C; sizes of a wave of its gear at
    either."""
    parts, warm = [], []
    for number, (speed, size) in enumerate((speed, size) for size in sizes for speed in (40.0, 80.0)):
        case = GearRuns(2, speed * DEGREE, 4, RATE_HZ, NOISE, seed=5 + number, first_run=1 + 4 * number)
        wave = lambda time, phi, direction, size=size: size * np.sin(ORDER * phi) / ORDER
        parts.append(simulate(robot, case, rest=np.zeros(6), extra=wave))
        warm.append(np.full(len(parts[-1]), 20.0 if number < 2 else 40.0))
    return replace(joined(*parts), covariates={"temperature_degC": np.concatenate(warm)})


def share_of_the_wave(robot, data: Dataset):
    problem = problem_for(robot, data, data.select(np.zeros(len(data), bool)), 1, 0)
    effect, declared = GearHarmonics.zero(2, (ORDER,)), problem.declared()
    fitted = problem.fit(declared.joined(Layout.of((effect,))))
    without = fitted.without(len(declared.effects))
    steps = [(without, fitted.layout.effects[-1])]
    numbers = problem.correlation_factor(fitted) * fitted.residual.size
    return beside_unknown(problem, steps, lambda _: [effect], lambda _: numbers)


@pytest.mark.slow
def test_a_wave_of_a_gear_is_likelier_than_one_that_changes(racer):
    assert share_of_the_wave(racer, runs(racer, (SIZE, SIZE))).share > 0.99


@pytest.mark.slow
def test_a_wave_whose_size_changes_with_a_covariate_is_no_wave_of_a_gear(racer):
    found = share_of_the_wave(racer, runs(racer, (SIZE, 2.0 * SIZE)))
    assert found.share < 1e-6
    assert str(found.likeliest) == ("a turn of axis 2 follows the angle of axis 2 and the temperature_degC "
                                    f"in {ORDER:.4g} waves a turn")


@pytest.mark.slow
def test_a_delay_that_the_library_lacks_follows_the_speed(racer, monkeypatch):
    monkeypatch.delitem(library(), "time_delay")
    clean = runs(racer)
    late = clean.gyro.copy()
    for run in np.unique(clean.run):
        rows = np.flatnonzero(clean.run == run)
        late[rows[3:]], late[rows[:3]] = clean.gyro[rows[:-3]], clean.gyro[rows[0]]
    result = diagnose(racer, replace(clean, gyro=late))
    assert result.verdict == UNEXPLAINED
    assert not [finding for finding in result.findings if finding.probability > 0.5]
    assert str(result.unknown[0]) == "a turn of axis 2 follows the speed of axis 2"


@pytest.mark.slow
def test_a_sensor_that_follows_a_covariate_is_told_with_its_axis(racer, monkeypatch):
    """A bias that bends with the temperature, as no effect of this library does."""
    monkeypatch.delitem(library(), "thermal_drift")
    clean = runs(racer)
    warm = np.linspace(20.0, 40.0, len(clean))
    biased = clean.gyro + 3e-3 * np.sin((warm - 20.0) / 4.0)[:, None] * np.array([0.0, 0.0, 1.0])
    result = diagnose(racer, replace(clean, gyro=biased, covariates={"temperature_degC": warm}))
    assert result.verdict == UNEXPLAINED
    assert "the sensor's z axis follows the temperature_degC" in map(str, result.unknown)


@pytest.mark.slow
def test_waves_that_may_change_are_those_of_an_effect_and_of_the_tables(racer):
    data = runs(racer)
    problem = problem_for(racer, data, data.select(np.zeros(len(data), bool)), 1, 0)
    fitted = problem.fit(problem.declared())
    wave = GearHarmonics.zero(2, (ORDER,))
    of_tables = problem.unknown_waves(fitted)
    asked = set(problem.unknown_waves(fitted, [wave])) - set(of_tables)
    assert {(one.axis, one.order) for one in asked} == {(2, ORDER)}
    assert {one.by for one in asked} == {Signal(TIME), Signal("temperature_degC"), Signal(LOAD, 2)} & set(
        problem.signals(fitted))
    assert all(isinstance(one, Wave) and one.by is not None for one in of_tables)
