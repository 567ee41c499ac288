"""What the functions of the package take: a robot or its name, data or their files; and how a call is written
down.

Every command is one function here and on the command line: `exactarm.calibrate(robot, data, robust=True)` is
`exactarm calibrate ROBOT DATA --robust`, with the same options, the same default seed and the same result.
"""

from __future__ import annotations

import argparse
import inspect
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from numbers import Number
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, ParamSpec, TypeAlias, TypeVar, cast

import numpy as np

from exactarm.commands.arguments import NumbersParser, available_cores, require_bounded, require_common
from exactarm.commands.outcome import Asked
from exactarm.commands.plain import sha256
from exactarm.commands.publish import sources
from exactarm.commands.result import CommandResult
from exactarm.data.columns import PAYLOAD
from exactarm.data.dataset import ROBOT_SUFFIXES, Dataset, read_dataset
from exactarm.data.fixture import Fixture, load_fixture
from exactarm.data.rows import Source
from exactarm.data.session_table import with_sessions
from exactarm.errors import InputError
from exactarm.files.examples import file_or_example
from exactarm.files.memory_table import AnyFile, MemoryTable, is_memory_table, variable_of
from exactarm.first_aid.robot_mistakes import robot_mistakes
from exactarm.identify.rest_torque import as_drives_hold, as_springs_carry
from exactarm.robot.robot import Robot
from exactarm.robot_file import AnyRobot as AnyRobot
from exactarm.robot_file import load_robot, shipped_robots
from exactarm.robot_file import robot_of as robot_of

if TYPE_CHECKING:
    import pandas
P = ParamSpec("P")
R = TypeVar("R")
AnyTable: TypeAlias = "AnyFile | Mapping[str, Any] | pandas.DataFrame"
AnyData: TypeAlias = "Dataset | AnyTable | Sequence[AnyTable]"
AnyFixture = Fixture | str | Path | None
# names of options in Python that say their unit or are of several -> those of the command line
IN_PYTHON = {"rate_hz": "rate", "tool_m": "tool", "clearance_m": "clearance", "effects": "effect"}
_COMMON = ("seed", "threads", "progress")


def data_of(data: AnyData, robot: Robot, kind: str | None = None, fixture: AnyFixture = None,
            sessions: AnyFile | None = None, columns: Mapping[str, str] | None = None, *,
            weighs: Collection[str] = ()) -> Dataset:
    """Data as they are, or those of the files; with what is known of their fixture and of whole sessions.
    columns: the files' names -> ours; weighs: the kinds whose unknown payloads the command
    estimates."""
    known = fixture_of(fixture)
    if not isinstance(data, Dataset):
        files = tables_of(data, "files, tables, or what exactarm.read returns")
        data = read_dataset(files, robot, kind, known or Fixture(), columns)
    elif known is not None:
        data = replace(data, fixture=known)
    if known is not None and not data.contacts:
        raise InputError("--fixture acts on rows with contacts only (socket, plane, sphere, bar, pair, tilt, "
                         f"accel, u and v, partner_q); these are {data.kind.replace('_', ' ')}")
    data = data if sessions is None else with_sessions(data, sessions)
    if data.unweighed and not set(data.kinds) <= set(weighs):
        raise InputError(
            f"session {data.unweighed[0]}: no mass; expected one: `exactarm calibrate` of poses and "
            "`identify` of motions estimate it and write payloads.csv for --sessions",
            file=None if sessions is None else str(sessions), column=PAYLOAD)
    return as_springs_carry(robot, as_drives_hold(robot, data))


def fixture_of(fixture: AnyFixture) -> Fixture | None:
    """As it is, or of its file."""
    if fixture is None or isinstance(fixture, Fixture):
        return fixture
    (file,) = files_of([fixture], "a fixture or its file")
    return load_fixture(file, load_robot)


def tables_of(data: Any, expected: str = "files or tables") -> list[Path | MemoryTable]:
    """Files and tables in memory, each named by its place in what was given."""
    return [table_of(each, i, expected) for i, each in enumerate(listed(data), start=1)]


