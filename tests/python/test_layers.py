"""The rules of the house that a machine can check: imports run downwards only, small files, no special
cases."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

import exactarm as ea

TOP = Path(__file__).parents[2]
PYTHON, CPP = TOP / "python" / "exactarm", TOP / "cpp"
MOST_LINES = 400
# Files that are longer still, and how long they may be. Only ever fewer.
LONGER = {
    "tests/python/test_dataset.py": 416,
    "tests/python/test_report.py": 406,
    "tests/python/test_simulate.py": 401,
}

LEAVES = {"leaf", "files", "numerics"}
VALUES = LEAVES | {"robot", "data"}
MODEL = VALUES | {"effects", "chain"}
MEASURED = MODEL | {"robot_file", "measurement"}
# Room -> rooms that it may import. A module directly in the package is a leaf unless it is named here.
MAY_IMPORT = {
    "leaf": {"leaf"},
    "files": LEAVES,
    "numerics": LEAVES,
    "robot": LEAVES | {"robot"},
    "data": VALUES,
    "rest_load": VALUES,
    "view": VALUES | {"rest_load"},
    "effects": VALUES | {"view", "rest_load", "effects"},
    "chain": MODEL | {"view", "rest_load"},
    "robot_file": MODEL,
    "measurement": MODEL | {"view", "measurement"},
    "noise": LEAVES | {"noise"},
    "plan": MODEL | {"view", "robot_file", "plan"},
    "simulate": MEASURED | {"view", "simulate"},
    "compensate": MODEL | {"robot_file", "compensate"},
    "export": MODEL | {"compensate", "export"},
    "identify": MODEL | {"measurement", "view", "rest_load", "noise", "identify"},
    "first_aid": MEASURED | {"view", "rest_load", "identify", "first_aid"},
    "design": MEASURED | {"identify", "design"},
    "verify": MEASURED | {"identify", "first_aid", "verify"},
    "diagnose": MEASURED | {"view", "identify", "design", "noise", "diagnose"},
    "report": {"errors", "progress", "report"},
    "commands": MEASURED | {"identify", "first_aid", "design", "plan", "compensate", "export", "simulate",
                            "diagnose", "verify", "report", "commands"},
    "cli": {"leaf", "commands"},
    "__main__": {"cli"},
}
CPP_MAY_INCLUDE = {
    "base": {"base"},
    "robot": {"base", "robot"},
    "nlp": {"base", "nlp"},
    "ocp": {"base", "robot", "nlp", "ocp"},
}


@cache
def syntax_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of a file: walked once, for walking takes as long as reading."""
    return tuple(ast.walk(syntax_of(path)))


def python_files():
    return sorted(PYTHON.rglob("*.py"))


def own_files():
    folders = [TOP / name for name in ("cpp", "python", "bench", "tests")]
    kinds = {".py", ".hpp", ".cpp", ".h", ".html"}
    return sorted(path for folder in folders for path in folder.rglob("*") if path.suffix in kinds)


@cache
def room_of(module: str) -> str:
    """The room of exactarm.a.b; a module directly in the package that has no rules of its own is a leaf."""
    name = module.split(".")[1]
    return name if name in MAY_IMPORT or (PYTHON / name).is_dir() else "leaf"


