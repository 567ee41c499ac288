"""Progress of long work: a bar with count and time left on a terminal, plain lines now and then in a pipe.

    progress = Progress(sys.stderr)
    progress.stage("fitting candidates", total=120)
    for candidate in candidates:
        progress.step(note=candidate.label)
    progress.close()

The library takes a `Progress` as an argument and never prints; `SILENT` says nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

PIPE_INTERVAL_S = 3.0


class Progress:
    """Says what is being done and how far it is; in a pipe at most every few seconds."""

    def __init__(self, stream: TextIO | None, clock: Callable[[], float] = time.monotonic):
        self._stream, self._clock = stream, clock
        self._terminal = stream is not None and stream.isatty()
        self._part, self._name, self._done = "", "", 0
        self._total: int | None = None
        self._said_at: float | None = None  # the first stage begins to count: what came before was no work
        self._bar: Bar | None = None

    def part(self, name: str) -> None:
        """All stages from now on belong to this part of a longer work."""
        self._part = name

    def stage(self, name: str, total: int | None = None) -> None:
        """Begins a piece of work of `total` steps (None: not known)."""
        self._name, self._total, self._done = name, total, 0
        if self._terminal:
            self._show("", new=True)
        else:
            self._say("")

    def step(self, count: int = 1, note: str = "") -> None:
        """`count` more steps are done; `note` says of what."""
        self._done += count
        if self._terminal:
            self._show(note)
        else:
            self._say(note)

    def close(self) -> None:
        """Clears what a terminal shows."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _show(self, note: str, new: bool = False) -> None:
        """On a terminal: one line that moves by itself."""
        try:
            if self._bar is None:
                self._bar = _bar(self._stream)
            if new or not self._bar.tasks:
                for task in self._bar.task_ids:
                    self._bar.remove_task(task)
                self._bar.add_task("", total=self._total)
            text = (f"{self._part}, " if self._part else "") + self._name + (f": {note}" if note else "")
            self._bar.update(self._bar.task_ids[0], description=text, completed=self._done, refresh=True)
        except OSError:  # nobody can read it; the work goes on
            self._terminal, self._stream = False, None

    def _say(self, note: str) -> None:
        """In a pipe: a line now and then."""
        now = self._clock()
        self._said_at = now if self._said_at is None else self._said_at
        if self._stream is None or now - self._said_at < PIPE_INTERVAL_S:
            return
        self._said_at = now
        try:
            self._stream.write(self._line(note) + "\n")
            self._stream.flush()
        except OSError:
            self._stream = None

    def _line(self, note: str) -> str:
        count = f" {self._done}/{self._total}" if self._total else f" {self._done}" if self._done else ""
        part = f"{self._part}, " if self._part else ""
        return f"{part}{self._name}{count}" + (f": {note}" if note else "")


def _bar(stream: TextIO | None) -> Bar:
    """A bar that clears itself: what, bar, count, time since and time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as RichProgress

    bar = RichProgress(
        SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(), TimeRemainingColumn(), console=Console(file=stream, force_terminal=True),
        transient=True,
        redirect_stdout=False, redirect_stderr=False,
    )
    bar.start()
    return bar


SILENT = Progress(None)
