"""Where an arm swings after it has accelerated, as the data have it: no quasi-static gear holds there.

An arm rings for tenths of a second behind a ramp, at the ends of its range, where a run-out and another ratio
differ most. What the gear leaves (below MOTION_HZ) is compared by the time since the motor last accelerated:

    rms(less than T since) > SCATTER rms(more than QUIET_S since):    rows less than T since are left out

with the least T of STEPS_S behind which what is left is no more than far from any ramp. Only where most of
the motion is far from one: on a short range there is nothing else, and it stays as it is.
"""

import numpy as np

from exactarm.identify.gear_samples import LEAST_SPEED_SHARE, GearSamples
from exactarm.numerics.signals import MOTION_HZ, derivative, gaussian_filter

SCATTER = 1.25  # as for springs that are declared (chain/swinging.py)
QUIET_S = 1.0  # an arm of 5 Hz and 5 % of damping has lost 80 % of its swing
STEPS_S = (0.05, 0.1, 0.2, 0.4, 0.7, QUIET_S)
_ACCELERATES = 0.2  # of the highest acceleration of a run ...
_RAMPS = 0.5  # ... if its rate changes by so much of the highest: else it was cut in motion
_LEAST_FAR = 0.5  # of the rows in motion


def swinging(samples: GearSamples, error: np.ndarray) -> tuple[np.ndarray, float]:
    """(N,) bool rows to leave out, and T in s; error (N,): what a gear leaves, unfiltered, NaN where rows do
    not count."""
    since, left = np.full(samples.run.size, np.inf), np.zeros(samples.run.size)
    for rows in samples.runs:
        time = samples.time[rows]
        slow = gaussian_filter(samples.rate[rows], time, MOTION_HZ)
        acceleration = np.abs(derivative(slow, time))
        if np.ptp(slow) > _RAMPS * np.max(np.abs(slow)):
            ramp = acceleration > _ACCELERATES * acceleration.max()
            last = np.maximum.accumulate(np.where(ramp, np.arange(time.size), -1))
            since[rows] = np.where(last < 0, np.inf, time - time[last])
        left[rows] = gaussian_filter(np.nan_to_num(error[rows]), time, MOTION_HZ)
    nothing = np.zeros(since.size, bool), 0.0
    speed = np.abs(samples.rate)
    used = samples.identification & np.isfinite(error)
    used &= speed > LEAST_SPEED_SHARE * np.max(speed[used], initial=0.0)
    rms = lambda rows: float(np.sqrt(np.mean(left[rows] ** 2))) if rows.any() else 0.0
    far, near = used & (since > QUIET_S), used & (since <= STEPS_S[0])
    limit = SCATTER * rms(far)
    if far.sum() < _LEAST_FAR * used.sum() or rms(near) <= limit:
        return nothing
    calm = lambda step, end: rms(used & (since > step) & (since <= end)) <= limit
    reach = next((step for step, end in zip(STEPS_S, STEPS_S[1:]) if calm(step, end)), QUIET_S)
    return since <= reach, reach
