"""Kinematic calibration from measured poses (thesis 3.2.3, (3.12)), frames without starting values.

1. frames of every session, 2. which parameters the poses can identify, 3. weighted non-linear least squares
of frames, modified DH parameters, joint offsets, gear ratios and joint compliance, 4. intervals, 5. the error
before and after on rows that were fitted and on rows that were not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES, kind_of
from exactarm.data.split import DEFAULT_SEED, pose_groups
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.errors import InputError
from exactarm.identify.compliance import compliance_layout
from exactarm.identify.declared import (
    all_effects,
    carried_layout,
    frames_layout,
    geometry_layout,
    require_geometry,
    with_estimates,
)
from exactarm.identify.drawing import FREE, Drawn
from exactarm.identify.identifiability import Identifiability, select_identifiable, still_axes
from exactarm.identify.load_doubt import with_load_doubt
from exactarm.identify.loads import kept_masses, with_loads
from exactarm.identify.match import require_match
from exactarm.identify.pose_fit import PoseFit, fit_poses
from exactarm.identify.repeats import worth_of_rows
from exactarm.identify.session_payloads import EstimatedPayload, payload_layout, session_payloads
from exactarm.identify.springs_left import mounted_otherwise, springs_not_estimated
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.identify.wild_rows import wild_elsewhere_line, wild_rows, wild_rows_line
from exactarm.measurement.session_payload import SessionPayload
from exactarm.numerics.factors import lstsq, svd
from exactarm.numerics.regression import Fit
from exactarm.numerics.rotation import log
from exactarm.robot.controller_frames import apart, target_on_flange
from exactarm.robot.covariance import ParameterCovariance
from exactarm.robot.robot import Placement, Robot
from exactarm.view import motor_angles

if TYPE_CHECKING:
    from exactarm.identify.closure_fit import ClosureFit

# Steps as they are told, in their order.
FRAMES, GEOMETRY, JUDGING = "base and tool frames", "geometry, gears and springs", "judging held-out rows"
_PARALLEL = 0.05  # share of all turning that is about another axis: deviations are a tenth of it
_TOLD = 4.0  # standard deviations: of noise alone one size in 16,000
_SOFTEST = 1e3  # times a plausible spring: no arm has one; so none is hidden by the noise before it is asked
_BEYOND = 3.0  # standard deviations that the data would have a parameter beyond its bound


@dataclass(frozen=True)
class CalibrationOptions:
    """orientation: use measured orientations too; compliance: axes (from 1) whose spring is estimated;
    robust: Huber's loss; None = choose."""

    orientation: bool | None = None
    compliance: tuple[int, ...] | None = None
    robust: bool | None = None
    seed: int = DEFAULT_SEED
    threads: int = 1


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration; errors in m, per row of `data`.

    beside_before, beside_after: of closures, set -> errors that are not distances from contacts, where they
    are measured: distance_error_m, mean absolute error of the known distances; tilt_error_rad, mean angle by
    which gravity's direction is missed; reprojection_px, RMS that corners in pictures are missed by.
    """

    robot: Robot
    fit: PoseFit | ClosureFit
    data: Dataset
    identification: np.ndarray
    error_before: np.ndarray
    error_after: np.ndarray
    residual_after: np.ndarray
    before: dict[str, ErrorSummary]
    after: dict[str, ErrorSummary]
    identifiability: Identifiability
    orientation: bool
    warnings: tuple[str, ...] = field(default=())
    length_doubted: bool = False  # of a fixture: a warning says which, and what the touches say
    beside_before: dict[str, dict[str, float]] = field(default_factory=dict)
    beside_after: dict[str, dict[str, float]] = field(default_factory=dict)
    drawn: Drawn = FREE
    payloads: tuple[EstimatedPayload, ...] = ()  # of each session, where some were not weighed

    @property
    def names(self) -> tuple[ParameterId, ...]:
        return self.fit.layout.names

    @property
    def intervals(self) -> np.ndarray:
        """(P, 2) 95 % intervals in the order of `names`."""
        return self.fit.fit.interval()

    @property
    def shown(self) -> Fit:
        """The fit with base and tool as of the controller's base and flange; the robot file has those of DH
        frame 0 and n."""
        fit, layout = self.fit.fit, self.fit.layout
        if not apart(self.robot.controller):
            return fit
        x, slope = fit.x.copy(), np.eye(layout.size)
        for effect, free, where in zip(layout.effects, layout.free, layout.slices):
            values, by_own = effect.in_frames_of(self.robot.controller)
            x[where], slope[where, where] = values[free], by_own[np.ix_(free, free)]
        return replace(fit, x=x, covariance=slope @ fit.covariance @ slope.T)


def calibrate(robot: Robot, data: Dataset, options: CalibrationOptions = CalibrationOptions(),
              progress: Callable[[str], None] = lambda text: None) -> Calibration:
    """Calibrates `robot` on the identification rows of `data` and judges it on the others.

    Raises InputError where the data cannot support a calibration.
    """
    require_geometry(robot)
    declared, robot = robot, with_loads(robot, data)
    orientation = data.rotation is not None if options.orientation is None else options.orientation
    if orientation and data.rotation is None:
        raise InputError("orientation was asked for, but the data has no qw..qz or rx..rz columns")
    identification = data.split(options.seed)
    train = data.select(identification)
    require_sessions(train, data)
    progress(FRAMES)
    frames, found = frames_layout(robot, train, orientation=orientation, seed=options.seed)
    require_match(robot, train, found, carried_layout(robot, train), options.seed)
    before = fit_poses(robot, frames.joined(carried_layout(robot, train)), train, orientation=orientation,
                       threads=options.threads)
    progress(GEOMETRY)
    layout = frames.joined(geometry_layout(robot)).joined(compliance_layout(robot, train, options.compliance))
    layout = layout.joined(carried_layout(robot, train))
    fit, identifiability = fit_identifiable(robot, layout, train, orientation, options)
    if options.robust is None and wild_rows(fit.error(train, options.threads)).any():
        options = replace(options, robust=True)
        fit, identifiability = fit_identifiable(robot, layout, train, orientation, options)
    carried = payload_layout(train)
    if carried.size:
        layout = Layout(fit.layout.effects, layout.free).joined(carried)
        fit, identifiability = fit_identifiable(robot, layout, train, orientation, options)
    fit = with_load_doubt(fit)
    progress(JUDGING)
    error_before = before.error(data, options.threads)
    residual = fit.residual(data, options.threads)
    error_after = np.linalg.norm(residual, axis=1)
    parts = {"identification": identification, "validation": ~identification}
    apart = wild_rows(error_after)
    rows = np.flatnonzero(~identification)
    line = (wild_rows_line(error_after, apart) if options.robust and apart.any() else
            wild_elsewhere_line(error_after[rows], lambda row: data.place_of(rows[row])))
    wild = (line,) if line else ()
    new = kept_masses(calibrated_robot(robot, train, fit.layout, fit.fit), declared)
    return Calibration(robot=new,
                       fit=fit, data=data, identification=identification, error_before=error_before,
                       error_after=error_after, residual_after=residual,
                       before={k: summarise(error_before[mask]) for k, mask in parts.items()},
                       after={k: summarise(error_after[mask]) for k, mask in parts.items()},
                       identifiability=identifiability, orientation=orientation,
                       warnings=(*_warnings(fit, train, found), *wild),
                       drawn=fit.drawn,
                       payloads=session_payloads(data, fit.layout, fit.fit.interval()))


def fit_identifiable(robot: Robot, layout: Layout, data: Dataset, orientation: bool,
                     options: CalibrationOptions) -> tuple[PoseFit, Identifiability]:
    """Fits what the poses can tell: freely, then without what turns out to lie under the noise, then drawn to
    the drawing as far as the data say (drawing.py). Readings of one pose count for what they are worth."""
    kept, result = identifiable_layout(robot, layout, data, orientation, threads=options.threads)
    require_enough(kept, data, orientation)
    worth = None

    def fit(chosen: Layout, drawn: Drawn = FREE) -> PoseFit:
        return fit_poses(robot, chosen, data, orientation=orientation, robust=bool(options.robust),
                         threads=options.threads, drawn=drawn, worth=worth)

    flat = fit(kept)
    left = flat.fit.clipped[: len(data) * (6 if orientation else 3)].reshape(len(data), -1)
    told = worth_of_rows(left / flat.sigma, pose_groups(data), kept.size)
    if told.min() < 1.0:
        worth = told
        flat = fit(kept)
    sigma = np.array([flat.sigma_position] + ([flat.sigma_orientation] if orientation else []))
    asked = robot, layout, data, orientation, sigma, options.threads, worth
    springs = {name: _SOFTEST * p.plausible for name, p in zip(layout.names, layout.parameters)
               if name.group is Group.EFFECT}
    told = _told_sizes(layout, fit(identifiable_layout(*asked, springs)[0]), fit) if springs else {}
    fewer, result = identifiable_layout(*asked, told)
    flat = flat if fewer.names == kept.names else fit(fewer)
    return fit(flat.layout, Drawn.around(geometry_layout(robot), flat.layout, flat.fit)), result


def _told_sizes(layout: Layout, flat: PoseFit, fit: Callable[[Layout], PoseFit]) -> dict[ParameterId, float]:
    """Sizes of springs and loads that stand far out of their own uncertainty: those of arms differ by orders
    of magnitude, and what is plausible for one is none of another. Lengths and angles have a tolerance.

    flat: a fit without lengths and angles that the noise hides. Of several springs that do alike none is sure
    beside the others, and the fit may give all to the weakest: as long as one is in doubt, or at its bound,
    the one that moves the tool least of it and of weaker ones is left out.
    """
    declared = dict(zip(layout.names, layout.values))
    while True:
        names = flat.layout.names
        size = np.abs(flat.fit.x - np.array([declared[name] for name in names]))
        spread = np.sqrt(np.diag(flat.fit.covariance))
        springs = np.array([name.group is Group.EFFECT for name in names])
        plausible = np.array([p.plausible for p in flat.layout.parameters])
        told = springs & (size > _TOLD * spread) & ~flat.fit.at_bound
        doubted = springs & ~told & ((spread > plausible) | flat.fit.at_bound)
        if not doubted.any():
            return {names[j]: float(size[j]) for j in np.flatnonzero(told)}
        moves = plausible * np.linalg.norm(flat.prediction.jacobian[:, :3], axis=(0, 1))
        weaker = springs & (moves <= moves[doubted].max())
        flat = fit(flat.layout.without({names[np.flatnonzero(weaker)[np.argmin(moves[weaker])]]}))


def identifiable_layout(robot: Robot, layout: Layout, data: Dataset, orientation: bool,
                        sigma: np.ndarray | None = None, threads: int = 1,
                        worth: np.ndarray | None = None,
                        told: Mapping[ParameterId, float] = MappingProxyType({})
                        ) -> tuple[Layout, Identifiability]:
    """The layout without the parameters that these poses cannot tell, and why.

    sigma (1,) or (2,): standard deviations of position (m) and orientation (rad) components, where known;
    then parameters whose estimate would be less certain than they are plausible are left out too; told: sizes
    that the data have shown, in place of a smaller plausible one. worth (N,): independent rows that each is
    worth.
    """
    prediction = predict_poses(robot, layout, data, threads=threads)
    rows = prediction.jacobian if orientation else prediction.jacobian[:, :3]
    share = np.ones(len(rows)) if worth is None else np.sqrt(worth)
    weights = None if sigma is None else np.outer(share, np.repeat(1.0 / sigma, 3)).ravel()
    result = select_identifiable(rows.reshape(-1, layout.size), layout.names,
                                 keep_first=sum(name.group is Group.FRAME for name in layout.names),
                                 poses=len(rows), weights=weights, sigma=None if sigma is None else 1.0,
                                 plausible=[max(p.plausible, told.get(name, 0.0))
                                            for name, p in zip(layout.names, layout.parameters)],
                                 robot=robot, still=still_axes(prediction.view.q))
    return layout.without(set(result.dropped_names)), result


def require_sessions(train: Dataset, data: Dataset) -> None:
    missing = sorted(set(data.session.tolist()) - set(train.session.tolist()))
    if missing:
        raise InputError(
            f"session {missing[0]} has no identification rows: its frames cannot be found; expected at least "
            "4 different poses",
            file=data.select(data.session == missing[0]).first_file)


def require_enough(layout: Layout, data: Dataset, orientation: bool) -> None:
    angles = data.joints.get("theta", data.joints.get("q"))
    keys = np.concatenate([data.session[:, None], np.round(np.nan_to_num(angles), 9)], axis=1)
    distinct = len(np.unique(keys, axis=0))
    numbers = distinct * (6 if orientation else 3)
    if numbers <= layout.size:
        raise InputError(
            f"{distinct} different identification poses give {numbers} numbers for {layout.size} parameters: "
            f"expected at least {layout.size // (6 if orientation else 3) + 1} different poses",
            file=data.first_file)


def calibrated_robot(robot: Robot, data: Dataset, layout: Layout, fit: Fit, kind: str = POSES.name) -> Robot:
    """The robot with the estimates in its tables, found effects beside them, and the intervals on record."""
    sessions = [effect for effect in layout.effects if effect.frames_of is not None]
    base, tool = robot.base, robot.tool
    if sessions:
        base, tool = sessions[0].place(sessions[0].frames_of, Placement(), Placement())
    layout = _after_fit(robot, data, layout, fit)
    result = with_estimates(robot.with_controller_frames, layout, fit.interval())
    # the only kind whose rows the covariance is certified by
    certified = kind_of(kind).target_at_rest and bool(sessions)
    return replace(result, base=base, tool=tool, effects=all_effects(robot, data, layout, kind),
                   covariance=_covariance(robot, data, layout, fit) if certified else None)


def _covariance(robot: Robot, data: Dataset, layout: Layout, fit: Fit) -> ParameterCovariance | None:
    """Of what the file describes, the frames of its first set-up with it: not of further frames, which are
    found anew, nor of curves, which carry their own."""
    if data.position is None:
        return None
    first = next(effect for effect in layout.effects if effect.frames_of is not None)
    apart = lambda e: e.frames_of is not None or e.of_record or isinstance(e, SessionPayload)
    told = [effect is first or not apart(effect) for effect in layout.effects]
    mine = np.concatenate([np.full(int(free.sum()), mine) for mine, free in zip(told, layout.free)])
    mine &= np.isinf(layout.prior)
    left = predict_poses(robot, layout, data, tangents=False).residual()[:, :3]
    left = left[np.isfinite(left).all(axis=1)]  # touches beside tracked poses have no position
    freedom = max(left.size - layout.size, 1)
    noise = float(np.sqrt(np.sum(left**2) / freedom))
    names = tuple(name for name, keep in zip(layout.names, mine) if keep)
    return ParameterCovariance.of(names, fit.covariance[np.ix_(mine, mine)], noise)


def _after_fit(robot: Robot, data: Dataset, layout: Layout, fit: Fit) -> Layout:
    """The layout whose fitted effects know what the fit has left open."""
    phi, effects = motor_angles(robot, data) / robot.ratios, []
    for effect, free, where in zip(layout.effects, layout.free, layout.slices):
        if free.any() and not effect.declared:
            covariance = np.zeros((free.size, free.size))
            covariance[np.ix_(free, free)] = fit.covariance[where, where]
            effect = effect.after_fit(phi, covariance)
        effects.append(effect)
    return Layout(tuple(effects), layout.free)


def _beyond_bounds(fit: PoseFit, data: Dataset):
    """Parameters at a bound that the data would have beyond it; a spring of a stiff axis just lies at 0."""
    if not fit.fit.at_bound.any():
        return
    prediction = predict_poses(fit.robot, fit.layout, data)
    columns = prediction.jacobian[:, :3].reshape(-1, fit.layout.size) / fit.sigma_position
    left = prediction.residual()
    left[wild_rows(np.linalg.norm(left, axis=1))] = 0.0
    residual = left.ravel() / fit.sigma_position
    free = columns[:, ~fit.fit.at_bound]
    for k in np.flatnonzero(fit.fit.at_bound):
        alone = columns[:, k] - free @ lstsq(free, columns[:, k], rcond=None)[0]
        if abs(alone @ residual) > _BEYOND * np.linalg.norm(alone):
            yield (f"{fit.layout.names[k]} lies at its bound: the data asks for a value that no drive or "
                   "structure can have")


def _parallel(robot: Robot) -> bool:
    """Whether all turning axes are parallel, as those of a SCARA or a turntable."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, robot.axes))
    turned = _core.forward_kinematics(robot.core, q)[1].reshape(-1, 3, 3)
    from_first = np.array([log(rotation @ turned[0].T) for rotation in turned[1:]])
    spread = svd(from_first, compute_uv=False)
    return bool(spread[1] < _PARALLEL * max(spread[0], 1e-12))


