"""Which commands there are, read from the files of a package without importing them."""

import ast
import functools
import importlib
import threading
from pathlib import Path
from typing import Any

COMMANDS = "exactarm.commands"
_PARSING = threading.Lock()  # Python 3.11 counts the depth of all threads' trees together, and gives up


def find_commands(package: str = COMMANDS) -> dict[str, tuple[str, str]]:
    """Command name -> (module, help), from the literals NAME and HELP of each file."""
    found = {}
    folder = Path(importlib.import_module(package).__file__).parent
    for path in sorted(folder.glob("*.py")):
        literals = _string_literals(path)
        if {"NAME", "HELP"} <= literals.keys():
            found[literals["NAME"]] = (path.stem, literals["HELP"])
    return found


def import_command(name: str, package: str = COMMANDS) -> Any:
    """The module of a command."""
    return importlib.import_module(f"{package}.{find_commands(package)[name][0]}")


@functools.cache
def _string_literals(path: Path) -> dict[str, str]:
    """The module's assignments NAME = "text" at its top level; read once, since all files take 0.1 s."""
    literals = {}
    with _PARSING:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in tree.body:
        text = getattr(getattr(node, "value", None), "value", None)
        if isinstance(node, ast.Assign) and isinstance(text, str):
            literals |= {target.id: text for target in node.targets if isinstance(target, ast.Name)}
    return literals
