"""Runs one command from its words: parse, work, write. Used by the command line and by commands that run
others."""

import argparse
import difflib
import shlex
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from exactarm._core import InvalidArgument
from exactarm.commands.arguments import NumbersParser, add_common, require_bounded
from exactarm.commands.outcome import Asked
from exactarm.commands.output import OutputFolder, may_write
from exactarm.commands.publish import Published, publish, sources
from exactarm.commands.result import CommandResult
from exactarm.errors import InputError
from exactarm.progress import Progress
from exactarm.report.plots.files import DRAWING


class _Parser(NumbersParser):
    """Reports a wrong argument as any other bad input: one line, exit 2, with the option that was meant."""

    words: Sequence[str] = ()  # what is parsed: of a wrong option argparse may tell that another is missing

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}{self._meant(message)} (see {self.prog} --help)")

    def _meant(self, message: str) -> str:
        if not message.startswith(("unrecognized arguments", "the following arguments are required")):
            return ""
        given = (word.partition("=")[0] for word in self.words if word.startswith("--"))
        wrong = next((word for word in given if word not in self._option_string_actions), "")
        close = difflib.get_close_matches(wrong, self._option_string_actions, n=1) if wrong else []
        instead = "" if message.startswith("unrecognized") else f" for {wrong}"
        return f"; did you mean {close[0]}{instead}?" if close else ""


def parser_of(module: Any) -> _Parser:
    """The parser of a command."""
    parser = _Parser(prog=f"exactarm {module.NAME}", description=module.HELP, allow_abbrev=False)
    module.add_arguments(parser)
    add_common(parser, getattr(module, "UNUSED_OPTIONS", ()))
    return parser


def parse(module: Any, words: Sequence[str]) -> argparse.Namespace:
    """The arguments of a command from its words (without its name)."""
    _require_text(words)
    parser = parser_of(module)
    parser.words = words
    arguments = parser.parse_intermixed_args(list(words))
    require_bounded(vars(arguments))
    arguments.line = shlex.join(["exactarm", module.NAME,
                                 *_open(words, getattr(module, "HIDDEN_OPTIONS", ()))])
    return arguments


def _open(words: Sequence[str], hidden: Sequence[str]) -> list[str]:
    """The words of a command line without the values of options that a result must not tell."""
    after = ("", *words)
    return ["..." if before in hidden
            else next((f"{name}=..." for name in hidden if word.startswith(f"{name}=")), word)
            for before, word in zip(after, words)]


def _require_text(words: Sequence[str]) -> None:
    """A path in bytes that are no text could be opened, but not written into a result for others to read."""
    for before, word in zip(("", *words), words):
        if not word.strip() and not before.startswith("--"):  # as "$UNSET": as a path it would be the folder
            raise InputError(f"argument {word!r}: is empty, expected a name or a file")
        try:
            word.encode()
        except UnicodeEncodeError:
            shown = word.encode(errors="backslashreplace").decode()
            raise InputError(
                f"argument {shown}: is no UTF-8 text; expected a name that a result can hold") from None
        if "\0" in word:
            raise InputError("argument with a null character; expected text")


def _main_input(arguments: argparse.Namespace) -> Any:
    """What a refusal is about that names no file itself: the first data or path file, else the robot."""
    files = [*(getattr(arguments, "files", None) or []), *(getattr(arguments, "paths", None) or [])]
    return next(iter(files), None) or getattr(arguments, "path", None) or getattr(arguments, "robot", None)


def _with_columns(arguments: argparse.Namespace) -> argparse.Namespace:
    """The same with the data of FILES in place of their names, where --map gives columns other names."""
    given = dict(getattr(arguments, "map", None) or [])
    if not given:
        return arguments
    from exactarm.commands.call import robot_of
    from exactarm.data.dataset import read_dataset

    robot = robot_of(arguments.robot)
    data = read_dataset(arguments.files, robot, arguments.kind, columns=given)
    return argparse.Namespace(**(vars(arguments) | {"files": data}))


def _paths_in(arguments: argparse.Namespace) -> list[str | Path]:
    """Whatever of the arguments could name a file that is read."""
    given = [value for key, value in vars(arguments).items() if key != "out"]
    each = [item for value in given for item in (value if isinstance(value, (list, tuple)) else [value])]
    return [item for item in each if isinstance(item, (str, Path))]


def execute(module: Any, arguments: argparse.Namespace, progress: Progress,
            width: int | None = None) -> Published:
    """Does the work and writes all results; on any failure nothing is left half written."""
    from exactarm.commands.call import with_robot_mistakes

    arguments.progress = progress
    progress.ends_with(DRAWING)
    started = time.perf_counter()
    with OutputFolder(arguments.out, may_write(module, arguments), _paths_in(arguments)) as folder:
        try:
            result = module.run(_with_columns(arguments))
            result = with_robot_mistakes(result, getattr(arguments, "robot", None))
        except InputError as error:
            raise error.within(_main_input(arguments)) from error
        except InvalidArgument as error:
            raise InputError(str(error)).within(_main_input(arguments)) from error
        result = replace(result, asked=_asked(module.NAME, arguments, result))
        published = publish(result, folder, started, progress, width)
    progress.close()
    return published


def _asked(command: str, arguments: argparse.Namespace, result: CommandResult) -> Asked:
    """The words of the command line in place of the Python call."""
    robot = getattr(arguments, "robot", None)
    known = result.asked.files if result.asked else ()
    given = [robot, getattr(arguments, "before", None)]  # in the order of the command line
    read = [*(each for each in given if each), *(getattr(arguments, "files", None) or [])]
    named = {source.path: source for source in (*known, *sources(read, known))}
    files = tuple(named.pop(path) for path in dict.fromkeys(map(str, read))
                  if path in named) + tuple(named.values())
    return Asked(command, arguments.line, robot, files, arguments.seed, _reading(arguments))


def _reading(arguments: argparse.Namespace) -> tuple[str, ...]:
    """The options of FILES that another command takes too."""
    given = vars(arguments)
    words = [word for name in ("kind", "fixture", "sessions") if given.get(name)
             for word in (f"--{name}", str(given[name]))]
    renamed = given.get("map") or given.get("columns") or []
    return (*words, *(word for theirs, ours in renamed for word in ("--map", f"{theirs}={ours}")))