def _warnings(fit: PoseFit, data: Dataset, found: list):
    if not fit.fit.converged:
        yield f"the fit did not converge ({fit.fit.reason}): check the data for gross errors"
    if all(effect.frames_of is not None or not free.any()
           for effect, free in zip(fit.layout.effects, fit.layout.free)):
        yield ("no parameter of the robot was identified: base and tool frames take up all that these axes "
               "do, so its file is as it was; `exactarm diagnose` judges its gears all the same")
    yield from _beyond_bounds(fit, data)
    yield from mounted_otherwise(fit)
    yield from springs_not_estimated(fit)
    if fit.fit.freedom < 2 * fit.layout.size:
        yield (
            f"only {fit.fit.freedom} degrees of freedom for {fit.layout.size} parameters: measure more poses")
    for session, frames in found:
        # where all axes are parallel no pose tells the two apart, and none needs to
        if frames.other_tool is not None and not _parallel(fit.robot):
            there = target_on_flange(Placement(position=frames.other_tool), fit.robot.controller)
            point = ", ".join(f"{1e3 * value:.0f}" for value in there.position)
            yield (f"session {session}: another minimum is as good, with the target at ({point}) mm on the "
                   "flange: measure poses that differ more in orientation")
        if not 0.9 < frames.scale < 1.1:
            yield (f"session {session}: measured points spread {frames.scale:.3g} times as far as the model "
                   "says")
