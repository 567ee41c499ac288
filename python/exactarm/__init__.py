"""exactarm: calibration, diagnosis and offline planning for serial industrial robots.

    import exactarm as ea

    robot = ea.load_robot("ur10")                   # a shipped name, a .toml or a .urdf
    result = ea.calibrate(robot, "poses.csv")       # every command of the command line is a function
    print(result)                                   # the verdict in ten lines; result.summary(): all of it
    result.parameters                               # estimates with their intervals, a pandas table
    better = result.robot
    better.fk([0, -1.5, 1.5, 0, 1.5, 0])            # the pose at the angles that the controller shows

Nothing is imported before it is used. A command that shares its name with a package inside this one (`plan`,
`diagnose`, `identify`, `simulate`, ...) is that package, and can be called.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

COMMANDS = (
    "accept", "batch", "calibrate", "certify", "check", "compensate", "corners", "design", "diagnose",
    "evaluate", "export", "gear", "identifiable", "identify", "merge", "plan", "simulate", "study",
)
NAMES = {
    "load_robot": "exactarm.robot_file", "write_robot": "exactarm.robot_file",
    "shipped_robots": "exactarm.robot_file", "Robot": "exactarm.robot_file",
    "Joint": "exactarm.robot.robot", "Link": "exactarm.robot.robot",
    "Placement": "exactarm.robot.robot",
    "read": "exactarm.commands.call", "example": "exactarm.files.examples",
    "Dataset": "exactarm.data.dataset", "write_dataset": "exactarm.data.dataset",
    "Result": "exactarm.commands.result",
    "command_of": "exactarm.compensate.law", "actual_of": "exactarm.compensate.law",
    "Poses": "exactarm.compensate.flange_poses",
    "InputError": "exactarm.errors", "ComputationError": "exactarm.errors", "Progress": "exactarm.progress",
}
__all__ = [*NAMES, *COMMANDS]  # noqa: PLE0604 (names of both)


def _command(name: str) -> Any:
    return getattr(importlib.import_module(f"exactarm.commands.{name}"), name)


class _CallablePackage(ModuleType):
    """A room of the package that is also the command of its name: `exactarm.plan(robot, path)`."""

    def __call__(self, *values: Any, **options: Any) -> Any:
        return _command(self.__name__.rpartition(".")[2])(*values, **options)

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """What `help(exactarm.plan)` says: of the command, then of the package."""
        import inspect

        name, own = self.__name__.rpartition(".")[2], self.__dict__["__doc__"]
        return (f"exactarm.{name}{self.__signature__}\n\n{inspect.getdoc(_command(name))}\n\n"
                f"exactarm.{name} is also a package: {own}")

    @property
    def __signature__(self) -> Any:
        import inspect

        return inspect.signature(_command(self.__name__.rpartition(".")[2]))


class _Package(ModuleType):
    def __setattr__(self, name: str, value: Any) -> None:
        if name in COMMANDS and type(value) is ModuleType:
            value.__class__ = _CallablePackage
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name in COMMANDS:
        try:  # a room of that name is what `import exactarm.plan` gives too
            return importlib.import_module(f"exactarm.{name}")
        except ModuleNotFoundError as error:
            if error.name != f"exactarm.{name}":
                raise
        try:
            return _command(name)
        except ModuleNotFoundError:
            raise AttributeError(f"module 'exactarm' has no attribute {name!r}") from None
    if name in NAMES:
        return getattr(importlib.import_module(NAMES[name]), name)
    import difflib

    close = difflib.get_close_matches(name, __all__, n=1)
    meant = f"; did you mean {close[0]}?" if close else ""
    raise AttributeError(f"module 'exactarm' has no attribute {name!r}{meant}")


def __dir__() -> list[str]:
    return sorted({*__all__, "__version__"})
