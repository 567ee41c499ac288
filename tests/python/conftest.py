"""What a test must not take from the one who runs it: an ignored Ctrl-C, and his own library of effects; and
what holds in every test: a command writes the files alone that it says before its work."""

import gc
import itertools
import os
import shutil
import signal
import sys
import tempfile
from fnmatch import fnmatchcase

import pytest

# A shell ignores Ctrl-C in jobs of the background, and programs under test inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Byte code is kept, whatever the environment says: else every worker and every child process compiles anew.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
_OF_MODULES = os.environ["EXACTARM_EFFECTS"] = tempfile.mkdtemp(prefix="exactarm-effects-")  # of modules


def pytest_collection_finish():
    """Modules and tests stay to the end: the garbage collector need not walk them again and again, nor after
    every 700 new objects."""
    gc.freeze()
    gc.set_threshold(50_000)


def pytest_unconfigure():
    """The folder of effects that modules prepare with goes again, in every process of the tests."""
    shutil.rmtree(_OF_MODULES, ignore_errors=True)


_NUMBERS = itertools.count()
_EMPTY_SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"></svg>'


@pytest.fixture(autouse=True)
def figures_are_built_not_drawn(request, monkeypatch):
    """Quick tests of commands look at numbers: all figures are built, and what stands in their files is
    empty. Drawing would take most of their time; the slow ones and those marked `drawn` draw."""
    if request.node.get_closest_marker("slow") or request.node.get_closest_marker("drawn"):
        return

    def written(built, vector, raster):
        vector.write_text(_EMPTY_SVG)
        raster.write_bytes(b"\x89PNG")

    monkeypatch.setattr("exactarm.report.plots.picture.write_picture", written)


@pytest.fixture(autouse=True)
def own_effects(tmp_path_factory, monkeypatch):
    """A library of its own for every test: what one accepts, no other finds."""
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path_factory.getbasetemp() / f"effects_{next(_NUMBERS)}"))


@pytest.fixture(autouse=True)
def only_declared_files(monkeypatch):
    """What a command publishes is what its `WRITES` declares: else a file in the way is found at the end."""
    from exactarm.commands.output import ALWAYS, OutputFolder

    publish = OutputFolder.publish

    def checked(folder, *inputs):
        undeclared = [name for name in map(str, folder._names())
                      if not any(fnmatchcase(name, pattern) for pattern in folder._writes)]
        assert folder._writes == ALWAYS or undeclared == []  # those of no command
        return publish(folder, *inputs)

    monkeypatch.setattr(OutputFolder, "publish", checked)
