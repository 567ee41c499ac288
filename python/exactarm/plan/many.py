"""Many paths at once, on any `concurrent.futures.Executor`: threads, processes, a cluster's executor.

One failed path does not end the others: its place in the answer holds a PathFailure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace

from exactarm.errors import ComputationError, InputError
from exactarm.plan.optimal import Plan, PlanOptions, plan_path
from exactarm.plan.path_file import PlannedPath
from exactarm.robot.robot import Robot

# Called after each path with the number of paths that are done, and of all.
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class PathFailure:
    """A path without a plan, and why in one line."""

    path: PlannedPath
    reason: str


def plan_many(
    robot: Robot, paths: Iterable[PlannedPath], executor: Executor | None = None,
    options: PlanOptions = PlanOptions(), progress: Progress | None = None,
) -> list[Plan | PathFailure]:
    """A plan or a failure per path, in the order of the paths. Without an executor one after the other."""
    paths = list(paths)
    tell = progress or (lambda done, total: None)
    if executor is None:
        results = []
        for path in paths:
            results.append(_attempt(robot, path, options))
            tell(len(results), len(paths))
        return results
    bare = replace(robot)  # without the compiled robot that it may have cached, which does not travel
    futures = [executor.submit(_attempt, bare, path, options) for path in paths]
    for done, _ in enumerate(as_completed(futures), start=1):
        tell(done, len(paths))
    return _collect(paths, futures)


def _collect(paths: Sequence[PlannedPath], futures: Sequence) -> list[Plan | PathFailure]:
    results: list[Plan | PathFailure] = []
    for path, future in zip(paths, futures):
        error = future.exception()
        results.append(future.result() if error is None
                       else PathFailure(path, f"{type(error).__name__}: {error}"))
    return results


def _attempt(robot: Robot, path: PlannedPath, options: PlanOptions) -> Plan | PathFailure:
    from exactarm import _core

    try:
        return plan_path(robot, path, options)
    except (ComputationError, InputError, _core.InvalidArgument) as error:
        return PathFailure(path, str(error))
