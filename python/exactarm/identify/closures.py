"""Calibration and judgement from closures: contacts, tool and geometry together, the contacts integrated out
of the intervals.

1. tool and contacts by the robot as declared, 2. which parameters the closures can tell, 3. all of them with
known lengths and the drawing as data (exactarm.identify.closure_fit), 4. the error of rows that were not
fitted. One tool serves all sessions unless the rows say otherwise by more than it costs (Schwarz 1978).
Without a known length nothing tells a robot and its surroundings from a model of both at another scale: one
length is held.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import Fixture
from exactarm.effects.base import Station
from exactarm.errors import InputError
from exactarm.identify.calibrate import GEOMETRY, JUDGING, Calibration, CalibrationOptions, calibrated_robot
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.identify.closure_scale import gravity_alone, longest_length, scale_is_known, with_held_in_doubt
from exactarm.identify.compliance import compliance_layout
from exactarm.identify.contact_starts import counted_anew, sought_anew, with_contacts
from exactarm.identify.declared import carried_layout, frames_layout, geometry_layout, require_geometry
from exactarm.identify.drawing import Drawn
from exactarm.identify.identifiability import Dropped, Identifiability, select_identifiable, still_axes
from exactarm.identify.judged_rows import judged_rows, unjudged_lines
from exactarm.identify.length_doubt import length_doubts, require_units
from exactarm.identify.loads import kept_masses, with_loads
from exactarm.identify.match import WORST_SHARE
from exactarm.identify.partner_misfit import partner_misfit
from exactarm.identify.partner_prior import known_of_partner, partner_warnings, with_open_partner
from exactarm.identify.size_doubt import scale_doubt, size_doubts
from exactarm.identify.statistics import summarise
from exactarm.measurement.closures import (
    PAIR,
    TRACKER,
    ClosurePrediction,
    device_of,
    gross_rows,
    predict_closures,
    touches,
)
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import CAMERA, SENSORS
from exactarm.measurement.known_lengths import distance_errors, known_lengths
from exactarm.measurement.partner import NAME as PARTNER
from exactarm.measurement.target import Target
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

_STARTS = 12
# times the limit: a partner is refused before a whole fit, which may end a little nearer (racer-7-1.4 for an
# ur10: 16 times, tx40: 10 times)
_HOPELESS = 2.0
_TOOL_REACH_M = 0.3  # spread of the random starts of the tool point
SLIPPED = 0.35  # square root of a weight: beyond some 7 standard deviations
# times Schwarz' price: what is left of an arm's own error buys up to 1.6 times with one and the same tool
_MOUNTED_ANEW = 3.0
_MOST_GROWN = 2.0  # times the drawing's reach: diameters for radii make no arm so large
_SHOWS_LENGTHS = 3  # rows under a tracker: two are its frame's, more are distances that it has measured
_AS_ONE = ("d", "q_offset")  # of axis 1: they move the arm along and about it
TOOL_RUNS_AWAY = (
    "the touches do not tell where the tool is: the further from the arm, the better they fit; declare the "
    "tool's place or the spheres' radii ([[radii]] of the fixture file), or touch from all sides")
AS_ONE = "the robot and everything that it touches may move as one: the contacts absorb it"
SCALE = (
    "all lengths times a common factor fit as well: give one distance, radius or bar length of the fixture")
GRAVITY_ALONE = (
    "gravity's direction alone shows no length, nothing of the first axis but its tilt, and no turn about "
    "the vertical: track the target, or touch a fixture, in some poses as well")


@dataclass(frozen=True)
class DeclaredClosures:
    """The declared model of closures: its layout (frames, contacts and tool first), what is known beside the
    rows, what was dropped, the fit of contacts and tool alone, and the fit of everything; told: what it would
    be if what is held were exact."""

    layout: Layout
    pulls: Pulls
    identifiability: Identifiability
    nominal: ClosureFit
    fit: ClosureFit
    told: Fit


def calibrate_closures(robot: Robot, data: Dataset, options: CalibrationOptions = CalibrationOptions(),
                       progress: Callable[[str], None] = lambda text: None) -> Calibration:
    """Calibrates on the identification rows and judges on the others. Raises InputError where the data cannot
    support it."""
    drawn, robot = robot, with_loads(robot, data)
    identification = data.split(options.seed)
    train = touches(data.select(identification))
    rows = touches(replace(data, identification=identification))
    progress(GEOMETRY)
    declared = declare_closures(robot, train, options.compliance, options.seed, options.threads,
                                sessions_of(rows))
    progress(JUDGING)
    fit = declared.fit
    before, after = (
        closure_errors(robot, each.layout, rows, options.threads) for each in (declared.nominal, fit))
    parts = {"identification": rows.identification, "validation": ~rows.identification}
    place = judged_rows(rows)
    beside = lambda each, errors: {name: other_errors(robot, each.layout, rows, errors, mask, options.threads)
                                   for name, mask in parts.items()}
    new = kept_masses(updated_robot(robot, train, fit), drawn)
    lengths = length_doubts(fit, train, declared.pulls, options.threads)
    return Calibration(robot=new,
                       fit=fit, data=rows, identification=rows.identification, error_before=before.error(),
                       error_after=after.error(), residual_after=after.seen,
                       before={name: summarise(before.error()[mask & place]) for name, mask in parts.items()},
                       after={name: summarise(after.error()[mask & place]) for name, mask in parts.items()},
                       identifiability=declared.identifiability,
                       orientation=fit.prediction.used.shape[1] == 6,
                       beside_before=beside(declared.nominal, before),
                       beside_after=beside(fit, after),
                       length_doubted=bool(lengths),
                       warnings=(*_warnings(robot, declared, train), *lengths,
                                 *gross_corner_warning(data), *unjudged_lines(rows),
                                 *partner_warnings(fit, train, declared.pulls, options.threads)))


def declare_closures(robot: Robot, data: Dataset, compliance: tuple[int, ...] | None = (), seed: int = 0,
                     threads: int = 1, sessions: tuple[int, ...] = (),
                     carried: Layout | None = None) -> DeclaredClosures:
    """The declared model fitted to all rows of `data` (one device a row); `sessions` share the tool too."""
    require_geometry(robot)
    carried = carried_effects(robot, data) if carried is None else carried
    nominal = nominal_closures(robot, data, carried, seed, threads, sessions or sessions_of(data))
    require_units(nominal, data)
    geometry = geometry_layout(robot)
    start = counted_anew(nominal.layout.at(nominal.layout.values))
    setup = with_open_partner(start.only(range(len(start.effects) - len(carried.effects))))

    def fitted(setup: Layout) -> tuple[Layout, Layout, Pulls, Identifiability, ClosureFit]:
        beside = geometry.joined(compliance_layout(robot, data, compliance)).joined(carried)
        layout, found = identifiable_closures(robot, setup, beside, data, threads)
        pulls = Pulls.of(geometry, data.fixture)
        fit = fit_closures(robot, layout, data, pulls, threads=threads)
        worth = fit.told(data)
        if worth.min() < 1.0:
            fit = fit_closures(robot, fit.layout, data, pulls, worth=worth, threads=threads)
        drawn = Drawn.around(geometry, fit.layout, fit.fit, pulls.drawing)
        pulls = replace(pulls, drawing=drawn.to)
        fit = fit_closures(robot, fit.layout, data, pulls, worth=worth, threads=threads)
        return setup.joined(beside), layout, pulls, found, fit

    one = fitted(setup)
    apart = _with_tools_apart(setup, data)
    if apart is not None:
        other = fitted(apart)
        price = 0.5 * (other[1].size - one[1].size) * np.log(other[-1].numbers)
        if other[-1].log_likelihood - one[-1].log_likelihood > _MOUNTED_ANEW * price:
            one = other
    whole, layout, pulls, found, fit = one
    require_size(robot, updated_robot(robot, data, fit), data)
    return DeclaredClosures(layout, pulls, found, nominal,
                            with_held_in_doubt(fit, whole, data, pulls, threads), fit.fit)


def require_size(declared: Robot, found: Robot, data: Dataset) -> None:
    """Raises InputError where the arm shrinks to nothing, which touches any contact, or grows beyond all
    measure: the search began far from where the touches belong."""
    share = found.reach / max(declared.reach, np.finfo(float).tiny)
    if not 1.0 / _MOST_GROWN < share < _MOST_GROWN:
        raise InputError(
            f"the touches meet only if the arm is {share:.2g} times as large as {declared.name}: is it "
            "another robot, has an axis another zero, or are contacts numbered otherwise?",
            file=data.first_file)


def nominal_closures(robot: Robot, data: Dataset, carried: Layout, seed: int = 0, threads: int = 1,
                     sessions: tuple[int, ...] = ()) -> ClosureFit:
    """Contacts, tool and frames alone, by the robot as declared; of known lengths the radii alone are used.
    Raises InputError where they do not fit."""
    if not judged_rows(data).any():
        raise InputError(f"no row can be judged: {unjudged_lines(data)[0]}", file=data.first_file)
    device = device_of(data)
    tracked = device == TRACKER
    frames = Layout.of(())
    if tracked.any():
        frames, _ = frames_layout(robot, data.select(tracked), orientation=data.rotation is not None,
                                  seed=seed)
    framed = {effect.session for effect in frames.effects}
    shared = tuple(s for s in (sessions or sessions_of(data)) if s not in framed)
    touched = np.isin(data.session, shared) & ~np.isin(device, [PAIR, *SENSORS, *CAMERA])
    starts = [robot.tool.position]
    if touched.any():
        starts += list(np.random.default_rng(seed).normal(0.0, _TOOL_REACH_M, (_STARTS, 3)))
    limit = WORST_SHARE * robot.reach
    if np.all(device == PARTNER):
        missed = partner_misfit(robot, carried, data, starts, limit)
        if missed > _HOPELESS * limit:
            raise _another_robot(robot, data, missed)
    known = Pulls(Fixture(radii=data.fixture.radii))
    best = None
    for tool in starts:
        target = (Layout.of((Target(None, tuple(float(v) for v in tool), shared, shared=len(shared) > 1),),
                            estimate=bool(touched.any())) if shared else Layout.of(()))
        layout = with_contacts(robot, frames.joined(target).joined(carried), data, threads)
        fit = fit_closures(robot, layout, data, known, threads=threads)
        if _ran_away(fit.layout, robot):
            continue
        error = float(np.median(fit.prediction.error()))
        if best is None or error < best[0]:
            best = (error, fit)
        if best[0] <= limit:
            break
    if best is None:
        raise InputError(TOOL_RUNS_AWAY, file=data.first_file)
    if best[0] > limit:
        raise _another_robot(robot, data, best[0])
    return sought_anew(robot, best[1], data, known, threads)


def _ran_away(layout: Layout, robot: Robot) -> bool:
    """Whether the tool went further than any tool is: it and the centre of a sphere far off together."""
    return any(np.linalg.norm(effect.values) > robot.reach for effect in layout.effects
               if isinstance(effect, Target))


def _another_robot(robot: Robot, data: Dataset, missed: float) -> InputError:
    of_partner = ""
    if np.any(device_of(data) == PARTNER):
        of_partner = ", or is the robot file of the partner that of another arm"
    return InputError(
        f"robot and data do not match: with the best tool and contacts {robot.name} misses the contacts "
        f"by {missed:.3g} m (median), expected less than {WORST_SHARE * robot.reach:.2g} m: is it "
        f"another robot, are axes exchanged or are angles in another unit{of_partner}?",
        file=data.first_file)


def closure_errors(robot: Robot, layout: Layout, data: Dataset, threads: int = 1) -> ClosurePrediction:
    """Prediction of any rows; contacts that the layout lacks are fitted to them, nothing else is."""
    complete = with_contacts(robot, layout.held, data, threads)
    if complete.size:
        complete = fit_closures(robot, complete, data, Pulls(), threads=threads).layout
    return predict_closures(robot, complete, data, tangents=False, threads=threads)


def other_errors(robot: Robot, layout: Layout, data: Dataset, prediction: ClosurePrediction,
                 rows: np.ndarray | None = None, threads: int = 1) -> dict[str, float]:
    """Errors of some rows (N,) bool that are not distances from contacts, by their names with units; those
    that nothing measures are left out."""
    some = data if rows is None else data.select(rows)
    distances = list(set_distance_errors(robot, layout, some, threads).values())
    found = {"distance_error_m": float(np.mean(distances)) if distances else None,
             "tilt_error_rad": tilt_error(prediction, rows),
             "reprojection_px": prediction.reprojection(rows)}
    return {name: error for name, error in found.items() if error is not None}


def tilt_error(prediction: ClosurePrediction, rows: np.ndarray | None = None) -> float | None:
    """Mean angle, rad, by which gravity's direction is missed on some rows; None where none measures it."""
    at = np.isin(device_of(prediction.view.data), list(SENSORS))
    at = at if rows is None else at & rows
    return float(prediction.error()[at].mean()) if at.any() else None


