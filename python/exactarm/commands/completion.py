"""Tab completion of a shell for all commands and their options: `eval "$(exactarm --completion bash)"`."""

import argparse
from collections.abc import Sequence

import shtab

from exactarm.commands.execute import parser_of
from exactarm.commands.listing import COMMANDS, find_commands, import_command
from exactarm.errors import InputError

SHELLS = ("bash", "zsh", "tcsh")


def completion(words: Sequence[str], package: str = COMMANDS) -> str:
    """The script for the shell that `words` name (default bash)."""
    shell = words[0] if words else SHELLS[0]
    if shell not in SHELLS:
        raise InputError(f"--completion {shell}: expected one of {', '.join(SHELLS)}")
    parser = argparse.ArgumentParser(prog="exactarm")
    commands = parser.add_subparsers()
    for name, (_, text) in find_commands(package).items():
        own = parser_of(import_command(name, package))
        own.prog, own.description = f"exactarm {name}", text
        commands.add_parser(name, parents=[own], add_help=False, help=text.replace("%", "%%"))
    for one in commands.choices.values():
        for action in one._actions:
            if action.dest in ("robot", "files", "path", "fixture"):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
            elif action.dest == "out":
                action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    return str(shtab.complete(parser, shell))
