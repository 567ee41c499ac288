"""What the rows do not show of an effect has no value and no interval, and nothing that follows from it."""

from types import SimpleNamespace

import numpy as np

from exactarm.diagnose.intervals import derived_of, intervals_of, unseen
from exactarm.effects.payload import Payload
from exactarm.effects.thermal_drift import ThermalLubricant

ALL = np.ones(4, bool), slice(0, 4)


def state_of(deviations):
    deviations = np.array(deviations)
    return SimpleNamespace(
        fit=SimpleNamespace(covariance=np.diag(deviations**2), half_width=lambda sigma: 2.0 * sigma,
                            interval=lambda: np.stack([-2.0 * deviations, 2.0 * deviations], axis=1)),
        view=SimpleNamespace(robot=SimpleNamespace(generic_masses=False)))


def test_the_moment_along_the_last_axis_of_a_scara_is_not_seen():
    free, where = ALL
    payload = Payload(None, (1.2, 0.024, 0.0, 5e-14))
    last = state_of([1e-3, 1e-4, 1e-4, 2e13])
    assert list(unseen(payload, last, where, free)) == [False, False, False, True]
    intervals = intervals_of(payload, last, where, free)
    assert list(np.isnan(intervals[:, 0])) == [False, False, False, True]
    derived = derived_of(payload, last, where, free)
    assert list(derived) == ["com_x_m", "com_y_m"]
    value, low, high = derived["com_x_m"]
    assert value == 0.024 / 1.2 and 0.0 < value - low < 1e-3 and abs(high + low - 2.0 * value) < 1e-12


def test_a_value_that_is_poorly_known_keeps_its_interval():
    free, where = ALL
    payload = Payload(None, (1.2, 0.024, 0.0, 0.1))
    last = state_of([1e-3, 1e-4, 1e-4, 3.0])  # three times what is plausible
    assert not unseen(payload, last, where, free).any()
    assert "com_z_m" in derived_of(payload, last, where, free)


def test_a_rate_by_the_hour_may_be_as_quick_as_a_record_of_seconds_shows():
    """Half of the friction in half a minute is 60 per hour; 0.01 per hour of warming up is plausible."""
    last = state_of([15.0])  # per hour
    last.view.data = SimpleNamespace(time=np.linspace(0.0, 30.0, 50), row=np.arange(50), run=np.ones(50, int),
                                     visit=None, joints={})
    lubricant = ThermalLubricant(None, (60.0,), "time")
    assert not unseen(lubricant, last, slice(0, 1), np.ones(1, bool)).any()
    last.view.data.time = np.linspace(0.0, 7200.0, 50)
    assert unseen(lubricant, last, slice(0, 1), np.ones(1, bool)).all()
