"""An option stands in the help of a command only where the command reads it, and is refused where it does
nothing; scripts may still give --seed and --threads to every command."""

import argparse
import ast
import importlib
from functools import cache
from pathlib import Path

import pytest

from exactarm import cli
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
@pytest.mark.slow
def test_every_option_in_the_help_is_read(command):
    module = import_command(command)
    trees = parts(find_commands()[command][0])
    unread = {name for name in shown(module) - EVERYWHERE - {"seed", "threads"} if not reads(trees, name)}
    assert not unread


@pytest.mark.parametrize("name", ["seed", "threads"])
@pytest.mark.parametrize("command", NAMES)
@pytest.mark.slow
def test_seed_and_threads_stand_in_the_help_where_they_act(command, name):
    module = import_command(command)
    assert (name in shown(module)) == acts(parts(find_commands()[command][0]), name, module.NAME)


def test_a_command_takes_seed_and_threads_where_nothing_reads_them():
    module = import_command("export")
    arguments = parse(module, ["ur10", "--format", "urdf", "--out", "made", "--seed", "7", "--threads", "2"])
    assert (arguments.seed, arguments.threads) == (7, 2)
    assert not {"seed", "threads"} & shown(module)


SIMULATE, SOCKET = ("simulate", "racer-7-1.4"), ("design", "ur10", "--contact", "socket")
FOR, CAMERA = ("design", "ur10", "--for", "result.json"), ("design", "ur10", "--contact", "camera")


@pytest.mark.parametrize("words, said", [
    ((*SIMULATE, "--contact", "plane"), "--contact acts with --measure closures only"),
    ((*SIMULATE, "--speed", "40"), "--speed acts with --measure gear only"),
    ((*SIMULATE, "--torques", "1", "--measure", "gear"), "--torques acts with --measure poses or motion"),
    ((*SIMULATE, "--engine", "own"), "--engine acts with --measure tracked or --compare only"),
    ((*SIMULATE, "--compare", "line", "--noise", "1e-5"), "--noise acts without --compare only"),
    ((*SIMULATE, "poses.csv", "--count", "5"), "--count acts without FILE only"),
    ((*SIMULATE, "poses.csv", "--measure", "gear"), "poses.csv: --measure gear takes no FILE"),
    ((*SIMULATE, "poses.csv", "--measure", "motion"), "takes a trajectory with time_s"),
    (("calibrate", "ur10", "poses.csv", "--fixture", "fixture.toml"), "--fixture acts on rows with contacts"),
    (("evaluate", "ur10", "poses.csv", "--fixture", "fixture.toml"), "these are poses"),
    (("calibrate", "panda", "ball_in_socket/panda_7", "--robust"), "--robust acts on poses only"),
    (("calibrate", "panda", "ball_in_socket/panda_7", "--use", "pose"), "--use acts on poses only"),
    (("plan", "racer-7-1.4", "line", "--linear-solver", "ma27"), "acts with --solver ipopt only"),
    (("identifiable", "ur10", "--fixture", "fixture.toml"), "--fixture acts on rows with contacts only"),
    (("identifiable", "ur10", "poses.csv", "--box", "0,1,0,1,0,1"), "--box acts without FILE only"),
    (("compensate", "ur10", "part.script", "--frame", "device"), "--frame acts on a table"),
    (("compensate", "ur10", "part.script", "--session", "1"), "--session acts with --frame device only"),
    (("design", "ur10", "--acceptance", "400"), "--acceptance 400: expected degrees above 0, 180 at most"),
    (("design", "ur10", "--acceptance", "40"), "--acceptance acts with --station X,Y,Z and --opening"),
    (("design", "ur10", "--apart-mm", "20"), "--apart-mm acts with --contact socket only"),
    (("design", "ur10", "--minutes", "visit=2"), "--minutes acts with --for RESULT only"),
    ((*FOR, "--station", "3,0,1"), "--station acts without --for only"),
    ((*FOR, "--contact", "socket"), "--contact acts without --for only"),
    ((*SOCKET, "--program", "krl"), "--program acts without --contact only"),
    ((*SOCKET, "--near-mm", "200"), "--near-mm acts with --contact camera only"),
    ((*CAMERA, "--apart-mm", "20"), "--apart-mm acts with --contact socket only"),
    ((*SOCKET, "--places", "2", "--at", "0.5,0,0.5"), "--places acts without --at only"),
])
def test_an_option_that_does_nothing_is_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    header = ",".join(f"q_{i}_rad" for i in range(1, 7))
    Path("poses.csv").write_text(f"{header},x_m,y_m,z_m\n" + "0.1,-1,1,0.2,1,0,0.5,0.1,0.4\n" * 3)
    Path("fixture.toml").write_text('[[radii]]\ncontact = "sphere"\nnumber = 0\nradius_mm = 12.7\n')
    Path("part.script").write_text("movej([0.8, -1.1, 1.5, -0.3, 1.0, -0.1])\n")
    assert cli.main([*words, "--out", "out", "--quiet"]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1 and not Path("out/result.json").exists()
