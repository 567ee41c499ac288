"""What a test must not take from the one who runs it: an ignored Ctrl-C, and his own library of effects."""

import gc
import itertools
import os
import signal
import tempfile

import pytest

# A shell ignores Ctrl-C in jobs of the background, and programs under test inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
os.environ["EXACTARM_EFFECTS"] = tempfile.mkdtemp(prefix="exactarm-effects-")  # for what modules prepare


def pytest_collection_finish():
    """Modules and tests stay to the end: the garbage collector need not walk them again and again."""
    gc.freeze()


_NUMBERS = itertools.count()


@pytest.fixture(autouse=True)
def own_effects(tmp_path_factory, monkeypatch):
    """A library of its own for every test: what one accepts, no other finds."""
    monkeypatch.setenv("EXACTARM_EFFECTS", str(tmp_path_factory.getbasetemp() / f"effects_{next(_NUMBERS)}"))