def set_distance_errors(robot: Robot, layout: Layout, data: Dataset, threads: int = 1) -> dict[str, float]:
    """Name of a known distance -> |error| in m, with the contacts fitted anew to these rows alone."""
    if not data.fixture.distances or not len(data):
        return {}
    bare = layout.only(k for k, e in enumerate(layout.effects) if not isinstance(e, Contact)).held
    complete = with_contacts(robot, bare, data, threads)
    if not complete.size:
        return {}
    return distance_errors(fit_closures(robot, complete, data, Pulls(), threads=threads).layout, data.fixture)


def identifiable_closures(robot: Robot, setup: Layout, beside: Layout, data: Dataset,
                          threads: int = 1) -> tuple[Layout, Identifiability]:
    """`setup` (frames, contacts, tool) and what of `beside` these closures can tell; the scale is held where
    nothing gives it."""
    whole = tuple(name for name in beside.names if name.axis == 1 and name.symbol in _AS_ONE)
    layout = setup.joined(beside.without(set(whole)))
    trusted = layout.without(known_of_partner(setup))
    prediction = predict_closures(robot, trusted, data, threads=threads)
    rows = prediction.jacobian[prediction.used]
    known = known_lengths(trusted, data.fixture)
    rows = np.concatenate([rows, np.array([k.row for k in known]).reshape(len(known), trusted.size)])
    frames = setup.size + trusted.size - layout.size
    found = select_identifiable(rows, trusted.names, keep_first=frames, poses=len(data),
                                plausible=[p.plausible for p in trusted.parameters],
                                robot=robot, still=still_axes(prediction.view.q))
    why = GRAVITY_ALONE if gravity_alone(data) else AS_ONE
    found = replace(found, dropped=(*(Dropped(name, f"{name}: {why}", (), True) for name in whole),
                                    *found.dropped))
    held = set(found.dropped_names)
    if not scale_is_known(layout, data):
        longest = longest_length(trusted, held, frames)
        others = tuple(n for n in trusted.names if n.unit == "m" and n not in held and n != longest)
        found = replace(
            found, kept=found.kept & np.array([name != longest for name in found.names]),
            dropped=(*found.dropped, Dropped(longest, f"{longest} holds the scale: {SCALE}", others, True)))
        held.add(longest)
    return layout.without(held), found


