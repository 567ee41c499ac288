"""Runs one command from its words: parse, work, write. Used by the command line and by commands that run others."""

from __future__ import annotations

import argparse
import time
from typing import Any, NoReturn, Sequence

from exactarm._core import InvalidArgument
from exactarm.commands.arguments import add_common
from exactarm.commands.output import OutputFolder
from exactarm.commands.publish import Published, publish
from exactarm.errors import InputError
from exactarm.progress import Progress


class _Parser(argparse.ArgumentParser):
    """Reports a wrong argument as any other bad input: one line, exit 2."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def parse(module: Any, words: Sequence[str]) -> argparse.Namespace:
    """The arguments of a command from its words (without its name)."""
    _require_text(words)
    parser = _Parser(prog=f"exactarm {module.NAME}", description=module.HELP, allow_abbrev=False)
    module.add_arguments(parser)
    add_common(parser)
    return parser.parse_intermixed_args(list(words))


def _require_text(words: Sequence[str]) -> None:
    """A path in bytes that are no text could be opened, but not written into a result that others can read."""
    for word in words:
        try:
            word.encode()
        except UnicodeEncodeError:
            shown = word.encode(errors="backslashreplace").decode()
            raise InputError(f"argument {shown}: is no UTF-8 text; expected a name that a result can hold") from None
        if "\0" in word:
            raise InputError("argument with a null character; expected text")


def _main_input(arguments: argparse.Namespace) -> Any:
    """What a refusal is about that names no file itself: the first data or path file, else the robot."""
    files = [*(getattr(arguments, "files", None) or []), *(getattr(arguments, "paths", None) or [])]
    return next(iter(files), None) or getattr(arguments, "path", None) or getattr(arguments, "robot", None)


def execute(module: Any, arguments: argparse.Namespace, progress: Progress) -> Published:
    """Does the work and writes all results; on any failure nothing is left half written."""
    arguments.progress = progress
    started = time.perf_counter()
    with OutputFolder(arguments.out) as folder:
        try:
            result = module.run(arguments)
        except InputError as error:
            raise error.within(_main_input(arguments)) from error
        except InvalidArgument as error:
            raise InputError(str(error)).within(_main_input(arguments)) from error
        published = publish(module.NAME, arguments, result, folder, started)
    progress.close()
    return published
