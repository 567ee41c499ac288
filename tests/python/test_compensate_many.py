"""Programs of very many lines: nothing takes a time, or a picture, that grows as their square."""

import io
import time
from functools import partial

import numpy as np
import pytest

import exactarm as ea
from exactarm.compensate import formats
from exactarm.compensate.ways import Step, walk
from exactarm.errors import InputError
from exactarm.report.plots.compensation import MOST_DRAWN, shift_per_target, shift_view
from exactarm.report.plots.style import on_one_panel


def vector_picture(figure) -> str:
    written = io.StringIO()
    figure.savefig(written, format="svg")
    return written.getvalue()


def test_a_picture_of_many_targets_shows_some_of_them_and_the_largest_correction():
    """Of all, it took longer than their correction: an element of the file for every arrow."""
    random = np.random.default_rng(0)
    points, shifts = random.normal(size=(50_001, 3)), 1e-4 * random.normal(size=(50_001, 3))
    shifts[33_333] = [0.0, 0.003, 0.0]  # none of those that are drawn anyway
    figure = shift_view(points, shifts)
    quiver = figure.axes[0].collections[0]
    assert quiver.N <= MOST_DRAWN + 1
    assert np.hypot(quiver.U, quiver.V).max() > 5.0 * np.median(np.hypot(quiver.U, quiver.V))
    picture = vector_picture(figure)
    assert "one in 51 drawn" in picture and len(picture) < 2e6
    sizes = np.linalg.norm(shifts, axis=1)
    sizes[::5] = np.nan
    drawn, left = on_one_panel(partial(shift_per_target, sizes)).axes[0].lines[:2]
    assert len(drawn.get_xdata()) <= 2 * MOST_DRAWN and len(left.get_xdata()) <= MOST_DRAWN
    assert 33_334 in drawn.get_xdata()


def test_a_picture_of_few_targets_shows_all_of_them():
    figure = shift_view(np.eye(3), 1e-3 * np.eye(3))
    assert figure.axes[0].collections[0].N == 3 and "drawn" not in vector_picture(figure)


@pytest.mark.slow
def test_ways_through_many_loops_and_routines_are_found_in_a_time_that_grows_with_them():
    """2,000 of both took 9 s, and 1,000 2.2 s, when each looked at all statements; 20,000 would have taken a
    quarter of an hour. 10 s is more than ten times what they take now."""
    steps = []
    for k in range(20_000):
        steps += [Step(10 * k, "routine", f"R{k}"), Step(10 * k + 1, "set", ("tool", k)),
                  Step(10 * k + 2, "loop"), Step(10 * k + 3, "move", k), Step(10 * k + 4, "close"),
                  Step(10 * k + 5, "call", f"R{max(k - 1, 0)}"), Step(10 * k + 6, "end")]
    begun = time.process_time()
    found = list(walk(steps, {"tool": None}))
    assert time.process_time() - begun < 10.0
    assert [(data, state["tool"]) for data, state in found[:2]] == [(0, 0), (1, 1)] and len(found) == 20_000


def test_a_program_that_needs_more_memory_than_is_free_is_refused_in_one_line(tmp_path, monkeypatch):
    path = tmp_path / "part.script"
    path.write_text("def part():\n" + "  movej([0.1, -1.2, 1.3, -0.4, 1.5, 0.2])\n" * 1000 + "end\n")
    monkeypatch.setattr(formats, "free_bytes", lambda: 2e6)
    with pytest.raises(InputError, match=r"part.script: a program of 0.042 MB needs about .* GB of memory, "
                                         r".* expected at most 0.0257 MB: split it"):
        ea.compensate("ur10", path, points="calculated")
    monkeypatch.setattr(formats, "free_bytes", lambda: 4e6)
    assert ea.compensate("ur10", path, points="calculated").contents["part.script"] != path.read_bytes()
