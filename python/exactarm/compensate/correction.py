"""A program in, the same program with corrected numbers out, and what moved by how much.

1. every target as joint angles of the controller's own chain, in the order of the motions (branch by its
configuration word,
   else nearest to the one before); 2. from which side each axis comes; 3. the command, by the law, with the
   load of its tool;
4. the refusals; 5. the new numbers; 6. the numbers that were written are read again, tables as a whole, and
what the arm does with them is compared with the targets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.compensate.approach import Sides
from exactarm.compensate.circles import odd_middles
from exactarm.compensate.collector import collector_at_rest
from exactarm.compensate.flange_poses import pose_error, stacked, tip_poses
from exactarm.compensate.law import LARGEST_TURN_RAD, NEAR_SINGULAR, NOT_REACHED, CompensationModel
from exactarm.compensate.program import HERE, Edit, Program
from exactarm.compensate.resolution import Resolved, flanges_of, joints_of, resolve, tips_of
from exactarm.compensate.series import series_bends
from exactarm.compensate.straightness import Bend, bends, unknown_tips
from exactarm.compensate.ways import listed
from exactarm.errors import InputError, line_name

SAME_SIDE = 1e-3  # of a passage between two gear tables that differ by some 1e-4 rad
SETTLED = 4  # passes in which a correction may change the direction from which an axis comes
GUESSED = ("{} ({}): nothing says on which branch of the arm it is; the one nearest to the middle of "
           "the joint limits is taken: --start J1,J2,... says it")
_Numbers = tuple[np.ndarray | None, np.ndarray | None]  # of joint targets, of poses
UNUSED = "not used by a motion of these files"


@dataclass(frozen=True)
class Correction:
    """One program, its new contents and, for its T targets: joint angles before and after (NaN where not
    corrected), change of the commanded pose (m, rad; of the tool's tip in its base, of the flange for joint
    targets), why not. positions, shifts: (T, 3) m, of the flange in the controller's base frame, and how its
    command moves.

    reached: (T,) m, distance of the real tip (flange) from the target with the numbers as they are written;
    NaN as above.
    """

    program: Program
    contents: list[bytes]
    q_before: np.ndarray
    q_after: np.ndarray
    moved: np.ndarray
    positions: np.ndarray
    shifts: np.ndarray
    why: tuple[str, ...]
    refused: tuple[InputError, ...]
    reached: np.ndarray
    warnings: tuple[str, ...]
    bends: tuple[Bend, ...] = ()


@collector_at_rest()
def correct(
    program: Program,
    model: CompensationModel,
    chosen: np.ndarray,
    start: np.ndarray | None,
    threads: int,
    reread: Callable[[list[bytes]], Program],
    tolerance: float | None = None,
) -> Correction:
    """chosen (T,) bool: the targets to correct; start (n,): joint angles before the first motion, where
    known.

    tolerance: m, how far a straight motion may leave its line; None: not asked.
    """
    resolved = resolve(program, model, start)
    used = np.zeros(len(program.targets), bool)
    used[program.visits] = True
    why = ["" if u else UNUSED for u in used.tolist()]
    rows = np.flatnonzero(used & chosen & ~np.isnan(resolved.q).any(axis=1))
    q_after = np.full_like(resolved.q, np.nan)
    ways = Sides(program, model, start)
    sides, warnings = ways.of(resolved.q)
    timed = any(motion.time is not None for motion in program.motions)
    found, left_over, amplification = _commands(program, model, resolved, rows, sides, threads)
    for attempt in range(1, SETTLED + 1):
        again, warnings = ways.of(_filled(resolved.q, rows, found))
        other = np.flatnonzero(~np.all(np.abs(again[rows] - sides[rows]) < SAME_SIDE, axis=1))
        if attempt == SETTLED or not other.size:
            break
        # an axis that hardly moves may come from one side before its correction and from the other behind it
        turned = rows[other]
        sides[turned] = again[turned] if timed or attempt < SETTLED - 1 else np.where(
            again[turned] == sides[turned], sides[turned], 0.0)
        found[other], left_over[other], amplification[other] = _commands(
            program, model, resolved, turned, sides, threads)
    refusals = dict(resolved.refusals)
    refusals |= _refusals(model, resolved.q, rows, found, left_over, amplification)
    rows_good = np.array([r not in refusals for r in rows], bool)
    q_after[rows[rows_good]] = found[rows_good]
    edits, numbers, moved = _edits(program, model, resolved, q_after)
    found_bends = []
    if tolerance is not None:
        found_bends = bends(program, model, resolved.poses, q_after, tolerance)
        found_bends += series_bends(program, model, resolved.q, q_after, tolerance)
    guessed = [program.targets[i] for i in resolved.guessed]
    warnings += [GUESSED.format(target.name, line_name(program.files[0].path, target.line))
                 for target in guessed]
    warnings += odd_middles(program, resolved.q, resolved.poses)
    warnings += _told(program, found_bends, tolerance, q_after)
    if not program.targets:
        warnings.append(f"{program.files[0].path.name}: no target was found")
    contents = program.rewritten(edits)
    if program.finish is not None:
        contents = program.finish(contents, q_after, [])
    if program.finish is None:  # all but the numbers is as it was read
        written = program
    else:
        written, numbers = reread(contents), (None, None)
    inserted = [bend.edit for bend in found_bends if bend.edit is not None]
    if inserted and program.finish is not None:
        contents = program.finish(program.rewritten(edits), q_after, inserted)
    elif inserted:
        counted = inserted if program.numbered is None else program.numbered(inserted)
        contents = program.rewritten(edits + counted)
    for i in np.flatnonzero(~chosen).tolist():
        why[i] = "not corrected: not among the calculated points"
    refused = []
    for i in sorted(refusals):
        if chosen[i] and used[i]:
            target, why[i] = program.targets[i], refusals[i]
            path = program.files[target.file].path
            name = "" if target.name == line_name(path, target.line) else f"{target.name}: "
            refused.append(InputError(name + refusals[i], file=path, line=target.line))
    reached = _reached(written, numbers, program, model, resolved, sides, q_after, threads)
    shifts = model.controller.poses(np.nan_to_num(q_after)).position - resolved.poses.position
    shifts[np.isnan(q_after).any(axis=1)] = np.nan
    return Correction(program, contents, resolved.q, q_after, moved, resolved.poses.position, shifts,
                      tuple(why), tuple(refused), reached, tuple(warnings), tuple(found_bends))


def _told(program: Program, found: list[Bend], tolerance: float | None, q_after: np.ndarray) -> list[str]:
    """Motions that no points in between keep on their line or path, and why."""
    if tolerance is None:
        return []
    unknown = [f"{program.targets[motion.target].name} ({line_name(program.files[0].path, motion.line)})"
               for motion in unknown_tips(program, q_after)]
    followed = any(motion.time is not None and not program.targets[motion.target].is_pose
                   for motion in program.motions if motion.target is not None)
    if not (found or unknown or followed):
        return ["no straight motion between corrected targets, and no time series of joint angles: there is "
                "no line or path whose tolerance could be looked at"]
    left = [bend for bend in found if bend.after > tolerance]
    return [
        f"motions that leave their line or path by more than the tolerance{why}: {_named(program, those)}"
        for why, those in (
            ("", [bend for bend in left if bend.open]),
            (f", where no points in between can be put ({program.dialect})",
             [bend for bend in left if not bend.open]),
        ) if those
    ] + ([f"straight motions to joint angles with a tool that is not known (--tool): their lines are not "
          f"looked at: {listed(unknown)}"] if unknown else [])


def _named(program: Program, found: list[Bend]) -> str:
    return listed([f"{program.targets[bend.target].name} ({line_name(program.files[0].path, bend.line)}, "
                   f"{1e3 * bend.after:.3f} mm)"
                    for bend in found])


def _filled(q: np.ndarray, rows: np.ndarray, found: np.ndarray) -> np.ndarray:
    filled = q.copy()
    filled[rows] = found
    return filled


# -- commands ----------------------------------------------------------------------------------------
def _commands(program, model, resolved, rows, sides, threads):
    """Commands of the rows, those with one load together."""
    found, left_over, amplification = resolved.q[rows].copy(), np.zeros(len(rows)), np.zeros(len(rows))
    for load, members in _by_load(program, rows).items():
        loaded = model if load is None else model.with_load(load[0], np.array(load[1]))
        these = rows[members]
        commands = loaded.commands(resolved.poses.rows(these), resolved.q[these], sides[these], threads)
        found[members], left_over[members], amplification[members] = (
            commands.q,
            commands.left_over,
            commands.amplification,
        )
    return found, left_over, amplification


def _by_load(program: Program, rows: Sequence[int]) -> dict:
    loads = [program.targets[row].load for row in rows]
    if loads and all(load is loads[0] for load in loads):  # most programs
        return {loads[0]: np.arange(len(loads))}
    groups: dict = {}
    for k, load in enumerate(loads):
        groups.setdefault(load, []).append(k)
    return groups


def _refusals(model, q, rows, found, left_over, amplification) -> dict[int, str]:
    low, high = model.controller.limits
    turns, outside = np.abs(found - q[rows]), (found < low) | (found > high)
    suspect = ~(amplification < NEAR_SINGULAR) | outside.any(axis=1) | (left_over > NOT_REACHED)
    suspect |= turns.max(axis=1, initial=0.0) > LARGEST_TURN_RAD
    refusals = {}
    for k in np.flatnonzero(suspect):
        row, turn, beyond = rows[k], turns[k], np.flatnonzero(outside[k])
        if not amplification[k] < NEAR_SINGULAR:
            refusals[row] = (
                "close to a singular pose of the arm: an error of 1 mrad turns an axis by more than 0.1 rad"
            )
        elif beyond.size:
            i = int(beyond[0])
            limit = low[i] if found[k, i] < low[i] else high[i]
            refusals[row] = (
                f"axis {i + 1} would leave its limit of {np.degrees(limit):.2f} deg "
                f"(command {np.degrees(found[k, i]):.3f} deg)"
            )
        elif turn.max() > LARGEST_TURN_RAD:
            refusals[row] = (
                f"another branch: axis {int(turn.argmax()) + 1} would turn by {np.degrees(turn.max()):.1f} "
                "deg"
            )
        elif left_over[k] > NOT_REACHED:
            refusals[row] = f"no command reaches it: {1e3 * left_over[k]:.3g} mm or mrad are left over"
    return refusals


def _edits(
    program: Program, model: CompensationModel, resolved: Resolved, q_after: np.ndarray
) -> tuple[list[Edit], _Numbers, np.ndarray]:
    """The edits of the corrected targets, the numbers that they write, and (T, 6) how the commanded poses
    move."""
    moved = np.full((len(q_after), 6), np.nan)
    rows = np.flatnonzero(~np.isnan(q_after).any(axis=1))
    targets = [program.targets[i] for i in rows.tolist()]
    is_pose = np.array([target.is_pose for target in targets], bool)
    joints, posed = np.flatnonzero(~is_pose), np.flatnonzero(is_pose)
    poses = model.controller.poses(q_after[rows])
    if joints.size:
        moved[rows[joints]] = pose_error(poses.rows(joints), resolved.poses.rows(rows[joints]))
    tips = None
    if posed.size:
        own = [targets[k] for k in posed.tolist()]
        tips = tip_poses(poses.rows(posed), [t.base for t in own], [t.tool for t in own])
        moved[rows[posed]] = pose_error(tips, resolved.tips.rows(rows[posed]))
    return *program.notation.edits(program.files, targets, q_after[rows], tips), moved


def _reached(written, numbers, program, model, resolved, sides, q_after, threads) -> np.ndarray:
    """How far from its targets the arm goes with the numbers of the new file, those of `written` where they
    are not given."""
    distance = np.full(len(q_after), np.nan)
    rows = np.flatnonzero(~np.isnan(q_after).any(axis=1))
    if not rows.size:
        return distance
    q = q_after[rows].copy()
    is_pose = np.array([written.targets[row].is_pose for row in rows.tolist()], bool)
    joints, posed = np.flatnonzero(~is_pose), np.flatnonzero(is_pose)
    own_joints, own_poses = numbers
    if joints.size:
        q[joints] = (joints_of(written, rows[joints]) if own_joints is None
                     else written.notation.joints(own_joints))
    if posed.size:
        there = rows[posed]
        tips = tips_of(written, there) if own_poses is None else written.notation.poses(own_poses)
        q[posed] = model.controller.joints(flanges_of(written, there, tips), q[posed])
    tools = [target.tool if target.is_pose else HERE for target in map(program.targets.__getitem__, rows)]
    arm = stacked(tools).position
    for load, members in _by_load(program, rows).items():
        loaded = model if load is None else model.with_load(load[0], np.array(load[1]))
        there = loaded.reached(q[members], sides[rows[members]], threads)
        wanted = resolved.poses.rows(rows[members])
        turned = (there.rotation - wanted.rotation) @ arm[members][:, :, None]
        missed = there.position - wanted.position + turned[:, :, 0]
        distance[rows[members]] = np.linalg.norm(missed, axis=1)
    return distance
