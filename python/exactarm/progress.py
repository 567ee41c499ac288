"""Progress of long work: which step of how many, a bar, and time left on a terminal; plain lines in a pipe.

    progress = Progress(sys.stderr)
    progress.plan({"reading": 0.1, "fitting": 0.9})  # the steps in order, with the share of the time of each
    progress.stage("fitting", total=120)             # "step 2 of 2: fitting"
    for candidate in candidates:
        progress.step(note=candidate.label)
    progress.close()

A stage that is not in the plan is a detail of the step that is under way. Steps may be left out. In a pipe
there is a line every few seconds, so that short work says nothing; each step of a long plan has its own.
Time left is the time since the plan began, by the share that is done: a rough figure, told as such.
The library takes a `Progress` as an argument and never prints; `SILENT` says nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

PIPE_INTERVAL_S = 3.0
LEAST_SHARE = 0.05  # of the work, done before the time left is told: below, it is off by several times
LEAST_ELAPSED_S = 2.0  # shorter work is over before one has read how long it takes


class Progress:
    """Says what is being done and how far it is."""

    def __init__(self, stream: TextIO | None, clock: Callable[[], float] = time.monotonic):
        self._stream, self._clock = stream, clock
        self._terminal = stream is not None and stream.isatty()
        self._part, self._name, self._detail, self._done = "", "", "", 0
        self._total: int | None = None
        self._said_at: float | None = None  # the first stage begins to count: what came before was no work
        self._bar: Bar | None = None
        self._steps: dict[str, float] = {}
        self._last: tuple[str, ...] = ()
        self._number, self._began, self._long = 0, 0.0, False

    def __repr__(self) -> str:
        return "<Progress: silent>" if self._stream is None else "<Progress>"

    def part(self, name: str) -> None:
        """All stages from now on belong to this part of a longer work; a line of its own in a pipe."""
        self._part, self._steps, self._number = name, {}, 0
        if name and not self._terminal:
            self._say_line(name)

    def ends_with(self, *names: str) -> None:
        """Steps that follow on every plan, as what writes the results."""
        self._last = names

    def plan(self, steps: Mapping[str, float] | Iterable[str], long: bool = False) -> None:
        """The steps of the work in their order; a mapping also says what share of the time each takes. long:
        minutes, so that a pipe hears of every step."""
        shares = dict(steps) if isinstance(steps, Mapping) else dict.fromkeys(steps, 1.0)
        whole = sum(shares.values()) or 1.0
        self._steps = {name: share / whole for name, share in shares.items()}
        self._steps |= {name: _LAST_SHARE for name in self._last if name not in self._steps}
        self._number, self._name, self._began, self._long = 0, "", self._clock(), long

    def stage(self, name: str, total: int | None = None) -> None:
        """Begins a step of the plan, of `total` counts (None: not known), or says a detail of the one under
        way."""
        planned = list(self._steps)
        if name in self._steps or not planned:
            self._number = planned.index(name) + 1 if planned else 0
            self._name, self._detail, self._total, self._done = name, "", total, 0
        else:
            self._detail, self._total, self._done = name, total, 0
        begins = bool(planned) and not self._detail
        if self._terminal:
            self._show("", new=True)
        elif begins and self._long and not self._part:
            self._say_line(self._line(""))
        else:
            self._say("")

    def step(self, count: int = 1, note: str = "") -> None:
        """`count` more are done; `note` says of what."""
        self._done += count
        if self._terminal:
            self._show(note)
        else:
            self._say(note)

    def announce(self, line: str) -> None:
        """A line that stays, as of what long work will take."""
        if not self._terminal:
            self._say_line(line)
            return
        self._show("")
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False)

    def close(self) -> None:
        """Clears what a terminal shows."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    @property
    def share(self) -> float:
        """Of the plan that is done."""
        if not self._number:
            return 0.0
        steps = list(self._steps.values())
        inside = min(self._done / self._total, 1.0) if self._total and not self._detail else 0.0
        return (sum(steps[: self._number - 1]) + inside * steps[self._number - 1]) / sum(steps)

    @property
    def seconds_left(self) -> float | None:
        """By what has passed; None where that says nothing yet."""
        passed = self._clock() - self._began
        if self.share < LEAST_SHARE or passed < LEAST_ELAPSED_S:
            return None
        return passed * (1.0 - self.share) / self.share

    def _show(self, note: str, new: bool = False) -> None:
        """On a terminal: one line that moves by itself."""
        try:
            if self._bar is None:
                self._bar = _bar(self._stream)
            counted = self._total is not None or not self._steps
            done, total = (self._done, self._total) if counted else (self._number - 1, len(self._steps))
            if new or not self._bar.tasks:
                for task in self._bar.task_ids:
                    self._bar.remove_task(task)
                self._bar.add_task("", total=total, until=None)
            left = self.seconds_left if self._steps else None
            until = None if left is None else self._bar.get_time() + left
            self._bar.update(self._bar.task_ids[0], description=self._title() + (f": {note}" if note else ""),
                             completed=done, until=until, refresh=True)
        except OSError:  # nobody can read it; the work goes on
            self._terminal, self._stream = False, None

    def _say(self, note: str) -> None:
        """In a pipe: a line now and then."""
        now = self._clock()
        self._said_at = now if self._said_at is None else self._said_at
        if self._stream is None or now - self._said_at < PIPE_INTERVAL_S:
            return
        self._said_at = now
        self._say_line(self._line(note))

    def _say_line(self, line: str) -> None:
        if self._stream is None:
            return
        try:
            self._stream.write(line + "\n")
            self._stream.flush()
        except OSError:
            self._stream = None

    def _title(self) -> str:
        """What is being done, without counts."""
        word = "part" if self._part else "step"
        which = f"{word} {self._number} of {len(self._steps)}: " if self._number else ""
        return ", ".join(word for word in (self._part, which + self._name, self._detail) if word)

    def _line(self, note: str) -> str:
        count = (f" {self._done}/{self._total}" if self._total else f" {self._done}") if self._done else ""
        return self._title() + count + (f": {note}" if note else "")


_LAST_SHARE = 0.1  # of the rest: pages and plots take 1 to 2 s, most commands ten times that
SILENT = Progress(None)


def _bar(stream: TextIO | None) -> Bar:
    """A bar that clears itself: what, bar, count, time since and time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        ProgressColumn,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.progress import Progress as RichProgress
    from rich.table import Column
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        """Falls between two updates; nothing once it has run out."""

        def render(self, task: Task) -> Text:
            until = task.fields.get("until")
            left = 0.0 if until is None else until - bar.get_time()
            return Text(f"about {_minutes(left)} left" if left > 0.0 else "")

    bar = RichProgress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False, table_column=Column(ratio=1, no_wrap=True)),
        BarColumn(bar_width=10), MofNCompleteColumn(), TimeElapsedColumn(), TimeLeft(),
        console=Console(file=stream, force_terminal=True), transient=True, expand=True,
        redirect_stdout=False, redirect_stderr=False,
    )
    bar.start()
    return bar


def _minutes(seconds: float) -> str:
    """As 0:40 or 2:05."""
    whole = int(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