def imported_modules(tree: ast.AST):
    """Names exactarm.x that a module imports when it runs; imports for type checkers do not count."""
    for node in ast.iter_child_nodes(tree):
        checked = isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        if checked or isinstance(node, ast.expr):  # no statement stands in an expression
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("exactarm."))
        elif isinstance(node, ast.ImportFrom) and node.module == "exactarm":
            yield from (f"exactarm.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("exactarm."):
            yield node.module
        else:
            yield from imported_modules(node)


MODULES = [path for path in python_files() if path != PYTHON / "__init__.py"]


def upward_imports(path: Path) -> list[str]:
    """What a module imports against the rules, each as `module imports other`."""
    module = "exactarm." + ".".join(path.relative_to(PYTHON).with_suffix("").parts)
    room = room_of(module)
    if room not in MAY_IMPORT:
        return [f"the folder {room} is new: say what it may import"]
    target = lambda name: name.split(".")[1] if room == "report" else room_of(name)
    return [
        f"{module} imports {name}" for name in imported_modules(syntax_of(path))
        if target(name) not in MAY_IMPORT[room]
    ]


def test_imports_run_downwards():
    assert not [line for path in MODULES for line in upward_imports(path)]


def test_the_package_itself_imports_nothing():
    assert not list(imported_modules(ast.parse((PYTHON / "__init__.py").read_text())))


def test_no_module_imports_what_takes_long():
    """scipy.signal imports scipy.stats, which takes half a second of every command; scipy.special and
    scipy.fft have what is used of them."""
    assert not [path.name for path in python_files() if every_import(path) & {"scipy.stats", "scipy.signal"}]


def test_includes_run_downwards():
    assert not [
        f"{path.name} includes {target}" for room, allowed in CPP_MAY_INCLUDE.items()
        for path in (CPP / "exactarm" / room).glob("*.?pp")
        for target in re.findall(r'#include\s+["<]exactarm/(\w+)/', path.read_text()) if target not in allowed
    ]


def every_import(path: Path) -> set[str]:
    """Modules exactarm.x that a file names in any import, those for type checkers and in functions too."""
    found = set()
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def module_of(path: Path) -> str:
    parts = path.relative_to(PYTHON).with_suffix("").parts
    return ".".join(("exactarm", *(parts[:-1] if parts[-1] == "__init__" else parts)))


def test_imports_have_no_circle():
    """Imports for type checkers and in functions count."""
    modules = {module_of(path): path for path in python_files()}
    names, order = list(modules), {name: k for k, name in enumerate(modules)}
    edges = [(order[one], order[other]) for one in names
             for other in every_import(modules[one]) & order.keys()]
    rows, columns = np.array(edges).T
    graph = csr_array((np.ones(len(edges)), (rows, columns)), shape=(len(names), len(names)))
    _, member = connected_components(graph, connection="strong")
    circles = [{names[k] for k in np.flatnonzero(member == circle)} for circle in np.unique(member)]
    assert not [circle for circle in circles if len(circle) > 1]


KINDS = PYTHON / "data" / "kinds"
KIND_NAMES = {"poses", "gear_run", "motion", "tracked_motion", "closures"}
# Where these words stand outside of `kinds`: a direction of gear tables, names of figures, keys, measures.
# Only ever fewer.
OTHER_MEANINGS = 17


def words_of_kinds(path: Path) -> int:
    return sum(isinstance(node, ast.Constant) and node.value in KIND_NAMES
               for node in nodes_of(path))


def test_no_other_room_names_a_kind_of_data():
    elsewhere = {str(path): words_of_kinds(path) for path in python_files()
                 if path.parent != KINDS}
    assert sum(elsewhere.values()) <= OTHER_MEANINGS, {path: count for path, count in elsewhere.items()
                                                       if count}


def kinds_asked_for(path: Path) -> int:
    """Comparisons with the name of a kind's object, `... == POSES.name` or `... in (POSES.name, ...)`."""
    compared = [node for node in nodes_of(path) if isinstance(node, ast.Compare)]
    sides = [side for node in compared for side in node.comparators]
    sides += [node.left for node in compared if isinstance(node.ops[0], ast.Eq | ast.NotEq)]
    each = [item for side in sides for item in getattr(side, "elts", [side])]
    return sum(isinstance(item, ast.Attribute) and item.attr == "name"
               and getattr(item.value, "id", "").lower() in KIND_NAMES for item in each)


def test_a_kind_is_asked_where_its_chain_begins_and_what_ends_it_not_which_one_it_is():
    """Commands may read one kind alone."""
    rooms = [path for path in MODULES
             if room_of(module_of(path)) != "commands" and path.parent != KINDS]
    assert not [str(path.relative_to(PYTHON)) for path in rooms if kinds_asked_for(path)]


def test_every_room_of_the_core_has_rules():
    assert {path.name for path in (CPP / "exactarm").iterdir() if path.is_dir()} <= set(CPP_MAY_INCLUDE)


def test_the_core_knows_no_python():
    for path in (CPP / "exactarm").rglob("*.?pp"):
        assert "pybind11" not in path.read_text(), path.name


def test_files_are_small():
    lines = {str(path.relative_to(TOP)): len(path.read_text().splitlines()) for path in own_files()}
    assert len(lines) > 300
    assert not {path: count for path, count in lines.items() if count > LONGER.get(path, MOST_LINES)}


def test_lines_of_the_core_are_as_short_as_those_of_python():
    longest = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["ruff"]["line-length"]
    core = [path for path in own_files() if path.suffix in {".hpp", ".cpp", ".h"}]
    assert len(core) > 100
    assert not [f"{path.relative_to(TOP)}:{number}" for path in core
                for number, line in enumerate(path.read_text().splitlines(), 1) if len(line) > longest]


def test_files_are_named_for_a_concept():
    assert not [str(path) for path in own_files() if re.search(r"utils?|helpers?|tools|misc", path.stem)]


def test_the_linter_finds_nothing():
    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--quiet", "--output-format", "concise"]
    run = subprocess.run([*command, TOP], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_factors_that_may_not_converge_are_asked_for_in_one_place():
    asked = re.compile(r"linalg\.(svd|lstsq|pinv)\((?!.*hermitian=True)")
    found = [str(path) for path in python_files() if path.name != "factors.py"
             for line in path.read_text().splitlines() if asked.search(line)]
    assert not found  # numerics/factors.py


def test_types_are_checked_in_every_module_that_a_user_calls():
    checked = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["mypy"]["modules"]
    assert set(checked) == {"exactarm", *ea.NAMES.values(),
                            *(f"exactarm.commands.{name}" for name in ea.COMMANDS)}


def test_every_module_says_what_it_is():
    for path in python_files():
        assert ast.get_docstring(syntax_of(path)), path
    for path in (CPP / "exactarm").rglob("*.hpp"):
        assert path.read_text().startswith("//"), path


def test_only_the_command_line_prints():
    for path in python_files():
        calls = [node for node in nodes_of(path)
                 if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print"]
        assert not calls or path.name == "cli.py", path


def effect_names():
    names = set()
    for path in (PYTHON / "effects").glob("*.py"):
        for node in nodes_of(path):
            target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
            value = getattr(node, "value", None)
            if getattr(target, "id", "") == "name" and isinstance(value, ast.Constant) and value.value:
                names.add(value.value)
    return names


def test_no_room_treats_an_effect_specially():
    names = effect_names()
    assert "joint_compliance" in names
    for path in python_files():
        if PYTHON / "effects" in path.parents:
            continue
        for node in nodes_of(path):
            if isinstance(node, (ast.Compare, ast.MatchValue)):
                words = {part.value for part in ast.walk(node) if isinstance(part, ast.Constant)}
                assert not words & names, f"{path.name}:{node.lineno} compares with the name of an effect"


def test_no_room_asks_for_the_class_of_an_effect():
    """What an effect is said to be is a property that any effect may have."""
    files = [path for path in (PYTHON / "effects").glob("*.py") if path.stem != "base"]
    classes = {node.name for path in files for node in nodes_of(path)
               if isinstance(node, ast.ClassDef)}
    assert {"Frames", "Payload"} <= classes
    asks = [
        f"{path.name}:{node.lineno}" for path in python_files() if PYTHON / "effects" not in path.parents
        for node in nodes_of(path)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass")
        and {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)} & classes
    ]
    assert not asks
