"""Long work in the core ends when a signal asks for it, and its threads end before the interpreter does."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

PREPARE = """
import signal, sys, threading, time
import numpy as np
from exactarm import _core

link = _core.LinkInertia(1.0, np.full(3, 0.05), np.eye(3) * 0.1)
joints = [_core.Joint(_core.Frame(a=0.3, alpha=1.57 * (i % 2)), spring=_core.Spring(1e4),
                      drive=_core.Drive(1e-3), link=link) for i in range(6)]
robot = _core.Robot(joints)
table = _core.GearTable(np.arange(1.0, 21.0), np.full(20, 1e-3), np.full(20, 1e-3))

def angles():
    _core.gear_output_angle(60.0, table, np.linspace(0.0, 600.0, 30_000_000))

def batch():
    _core.inverse_dynamics(robot, *np.zeros((3, 40_000_000, 6), np.float64), threads=2)

def plan():
    problem = _core.PlanProblem(robot)
    # no motor can follow
    problem.q_desired = np.cumsum(np.random.default_rng(1).normal(size=(25_000, 6)), axis=0)
    options = _core.PlanOptions()
    options.threads, options.iterations = 2, 10_000
    _core.plan_motion(robot, problem, options)

def poses():
    rows = 10_000_000
    _core.inverse_kinematics_path(robot, np.broadcast_to([0.9, 0.4, 0.1], (rows, 3)).copy(),
                                  np.broadcast_to(np.eye(3).ravel(), (rows, 9)).copy(), np.full(6, 0.3))
"""
PATIENCE_S = 20.0  # of a loaded machine; alone it takes 0.05 s
IN_THE_CORE_S = 0.5  # from "started" to a call of the core; one iteration of the plan takes half a minute


@pytest.fixture
def started() -> Iterator[Callable[[str], subprocess.Popen]]:
    """Starts programs, none of which outlives its test."""
    with ExitStack() as children:

        def start(work: str) -> subprocess.Popen:
            text = PREPARE + "print('started', flush=True)\n" + work
            child = children.enter_context(subprocess.Popen(
                [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
            children.callback(child.kill)  # before the wait; nothing where it has ended
            assert child.stdout.readline() == "started\n", child.stderr.read()
            return child

        yield start


@pytest.mark.parametrize("work", ["angles", "plan"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.slow
def test_a_signal_ends_a_long_call_of_the_core(started, work, number):
    handler = "signal.signal(signal.SIGTERM, lambda *_: signal.default_int_handler(2, None))\n"
    child = started(handler + f"while True: {work}()")
    time.sleep(IN_THE_CORE_S)
    child.send_signal(number)
    before = time.monotonic()
    _, words = child.communicate(timeout=PATIENCE_S)
    assert words.rstrip().endswith("KeyboardInterrupt"), words[-2000:]
    assert time.monotonic() - before < PATIENCE_S


@pytest.mark.slow
def test_an_exception_of_a_handler_comes_out_of_the_call_itself(started):
    work = """
def alarm(*_):
    raise TimeoutError("rang")
signal.signal(signal.SIGALRM, alarm)
signal.setitimer(signal.ITIMER_REAL, 0.5)
try:
    while True: angles()
except TimeoutError as error:
    print(error)
"""
    out, words = started(work).communicate(timeout=PATIENCE_S)
    assert (out, words) == ("rang\n", "")


@pytest.mark.slow
def test_the_interpreter_ends_cleanly_while_a_daemon_thread_is_in_the_core(started):
    """pybind11 alone ends with "terminate called without an active exception" here (Python before 3.14)."""
    work = (
        "threading.Thread(target=lambda: [angles() for _ in range(100)], "
        "daemon=True).start()\ntime.sleep(0.5)"
    )
    child = started(work)
    _, words = child.communicate(timeout=PATIENCE_S)
    assert (child.returncode, words) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.01, 0.03, 0.1])
def test_ctrl_c_never_aborts(started, delay):
    """Once in some 25 times the run ended with "Fatal Python error: finalizing, Aborted".

    Signals that come at once can be one to Python, and after one the pool of its library still does what
    it was given (12 s of an idle machine, over 60 s of a busy one). So Ctrl-C is pressed until it has ended.
    """
    work = """
from concurrent.futures import ThreadPoolExecutor
with ThreadPoolExecutor(2) as pool:
    work = lambda _: _core.inverse_dynamics(robot, *np.zeros((3, 20_000, 6)), threads=2)
    list(pool.map(work, range(100_000)))
"""
    child = started(work)
    time.sleep(0.3 + delay)
    for _ in range(3):
        child.send_signal(signal.SIGINT)
        time.sleep(delay)
    until = time.monotonic() + PATIENCE_S
    while child.poll() is None and time.monotonic() < until:
        time.sleep(0.2)
        child.send_signal(signal.SIGINT)
    _, words = child.communicate(timeout=PATIENCE_S)
    assert "Fatal" not in words and child.returncode in (1, 130, -signal.SIGINT), words[-2000:]
