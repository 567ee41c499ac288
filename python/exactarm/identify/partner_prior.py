"""What the robot file of a partner arm leaves open of it: the prior of its deviations beside an arm's own.

    parameters = those of the file + F z,    z standard normal

A file that a calibration wrote says it: F is the factor of its [covariance], else the standard deviations of
its [intervals]; what has none there stays as it is. A drawing leaves all parameters open by their plausible
sizes. A calibrated file is suspected where the partner as a mere drawing fits far better: by so many times
the price of its parameters (Schwarz 1978), for effects that the arm lacks buy some of it too.
"""

from collections.abc import Iterable

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.identify.declared import geometry_layout
from exactarm.measurement.partner import FRAMES, NAME, Partner
from exactarm.robot.covariance import ParameterCovariance
from exactarm.robot.robot import Robot

_NINETY_FIVE = 1.959964
_OTHER_ARM = 2.0  # times Schwarz' price
NO_SCALE = (
    "the partner's robot file is a drawing ([intervals] are missing): it is estimated beside the arm, and "
    "tells no scale; a calibrated file of the partner does")
WRONG_PARTNER = (
    "the touches fit far better with the partner free as a drawing is ({before:.3g} mm to {after:.3g} mm "
    "RMS) than with the intervals of its file: is {file} the file of this arm, calibrated as it is now?")


def calibrated(robot: Robot) -> bool:
    """Whether lengths of its file come from a calibration."""
    return any(name in robot.intervals and name.unit == "m" for name in geometry_layout(robot).names)


def prior_of(robot: Robot, drawn: bool = False) -> tuple[Layout, np.ndarray]:
    """The partner's free parameters, and F (P, r); drawn: as if its file were a drawing."""
    geometry = geometry_layout(robot)
    if drawn or not calibrated(robot):
        return geometry, np.diag([parameter.plausible for parameter in geometry.parameters])
    widths = {name: high - low for name, (low, high) in robot.intervals.items() if high > low}
    known = robot.covariance
    if known is not None:
        widths = {name: width for name, width in widths.items() if name in known.names}
    arm = geometry.without(set(geometry.names) - set(widths))
    if known is None:
        return arm, np.diag([0.5 * widths[name] / _NINETY_FIVE for name in arm.names])
    factor = known.matrix()[[known.names.index(name) for name in arm.names]]
    return arm, ParameterCovariance.of(arm.names, factor @ factor.T, known.noise_m).matrix()


def with_open_partner(layout: Layout, drawn: bool = False) -> Layout:
    """The layout with a partner's deviations free, as its file leaves them open; drawn: as a drawing does."""
    opened = lambda effect: effect.open_to(*prior_of(effect.declared_as.robot, drawn))
    effects = [opened(effect) if isinstance(effect, Partner) else effect for effect in layout.effects]
    free = [np.ones(len(new.parameters()), bool) if isinstance(new, Partner) else mask
            for new, mask in zip(effects, layout.free)]
    return Layout(tuple(effects), tuple(free))


def known_of_partner(layout: Layout) -> set[str]:
    """Names of the deviations that a partner's calibration leaves: too small to take a parameter's place."""
    return {effect.parameter_label(parameter) for effect in layout.effects
            if isinstance(effect, Partner) and calibrated(effect.declared_as.robot)
            for parameter in effect.parameters()[FRAMES:]}


def partner_tells_scale(data: Dataset) -> bool:
    """Whether rows touch a partner whose lengths are known."""
    partner = data.fixture.partner
    touched = NAME in data.contacts and bool((data.contacts[NAME] >= 0).any())
    return touched and partner is not None and partner.robot is not None and calibrated(partner.robot)


def partner_warnings(fit: ClosureFit, data: Dataset, pulls: Pulls, threads: int = 1) -> Iterable[str]:
    """What a fit with a partner has to say of it."""
    partner = next((effect for effect in fit.layout.effects if isinstance(effect, Partner)), None)
    if partner is None:
        return
    if not calibrated(partner.declared_as.robot):
        yield NO_SCALE
        return
    rival = fit_closures(fit.robot, with_open_partner(fit.layout, drawn=True), data, pulls, threads=threads)
    price = 0.5 * len(geometry_layout(partner.declared_as.robot).names) * np.log(len(data))
    if rival.log_likelihood - fit.log_likelihood > _OTHER_ARM * price:
        rms = [1e3 * float(np.sqrt(np.mean(each.prediction.error()[partner.rows(data)] ** 2)))
               for each in (fit, rival)]
        yield WRONG_PARTNER.format(before=rms[0], after=rms[1], file=partner.declared_as.file)
