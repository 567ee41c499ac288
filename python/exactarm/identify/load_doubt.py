"""What the noise of measured torques leaves open of the springs that they load.

Torques known to e along any shape of unit mean square leave a size on them open by e / |r| of itself, r the
part of their shape that nothing else makes up for: 1 / |r| is standard deviation x length of the whitened
column, over the spread of the torques.
"""

from dataclasses import replace

import numpy as np

from exactarm.identify.pose_fit import PoseFit
from exactarm.rest_load import RestLoad


def left_open(load: RestLoad, index: int, value: float, deviation: float, column: np.ndarray) -> float:
    """Standard deviation of a size at axis `index` (from 0) by the noise of the torques alone; deviation: its
    own for torques as they are; column: whitened, of its derivatives."""
    return abs(value) * load.doubt(index) * deviation * float(np.linalg.norm(column))


def with_load_doubt(fit: PoseFit) -> PoseFit:
    """The fit with the variances of its springs on measured loads as the noise of these leaves them."""
    view, covariance = fit.prediction.view, fit.fit.covariance.copy()
    layout, components = fit.layout, len(fit.sigma)
    for effect, where in zip(layout.effects, layout.slices):
        if not (effect.per_load and effect.joint is not None and view.measured_loads[effect.index]):
            continue
        for k in range(where.start, where.stop):
            column = fit.prediction.jacobian[:, :components, k] / fit.sigma
            covariance[k, k] += left_open(view.rest_load, effect.index, layout.values[k],
                                          np.sqrt(fit.fit.covariance[k, k]), column) ** 2
    return replace(fit, fit=replace(fit.fit, covariance=covariance))