def carried_effects(robot: Robot, data: Dataset) -> Layout:
    """The robot file's own effects that act before the device, none of them free."""
    layout = carried_layout(robot, data)
    return layout.only(k for k, effect in enumerate(layout.effects) if effect.station != Station.DEVICE)


def updated_robot(robot: Robot, data: Dataset, fit: ClosureFit) -> Robot:
    """The robot with the estimates in its tables and the first session's tool; the base stays as declared."""
    result = calibrated_robot(robot, data, fit.layout, fit.fit)
    tool = robot.tool
    for effect in fit.layout.effects:
        if isinstance(effect, Target):
            tool = effect.place(effect.sessions[0], robot.base, robot.tool)[1]
            break
    return replace(result, base=robot.base, tool=tool)


def sessions_of(data: Dataset) -> tuple[int, ...]:
    return tuple(int(session) for session in np.unique(data.session))


def _with_tools_apart(setup: Layout, data: Dataset) -> Layout | None:
    """The same with a tool for each session of `data`, others with the first; None if there is one only."""
    at = next((i for i, e in enumerate(setup.effects) if isinstance(e, Target) and setup.free[i].any()), None)
    if at is None:
        return None
    tool = setup.effects[at]
    here = [session for session in tool.sessions if session in sessions_of(data)]
    if len(here) < 2:
        return None
    rest = tuple(session for session in tool.sessions if session not in here)
    groups = [(here[0], *rest), *((session,) for session in here[1:])]
    each = Layout.of(tuple(replace(tool, sessions=group, shared=False) for group in groups))
    behind = setup.only(range(at + 1, len(setup.effects)))
    return setup.only(range(at)).joined(each).joined(behind)


