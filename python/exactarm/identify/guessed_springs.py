"""Springs that a calibration does not estimate, because the arm's masses are a guess: would they take most of
what is left?

Of a generic distribution of masses a load is right in kind, not in size (robot/generic_masses.py): that
springs act it shows, what they are a diagnosis estimates.

    share = 1 - S(J, C) / S(J),     S: square sum of the whitened residual clear of these columns; C: one
                                    column for the spring of every axis whose load is guessed
"""

from collections.abc import Iterator

import numpy as np

from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.pose_fit import PoseFit
from exactarm.numerics.orthonormal import orthonormal
from exactarm.robot.axes_in_words import axes_in_words

# of the square sum: as much by chance would take as many columns as half of the numbers
_MOST = 0.5
_NUMBERS_EACH = 10  # for every column, at least


def springs_not_estimated(fit: PoseFit) -> Iterator[str]:
    """One line where they would."""
    view, components = fit.prediction.view, len(fit.sigma)
    asked = [i for i, joint in enumerate(view.robot.joints) if view.guessed_load(i) and view.has_masses
             and joint.type == "revolute" and not joint.spring_linear]
    numbers = fit.prediction.residual(components > 3) / fit.sigma
    if not asked or numbers.size < fit.layout.size + _NUMBERS_EACH * len(asked):
        return
    whiten = lambda columns: (columns[:, :components] / fit.sigma[:, None]).reshape(numbers.size, -1)
    own = whiten(np.asarray(fit.prediction.jacobian))
    springs = np.concatenate([whiten(view.response(JointCompliance.none_of(view.robot, i))[:, :, :1])
                              for i in asked], axis=1)
    left = lambda basis: float(np.sum((numbers.ravel() - basis @ (basis.T @ numbers.ravel())) ** 2))
    rigid = left(orthonormal(own))
    share = 1.0 - left(orthonormal(np.concatenate([own, springs], axis=1))) / max(rigid, 1e-300)
    if share > _MOST:
        yield (f"springs of {axes_in_words(asked)}, which are not estimated because the robot file declares "
               f"no masses, would take {100 * share:.0f} % of what is left (square sum): `exactarm "
               "diagnose` finds them; with declared masses or measured torques they are estimated here")