def listed(data: Any) -> list[Any]:
    """One or several, as a list."""
    one = isinstance(data, (str, Dataset, MemoryTable)) or is_memory_table(data)
    return [data] if one or not hasattr(data, "__iter__") else list(data)


def table_of(data: Any, which: int | str, expected: str = "a file or a table") -> Path | MemoryTable:
    """One of them; `which` names it: its place, or its argument."""
    if isinstance(data, MemoryTable):
        return data
    return (MemoryTable.of(data, which) if is_memory_table(data)
            else file_or_example(*files_of([data], expected)))


def table_option(data: AnyTable | None, name: str) -> AnyFile | None:
    """The option `name`: a path as it is, a table in memory as one."""
    return MemoryTable.of(data, name) if is_memory_table(data) else cast("AnyFile | None", data)


def files_among(*options: Any) -> tuple[AnyFile, ...]:
    """Of what was read beside the data, the files and tables."""
    return tuple(option for option in options if isinstance(option, MemoryTable)
                 or (isinstance(option, (str, Path)) and os.path.isfile(option)))


def files_of(data: Any, expected: str = "files") -> list[str | Path]:
    """Paths of one or more files."""
    files = listed(data)
    for file in files:
        if not isinstance(file, (str, Path)):
            raise InputError(f"data given as {type(file).__name__}; expected {expected}")
    return files


def require_choice(name: str, value: object, choices: Collection[object]) -> None:
    """As the command line refuses it."""
    if value not in choices:
        raise InputError(f"{name}={value!r}; expected one of {', '.join(map(repr, choices))}")


def threads_of(threads: int | None) -> int:
    """None: all cores."""
    return available_cores() if threads is None else threads


def command(function: Callable[P, R]) -> Callable[P, R]:
    """The function of a command: `seed` and `threads` are refused as the command line refuses them, before it
    works; and what the robot's file contradicts itself in is said."""
    parameters = inspect.signature(function)

    @wraps(function)
    def checked(*given: P.args, **options: P.kwargs) -> R:
        require_common(options)
        result = function(*given, **options)
        robot = parameters.bind(*given, **options).arguments.get("robot")
        told = with_robot_mistakes(result, robot) if isinstance(result, CommandResult) else result
        return cast(R, told)

    return checked


def with_robot_mistakes(result: CommandResult, robot: object) -> CommandResult:
    """The result with what values of the robot's file contradict each other, once."""
    if not isinstance(robot, (str, Path, Robot)):
        return result
    said = result.json.get("warnings", ())
    try:
        found = [line for line in robot_mistakes(robot_of(robot)) if line not in said]
    except InputError:  # a command that went without it
        return result
    return result.warned(found) if found else result


def asked(command: str, robot: AnyRobot, data: Dataset | Sequence[AnyFile] | None, seed: int,
          options: Mapping[str, Any], defaults: Mapping[str, Any] | None = None) -> Asked:
    """The call as it would be written, and what it read: of `data`, or of tables and other files. Options
    that are as their default are left out."""
    name = str(robot) if not isinstance(robot, Robot) else robot.name
    files = data.sources if isinstance(data, Dataset) else sources(data or ())
    read = tuple(files)
    if not isinstance(robot, Robot) and os.path.isfile(robot):
        read = (Source(str(robot), sha256(robot)), *read)
    words = [path_word(source.path) for source in files] or (["data"] if isinstance(data, Dataset) else [])
    given = [words[0] if len(words) == 1 else f"[{', '.join(words)}]"] if words else []
    changed = {key: value for key, value in options.items() if repr(value) != repr((defaults or {}).get(key))}
    keys = [f"{key}={_value_word(key, value)}" for key, value in (*changed.items(), ("seed", seed))]
    call = ", ".join([path_word(robot) if not isinstance(robot, Robot) else "robot", *given, *keys])
    return Asked(command, f"exactarm.{command}({call})", name, read, seed)


