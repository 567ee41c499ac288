"""Measurements of the same few poses before and on later days, as numbers for the sequential test
(change.py).

The residual of every row against the robot file, with base and tool frame as BEFORE shows them, averaged over
the visits of a pose on a day, in the robot's base frame. Its level in BEFORE is what the model errs there and
counts for nothing; its scatter there is the noise. Rows of another `session` than BEFORE's are seen from
another place: the base is found anew that day, by the points of the check as one rigid body, displaced as the
cause in question says, and the numbers that this takes are left out. Positions alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from exactarm.data.dataset import Dataset
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, frames_layout, require_geometry
from exactarm.identify.frames import procrustes
from exactarm.identify.match import WORST_SHARE, require_match
from exactarm.identify.planned import controller_angles
from exactarm.identify.pose_fit import PoseFit, fit_poses
from exactarm.numerics.factors import svd
from exactarm.robot.robot import Robot
from exactarm.verify.candidates import base_of, candidates, model_error, rigid
from exactarm.verify.change import RANK, Days, Evidence, Hypothesis
from exactarm.verify.copied_rows import CopiedRows, copied_rows
from exactarm.verify.day_mistakes import day_mistake

SAME_POSE_RAD = (
    5e-3  # a pose of the check is taught once; the residual is taken at the angles that were reported
)
LEAST_FREEDOM = (
    6  # numbers beyond the level of each pose that must tell the noise: its size then is known to a third
)
TOGETHER = 0.01  # p-value below which poses that move together are told
DAY_S = 86400.0


@dataclass(frozen=True)
class Daily:
    """before, days: as `detect` takes them; labels of the days; hypotheses; poses (K, n) controller's angles.

    occasions: of a pose in BEFORE, the fewest; noise: where it comes from; moved (T, K, 3): residual of each
    day less its level in BEFORE, m, NaN where a pose was not measured or BEFORE does not know it; copied:
    rows that stand in an earlier day too; displaced: as `explain` takes it.
    """

    before: Evidence
    days: Days
    labels: tuple[str, ...]
    hypotheses: tuple[Hypothesis, ...]
    poses: np.ndarray
    occasions: int
    noise: str
    warnings: tuple[str, ...]
    moved: np.ndarray
    copied: tuple[CopiedRows, ...] = ()
    displaced: Callable[[np.ndarray], Days] | None = None


def daily(
    robot: Robot, before: Dataset, new: Sequence[tuple[str, Dataset]], seed: int = DEFAULT_SEED
) -> Daily:
    """new: label and rows of each file of later days, in their order."""
    require_geometry(robot)
    if len(np.unique(before.session)) > 1:
        raise InputError(
            f"BEFORE holds {len(np.unique(before.session))} set-ups; expected one (column session), the one "
            f"of the check",
            file=before.first_file,
        )
    fit = _frames_of(robot, before, seed)
    labels, measured = _days(new)
    poses = _poses(robot, measured)
    cells = [_cells(robot, data, poses) for data in measured]
    known = _cells(robot, before, poses, strict=False)
    visits = min(int(np.unique(cell, return_counts=True)[1].min()) for cell in cells)
    level, evidence, occasions, noise, warnings = _reference(robot, fit, before, known, len(poses), visits)
    rows = []
    for i, k in _first_rows(cells):
        rows.append(replace(measured[i].select(k), session=np.full(len(k), before.session[0])))
    error = model_error(fit, before, len(_poses(robot, [before])))
    hypotheses = candidates(robot, fit, rows, level, error)
    mistakes: list[str] = []
    seen = []
    most = WORST_SHARE * robot.reach
    for label, data, cell in zip(labels, measured, cells, strict=True):
        expected = data.position - fit.residual(replace(data, session=np.full(len(data), before.session[0])))
        mistakes.append(day_mistake(label, expected, data.position, most))
        seen.append(_day(fit, data, cell, level, visits, int(before.session[0])))
    displaced = lambda f: tuple((np.nan_to_num(y), shown) for y, shown in (day(f) for day in seen))
    still = np.zeros(3 * len(poses))
    moved = np.array([day(still)[0].reshape(-1, 3) for day in seen]) - level
    warnings = [*filter(None, mistakes), *warnings]
    if any(np.unique(cell).size < len(poses) for cell in cells):
        warnings.append("not every pose was measured on every day")
    anew = any(np.any(data.session != before.session[0]) for data in measured)
    if anew:
        warnings.append(
            "some days are another set-up (session) than BEFORE: where the base stands is found anew on "
            "each, so "
            "that a move of the base cannot be seen on them; the tool is taken as the same"
        )
    copied = tuple(copied_rows([("BEFORE", before), *zip(labels, measured, strict=True)]))
    return Daily(
        evidence, displaced(still), labels, hypotheses, poses, occasions, noise, tuple(warnings), moved,
        copied, displaced if anew else None,
    )


def _frames_of(robot: Robot, data: Dataset, seed: int) -> PoseFit:
    layout, found = frames_layout(robot, data, orientation=False, seed=seed)
    require_match(robot, data, found, carried_layout(robot, data), seed)
    return fit_poses(robot, layout.joined(carried_layout(robot, data)), data)


# -- days and poses ------------------------------------------------------------------------------------
def _days(new: Sequence[tuple[str, Dataset]]) -> tuple[tuple[str, ...], list[Dataset]]:
    """Each file is a day, unless a column `day`, or `time_s` over more than a day, says otherwise."""
    labels, measured = [], []
    for label, data in new:
        number = day_numbers(data)
        if number is None:
            labels.append(label)
            measured.append(data)
            continue
        for day in np.unique(number):
            labels.append(day_label(day) if len(new) == 1 else f"{label}, {day_label(day)}")
            measured.append(data.select(number == day))
    return tuple(labels), measured


def day_label(day: float) -> str:
    """The day by its number as a file has it, a date as 20260101 in all its digits."""
    return f"day {int(day) if day == np.floor(day) else float(day)}"


def day_numbers(data: Dataset) -> np.ndarray | None:
    """(N,) the day of each row by the column `day`, or by days of 24 h from the first row on; None: one
    occasion."""
    if "day" in data.covariates:
        return data.covariates["day"]
    if data.time is None or np.ptp(data.time) < DAY_S:
        return None
    return np.floor((data.time - data.time.min()) / DAY_S) + 1.0


def _poses(robot: Robot, measured: Sequence[Dataset]) -> np.ndarray:
    """(K, n) the different poses of all days, in the order in which they were first measured."""
    poses = np.empty((0, robot.axes))
    for data in measured:
        for q in controller_angles(robot, data):
            if not np.any(np.max(np.abs(poses - q), axis=1) < SAME_POSE_RAD):
                poses = np.vstack([poses, q])
    return poses


def _cells(robot: Robot, data: Dataset, poses: np.ndarray, strict: bool = True) -> np.ndarray:
    """(N,) which of the poses a row is at, -1: none of them."""
    q = controller_angles(robot, data)
    cell = np.full(len(data), -1)
    for k, pose in enumerate(poses):
        cell[np.max(np.abs(q - pose), axis=1) < SAME_POSE_RAD] = k
    return cell


def _first_rows(cells: Sequence[np.ndarray]) -> list[tuple[int, np.ndarray]]:
    """Day, and its rows at poses that no earlier day has, in the order of the poses."""
    known, found = 0, []
    for i, cell in enumerate(cells):
        new = [int(np.flatnonzero(cell == k)[0]) for k in range(known, int(cell.max()) + 1)]
        found += [(i, np.array(new))] if new else []
        known += len(new)
    return found


# -- BEFORE --------------------------------------------------------------------------------------------
def _reference(
    robot: Robot, fit: PoseFit, before: Dataset, cell: np.ndarray, count: int, visits: int
) -> tuple[np.ndarray, Evidence, int, str, list[str]]:
    """Level (K, 3) and evidence of BEFORE, the fewest occasions of a pose, the source of the noise,
    warnings."""
    residual = fit.residual(before) @ base_of(fit, int(before.session[0])).rotation
    occasions = _occasions(before, cell, visits)
    evidence, sums, seen = Evidence.none(3 * count), np.zeros((count, 3)), np.zeros(count, int)
    whole = []
    for number in range(occasions.max(initial=-1) + 1):
        y, here = np.zeros((count, 3)), np.zeros(count, bool)
        for k in np.unique(cell[occasions == number]):
            y[k] = residual[(occasions == number) & (cell == k)][:visits].mean(axis=0)
            here[k] = True
        evidence = evidence.with_day(y.ravel(), np.diag(np.repeat(here.astype(float), 3)))
        whole += [y] if here.all() else []
        sums += np.where(here[:, None], y, 0.0)
        seen += here
    level = np.where(seen[:, None] > 0, sums / np.maximum(seen, 1)[:, None], np.nan)
    freedom = evidence.numbers - 3 * int(np.count_nonzero(seen))
    warnings = []
    if freedom >= LEAST_FREEDOM:
        if not seen.all():
            warnings.append(
                f"{int(np.sum(seen == 0))} of {count} poses are not in BEFORE: on them only later days "
                f"compare"
            )
        if day_numbers(before) is None:
            warnings.append(
                "BEFORE tells of one day (no column `day`, no `time_s` over more than one): what changes "
                "from day to day "
                "without anything having moved, as warmth, is not in the noise"
            )
        warnings += _moving_together(np.array(whole))
        known = f"{freedom} numbers of repeated poses in BEFORE"
        return level, evidence, int(seen[seen > 0].min()), known, warnings
    return _by_the_model(fit, before, residual, evidence, sums, seen, warnings)


def _moving_together(occasions: np.ndarray) -> list[str]:
    """A warning where all poses (D, K, 3) move alike from occasion to occasion: the test takes them as
    independent."""
    if len(occasions) < 3 or occasions.shape[1] < 2:
        return []
    apart = occasions - occasions.mean(axis=0)
    shared = apart.mean(axis=1)
    own = apart - shared[:, None]
    freedom = 3 * (len(occasions) - 1)
    others = freedom * (occasions.shape[1] - 1)
    ratio = occasions.shape[1] * np.sum(shared**2) / freedom / max(np.sum(own**2) / others, 1e-300)
    if special.fdtrc(freedom, others, ratio) > TOGETHER:
        return []
    size = float(np.sqrt(np.sum(shared**2) / freedom))
    return [
        f"in BEFORE all poses move together from occasion to occasion, by {1e3 * size:.2g} mm a coordinate "
        f"(warmth, or the stand of "
        "the instrument): the test takes poses as independent, so that alarms may be more frequent than "
        "stated"
    ]


def _by_the_model(
    fit: PoseFit,
    before: Dataset,
    residual: np.ndarray,
    evidence: Evidence,
    sums: np.ndarray,
    seen: np.ndarray,
    warnings: list[str],
) -> tuple[np.ndarray, Evidence, int, str, list[str]]:
    """Without repeated poses what the model leaves in BEFORE stands for noise and level alike: larger, so
    safe."""
    freedom = fit.fit.freedom
    if freedom < LEAST_FREEDOM:
        raise InputError(
            f"BEFORE holds {len(before)} rows, too few to tell the noise; expected the same poses on two "
            f"occasions or more",
            file=before.first_file,
        )
    new = np.repeat((seen == 0).astype(float), 3)  # the model says zero there, as well as it says anything
    evidence = evidence.with_day(np.zeros(new.size), np.diag(new))
    evidence = evidence.with_scatter(float(np.sum(residual**2)), freedom)
    warnings.append(
        f"BEFORE does not hold the poses of the check twice ({np.count_nonzero(seen)} of {len(seen)} once, "
        f"no joint angle further than {SAME_POSE_RAD:g} rad): what the model leaves there stands for the "
        "noise, its own errors too, and smaller changes stay unseen; measure these poses on several days "
        "before"
    )
    level = np.where(seen[:, None] > 0, sums / np.maximum(seen, 1)[:, None], 0.0)
    return level, evidence, 1, f"what the model leaves in the {len(before)} rows of BEFORE", warnings


def _occasions(data: Dataset, cell: np.ndarray, visits: int) -> np.ndarray:
    """(N,) the occasion of each row at a pose of the check, from 0: its day, else every `visits` rows of the
    pose; -1: none."""
    occasion = np.full(len(data), -1)
    number = day_numbers(data)
    if number is not None:
        occasion[cell >= 0] = np.unique(number, return_inverse=True)[1].ravel()[cell >= 0]
        return occasion
    for k in np.unique(cell[cell >= 0]):
        rows = np.flatnonzero(cell == k)
        whole = rows[: max(rows.size // visits, 1) * visits]
        occasion[whole] = np.arange(whole.size) // visits
    return occasion


# -- one day -------------------------------------------------------------------------------------------
def _day(
    fit: PoseFit, data: Dataset, cell: np.ndarray, level: np.ndarray, visits: int, session: int
) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Displacement f (3 K,) -> y (3 K,), NaN where there is none, and what the day shows of it (3 K, 3 K).

    level (K, 3), session: BEFORE's.
    """
    count = len(level)
    residual = fit.residual(replace(data, session=np.full(len(data), session)))
    base = base_of(fit, session)
    shown = np.diag(np.repeat(np.isin(np.arange(count), cell).astype(float), 3))

    def by_pose(rows: np.ndarray) -> np.ndarray:
        found = np.full((count, 3), np.nan)
        for k in np.unique(cell):
            found[k] = rows[cell == k][:visits].mean(axis=0)
        return found

    def from_elsewhere(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A set-up of its own: where the base stands is no news."""
        moved = np.nan_to_num(level) + f.reshape(-1, 3)
        expected = points + moved[cell]
        place, apart = procrustes(expected, data.position)
        free = shown @ rigid(np.nan_to_num(by_pose(expected)))
        free /= np.maximum(np.linalg.norm(free, axis=0), 1e-300)
        u, values, _ = svd(free, full_matrices=False)
        u = u[:, values > RANK * values.max(initial=1e-300)]
        return (moved + by_pose(apart @ place.rotation)).ravel(), shown - u @ u.T

    if np.any(data.session != session):
        points = (data.position - residual - base.position) @ base.rotation
        return from_elsewhere
    y = by_pose(residual @ base.rotation).ravel()
    return lambda f: (y, shown)