def gross_corner_warning(data: Dataset) -> tuple[str, ...]:
    """One line where corners of pictures are left out."""
    count = int(gross_rows(data).sum())
    if not count:
        return ()
    return (f"{count} of {int(np.sum(data.contacts['camera'] >= 0))} corners lie far beside the others of "
            "their picture and are left out: wrongly found, or wrongly numbered",)


def slipped_rows(weight: np.ndarray) -> tuple[str, ...]:
    """One line on rows that the fit all but leaves out; weight (N,): square roots of the robust weights."""
    slipped = int(np.sum(weight < SLIPPED))
    if not slipped:
        return ()
    return (f"{slipped} of {len(weight)} rows lie far beside their contact and count for little: slipped, or "
            "wrongly numbered",)


def _warnings(robot: Robot, declared: DeclaredClosures, data: Dataset):
    fit = declared.fit
    if not fit.fit.converged:
        yield (
            f"the fit did not converge ({fit.fit.reason}): check the data for gross errors, or for contacts "
            "with the wrong number")
    if scale_is_known(fit.layout, data):
        yield from size_doubts(fit.layout, fit.fit, declared.pulls.drawing)
        if np.sum(device_of(data) == TRACKER) < _SHOWS_LENGTHS:
            yield from scale_doubt(fit.layout, declared.told, declared.pulls.drawing, robot.reach)
    else:
        yield SCALE
    if gravity_alone(data):
        yield GRAVITY_ALONE
    yield from slipped_rows(fit.weight)
    tools = sum(isinstance(effect, Target) for effect in fit.layout.effects)
    if tools > 1:
        yield f"the {tools} sessions have a tool each: one for all of them fits far worse"
    size = fit.layout.size - len(known_of_partner(fit.layout))
    if fit.fit.freedom < 2 * size:
        yield f"only {fit.fit.freedom} degrees of freedom for {size} parameters: touch more poses"

