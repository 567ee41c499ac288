"""Progress of long work: one line that updates itself on a terminal, plain lines now and then in a pipe.

    progress = Progress(sys.stderr)
    progress.stage("fitting candidates", total=120)
    for candidate in candidates:
        progress.step(note=candidate.label)
    progress.close()

The library takes a `Progress` as an argument and never prints; `SILENT` says nothing.
"""

from __future__ import annotations

import shutil
import time
from typing import TextIO

TERMINAL_INTERVAL_S = 0.1
PIPE_INTERVAL_S = 3.0


class Progress:
    """Says what is being done and how far it is, at most every `interval` seconds."""

    def __init__(self, stream: TextIO | None, clock=time.monotonic):
        self._stream, self._clock = stream, clock
        self._terminal = stream is not None and stream.isatty()
        self._interval = TERMINAL_INTERVAL_S if self._terminal else PIPE_INTERVAL_S
        self._part, self._name, self._total, self._done = "", "", None, 0
        self._said_at, self._shown = clock(), False

    def part(self, name: str) -> None:
        """All stages from now on belong to this part of a longer work."""
        self._part = name

    def stage(self, name: str, total: int | None = None) -> None:
        """Begins a piece of work of `total` steps (None: not known)."""
        self._name, self._total, self._done = name, total, 0
        self._say("", at_once=self._terminal)

    def step(self, count: int = 1, note: str = "") -> None:
        """`count` more steps are done; `note` says of what."""
        self._done += count
        self._say(note)

    def close(self) -> None:
        """Clears the line of a terminal."""
        if self._shown and self._terminal and self._stream is not None:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
        self._shown = False

    def _say(self, note: str, at_once: bool = False) -> None:
        now = self._clock()
        if self._stream is None or (now - self._said_at < self._interval and not at_once):
            return
        self._said_at, self._shown = now, True
        line = self._line(note)
        try:
            if self._terminal:
                width = shutil.get_terminal_size().columns - 1
                self._stream.write("\r\x1b[K" + line[:width])
            else:
                self._stream.write(line + "\n")
            self._stream.flush()
        except OSError:  # nobody can read it; the work goes on
            self._stream = None

    def _line(self, note: str) -> str:
        count = ""
        if self._total:
            count = f" {self._done}/{self._total}"
        elif self._done:
            count = f" {self._done}"
        part = f"{self._part}, " if self._part else ""
        return f"{part}{self._name}{count}" + (f": {note}" if note else "")


SILENT = Progress(None)
