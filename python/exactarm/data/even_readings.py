"""Readings of runs whose samples were taken off an even clock, as their stamps say: moved to that clock.

Gear runs are predicted on an even clock (`GearRecord.time`): derivatives and filters ask for it. The motors'
angles go there with the record; what was read beside them goes there here, by a spline through the samples at
their stamps. Left there, a gyroscope errs by acceleration times jitter (9 rad/s², 1 ms: 9 mrad/s, at the
corners of a motion profile), an encoder by speed times jitter. Readings that were taken evenly and stamped
unevenly do not follow their stamps (`stamps_are_true`), and stay.
"""

from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import rows_of_runs
from exactarm.numerics.signals import at_even_times, even_clock
from exactarm.numerics.stamps import order_of_sampling


def at_even_readings(data: Dataset) -> Dataset:
    """The data of gear runs with gyroscope and link encoders as they would have read on the even clock."""
    if data.time is None or not len(data):
        return data
    gyro = None if data.gyro is None else data.gyro.copy()
    joints = dict(data.joints)
    if gyro is None and "q" in joints:
        joints["q"] = joints["q"].copy()
    reading = gyro if gyro is not None else joints.get("q")
    if reading is None:
        return data
    for rows in rows_of_runs(data):
        rows = rows[order_of_sampling(data.time[rows])]
        stamps = data.time[rows]
        clock = even_clock(stamps)
        known = np.flatnonzero(np.isfinite(reading[rows]).all(axis=0))
        if clock is not stamps and known.size:
            values = reading[np.ix_(rows, known)]
            main = int(np.argmax(np.ptp(values, axis=0)))
            reading[np.ix_(rows, known)] = at_even_times(values, stamps, clock, main)
    return replace(data, gyro=gyro, joints=joints)
