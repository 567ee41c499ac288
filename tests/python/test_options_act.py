"""An option stands in the help of a command only where the command reads it; scripts may still give --seed
and --threads to every command."""

import argparse
import ast
import importlib
from functools import cache
from pathlib import Path

import pytest

from exactarm.commands.execute import parse, parser_of
from exactarm.commands.listing import COMMANDS, find_commands, import_command

FOLDER = Path(importlib.import_module(COMMANDS).__file__).parent
EVERYWHERE = {"help", "out", "quiet", "debug", "map"}  # read by the command line itself
RECORDED = {"asked", "_line"}  # what a call is written down with: nothing is done by it
SHARED = {"execute", "arguments", "listing", "completion", "call", "publish", "outcome", "output", "result"}
NAMES = sorted(find_commands())


@cache
def body_of(stem):
    return ast.parse((FOLDER / f"{stem}.py").read_text()).body


def parts(stem, names=None, seen=None):
    """Definitions that a command can reach: its module, and what it takes from others of the folder, without
    what all commands share. names: of the definitions that are wanted, None: all."""
    seen = set() if seen is None else seen
    body = body_of(stem)
    known = {node.name: node for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    known |= {node.targets[0].id: node for node in body
              if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)}
    sources = {alias.asname or alias.name: (node.module.rsplit(".", 1)[1], alias.name) for node in body
               if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{COMMANDS}.")
               for alias in node.names}
    modules = {alias.name for node in body if isinstance(node, ast.ImportFrom) and node.module == COMMANDS
               for alias in node.names}
    found, waiting = [], [*(known if names is None else names)]
    found += [node for node in body if names is None and not hasattr(node, "name")]
    while waiting:
        name = waiting.pop()
        if (stem, name) in seen or name not in known:
            continue
        seen.add((stem, name))
        found.append(known[name])
        for node in ast.walk(known[name]):
            if isinstance(node, ast.Name) and node.id in known:
                waiting.append(node.id)
            elif isinstance(node, ast.Name) and node.id in sources and sources[node.id][0] not in SHARED:
                found += parts(sources[node.id][0], [sources[node.id][1]], seen)
            elif isinstance(node, ast.Name) and node.id in modules:
                found += parts(node.id, None, seen)
    return found


def reads(trees, name):
    """Whether `arguments.NAME`, or the name as text (for getattr), is loaded anywhere."""
    return any(
        (isinstance(node, ast.Attribute) and node.attr == name and isinstance(node.value, ast.Name))
        or (isinstance(node, ast.Constant) and node.value == name and not isinstance(node.value, bool))
        for each in trees for node in ast.walk(each) if not declares(node)
    )


def declares(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("--")


def acts(trees, name, own):
    """Whether a common option reaches anything but the record of the call: outside `asked(...)`, and outside
    the call by which the command's words reach its function."""
    def walk(node, inside):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            inside = inside or node.func.id in RECORDED or node.func.id == own
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            inside = inside or node.func.attr == "update"  # arguments as a Python call has them
        loaded = isinstance(getattr(node, "ctx", None), ast.Load)
        hit = loaded and (
            (isinstance(node, ast.Name) and node.id == name)
            or (isinstance(node, ast.Attribute) and node.attr == name
                and isinstance(node.value, ast.Name) and node.value.id == "arguments")
        )
        return (hit and not inside) or any(walk(child, inside) for child in ast.iter_child_nodes(node))
    return any(walk(each, False) for each in trees)


def shown(module):
    return {action.dest for action in parser_of(module)._actions
            if action.option_strings and action.help != argparse.SUPPRESS}


@pytest.mark.parametrize("command", NAMES)
def test_every_option_in_the_help_is_read(command):
    module = import_command(command)
    trees = parts(find_commands()[command][0])
    unread = {name for name in shown(module) - EVERYWHERE - {"seed", "threads"} if not reads(trees, name)}
    assert not unread


@pytest.mark.parametrize("name", ["seed", "threads"])
@pytest.mark.parametrize("command", NAMES)
def test_seed_and_threads_stand_in_the_help_where_they_act(command, name):
    module = import_command(command)
    assert (name in shown(module)) == acts(parts(find_commands()[command][0]), name, module.NAME)


def test_a_command_takes_seed_and_threads_where_nothing_reads_them():
    module = import_command("export")
    arguments = parse(module, ["ur10", "--format", "urdf", "--out", "made", "--seed", "7", "--threads", "2"])
    assert (arguments.seed, arguments.threads) == (7, 2)
    assert not {"seed", "threads"} & shown(module)
