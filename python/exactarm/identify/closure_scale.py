"""The scale of closures: whether anything tells how large the robot is, and what is held where nothing does.

All lengths of robot and surroundings times a common factor close as well. Where nothing gives a length, the
longest one of the robot keeps its declared value, and every interval knows that it is only as good as a
drawing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.dataset import Dataset
from exactarm.identify.closure_fit import ClosureFit
from exactarm.identify.partner_prior import partner_tells_scale
from exactarm.measurement.closures import device_of
from exactarm.measurement.contacts import SENSORS
from exactarm.measurement.known_lengths import known_lengths


def scale_is_known(layout: Layout, data: Dataset) -> bool:
    """Whether a known length, an absolute bar, a calibrated partner or a tracker tells the size of things, or
    nothing has any."""
    if gravity_alone(data):
        return True
    tracked = data.position is not None and bool(np.isfinite(data.position).any())
    read = data.length is not None and bool(np.isfinite(data.length).any())
    return tracked or read or partner_tells_scale(data) or bool(known_lengths(layout, data.fixture))


def gravity_alone(data: Dataset) -> bool:
    """Whether no row of `touches` shows a length."""
    return bool(np.isin(device_of(data), list(SENSORS)).all())


def longest_length(layout: Layout, held: set[str], first: int) -> str:
    """The longest length of the robot that is still free."""
    lengths = [
        (abs(value), name) for name, value in zip(layout.names[first:], layout.values[first:])
        if name.endswith("_m") and name not in held
    ]
    return max(lengths)[1]


def with_scale_in_doubt(fit: ClosureFit, geometry: Layout) -> ClosureFit:
    """The fit whose intervals know that the length which holds the scale is only as good as a drawing."""
    free = set(fit.layout.names)
    held = {name: abs(value) for name, value in zip(geometry.names, geometry.values)
            if name.endswith("_m") and name not in free}
    longest = max(held, key=lambda name: held[name])
    doubt = geometry.parameters[geometry.names.index(longest)].plausible / max(held[longest], 1e-9)
    # a face's h counts from its own point
    grows = np.array([name.endswith("_m") and not name.endswith("_h_m") for name in fit.layout.names])
    growth = np.where(grows, fit.layout.values, 0.0)
    covariance = fit.fit.covariance + doubt**2 * np.outer(growth, growth)
    return replace(fit, fit=replace(fit.fit, covariance=covariance))
