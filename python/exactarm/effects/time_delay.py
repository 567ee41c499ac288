"""Time delay: the second signal (gyroscope, link encoder, torque, tracker) is stamped later than the motor
encoder.

It shows at t what the motor did at t - delay: theta(t) -> theta(t - delay), a cubic spline through each run's
samples; past its ends the run goes on as a straight line.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy  # scipy.interpolate is imported at its first use

from exactarm.data.kinds import IN_TIME
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class TimeDelay(Effect):
    """One delay for the whole record."""

    name = "time_delay"
    plain = "a delay between two signals"
    station = Station.MOTOR
    kinds = IN_TIME
    per_joint = False
    sentence = "the measured signal comes {delay_s:.4g} s after the motor encoder"
    source = "sampling: signals of two devices, one clock"
    parameter_table = (Parameter("delay_s", 2e-3, -0.1, 0.1),)

    def change(self, view) -> Change:
        value, derivative = np.zeros((2, view.rows, view.axes))
        columns = np.flatnonzero(view.moving)
        for rows in view.runs:
            if rows.size < 4:
                continue
            time = view.data.time[rows]
            spline = scipy.interpolate.CubicSpline(time, view.theta[np.ix_(rows, columns)])
            late = time - self.values[0]
            inside = np.clip(late, time[0], time[-1])
            slope = spline(inside, 1)
            value[np.ix_(rows, columns)] = spline(inside) + (late - inside)[:, None] * slope
            value[np.ix_(rows, columns)] -= view.theta[np.ix_(rows, columns)]
            derivative[np.ix_(rows, columns)] = -slope
        return Change(tuple(range(view.axes)), value, derivative[:, :, None])

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0,)),) if view.is_series else ()
