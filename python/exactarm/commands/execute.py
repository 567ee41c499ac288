"""Runs one command from its words: parse, work, write. Used by the command line and by commands that run others."""

from __future__ import annotations

import argparse
import time
from typing import Any, NoReturn, Sequence

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
    parser = _Parser(prog=f"exactarm {module.NAME}", description=module.HELP, allow_abbrev=False)
    module.add_arguments(parser)
    add_common(parser)
    return parser.parse_intermixed_args(list(words))


def execute(module: Any, arguments: argparse.Namespace, progress: Progress) -> Published:
    """Does the work and writes all results; on any failure nothing is left half written."""
    arguments.progress = progress
    started = time.perf_counter()
    with OutputFolder(arguments.out) as folder:
        result = module.run(arguments)
        published = publish(module.NAME, arguments, result, folder, started)
    progress.close()
    return published