def changed_options(function: Callable[..., Any], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Of the `arguments` of a command's function (its `locals()`), the options of its own that are not as
    their default."""
    known = inspect.signature(function).parameters
    return {name: value for name, value in arguments.items()
            if known[name].kind is known[name].KEYWORD_ONLY and name not in _COMMON
            and repr(value) != repr(known[name].default)}


def arguments_of(add_arguments: Callable[[argparse.ArgumentParser], None], robot: AnyRobot,
                 files: Sequence[Any], options: Mapping[str, Any]) -> argparse.Namespace:
    """The arguments of a command that has many options: those that were changed, and the defaults of the
    others. Values are read as the command line would read them: a number, a text, or several of them."""
    parser = _Options(add_help=False)
    add_arguments(parser)
    actions = {action.dest: action for action in parser._actions}
    words: list[str] = []
    objects: dict[str, Any] = {"files": files} if "files" in actions else {}
    for given, value in options.items():
        name = IN_PYTHON.get(given, given)
        if value is None or not isinstance(value, (str, Path, Number, np.generic, np.ndarray, Sequence)):
            objects[name] = value  # what a command line cannot hold: a fixture, a table
            continue
        if (choices := actions[name].choices) is not None:
            require_choice(name, value, tuple(choices))
        words += _words(actions[name], value)
    require_bounded(options)
    known = vars(parser.parse_args(["robot", *map(str, files), *words]))
    return argparse.Namespace(**(known | objects | {"robot": robot}))


class _Options(NumbersParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(message)


def _words(action: argparse.Action, value: Any) -> list[str]:
    """An option with its value as the command line has it: [0.05, 0, 0.1] is 0.05,0,0.1; of an option that
    may be given again, each text or each whole number is one."""
    flag = action.option_strings[-1]
    if action.nargs == 0:
        require_choice(action.dest, value, (True, False))
        return [flag] if value else []
    several = isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str)
    if isinstance(action.nargs, int):
        return [flag, *(_word_of(item) for item in (value if several else [value]))]
    again = isinstance(action, argparse._AppendAction) and several
    texts = again and (action.type is not None or not all(isinstance(item, Number) for item in value))
    return [f"{flag}={_word_of(item)}" for item in (value if texts else [value])]


def _word_of(value: Any) -> str:
    if isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str):
        return ",".join(_word_of(item) for item in value)
    return str(value)


def _value_word(key: str, value: Any) -> str:
    """An option as a call has it; a fixture, which is a value of many lines, by its name."""
    return key if isinstance(value, Fixture) else repr(str(value) if isinstance(value, Path) else value)


def path_word(path: Any) -> str:
    """As a call has it."""
    return variable_of(str(path)) or repr(str(path))


def read(files: AnyTable | Sequence[AnyTable] | AnyRobot,
         robot: AnyRobot | AnyTable | Sequence[AnyTable], *, kind: str | None = None,
         fixture: AnyFixture = None, columns: Mapping[str, str] | None = None) -> Dataset:
    """Measured data of one or more CSV or Parquet files, or of tables in memory with the columns of such a
    file (a DataFrame, a mapping of names to arrays), in SI units. fixture: what is known of touched
    contacts. columns: the files' names -> ours, as {"J1": "q_1_deg"}. The robot may stand first, as in every
    command: read(robot, files).

        >>> import exactarm as ea
        >>> data = ea.read("ur10", ea.example("ur10/series_B"))
        >>> data.kind, data.position.shape
        ('poses', (1495, 3))
    """
    if _names_robot(files) and not _names_robot(robot):
        files, robot = robot, files
    return data_of(cast("AnyData", files), robot_of(cast("AnyRobot", robot)), kind, fixture, columns=columns)


def _names_robot(given: Any) -> bool:
    """Whether it is a robot, a shipped one's name or a robot file."""
    return isinstance(given, Robot) or (isinstance(given, (str, Path)) and (
        str(given) in shipped_robots()
        or Path(str(given).partition("#")[0]).suffix.lower() in ROBOT_SUFFIXES))
