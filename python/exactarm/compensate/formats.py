"""Which dialect a file is of, by the ending of its name; KRL pairs are put together, and RAPID modules of
which one uses data of another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from exactarm.compensate import fanuc_tp, inform, joint_trajectory, krl, rapid, target_table, urscript
from exactarm.compensate.collector import collector_at_rest
from exactarm.compensate.program import Program, SourceText
from exactarm.compensate.rapid_data import linked
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.files.free_memory import GIGABYTE, SHARE, free_bytes
from exactarm.files.memory_table import MemoryTable
from exactarm.robot.controller_frames import FOR_THE_REAL_ARM

BYTES_A_BYTE = 70  # memory of a program; measured of 60,000 targets: 28 (Fanuc TP) to 69 (INFORM)
DIALECTS: tuple[ModuleType, ...] = (krl, rapid, fanuc_tp, urscript, inform, joint_trajectory, target_table)


@dataclass(frozen=True)
class Job:
    """The files of one program, and the module that reads its dialect."""

    dialect: ModuleType
    paths: tuple[Path | MemoryTable, ...]

    @collector_at_rest()
    def read(self, setting: Setting) -> Program:
        load = getattr(self.dialect, "load", SourceText.read)  # tables may be binary
        sources = tuple(load(path) for path in self.paths)
        if self.dialect is not target_table:
            _within_memory(sources)
        for source in sources:
            if (place := source.content.find(FOR_THE_REAL_ARM.encode())) >= 0:
                raise source.refuse(place, f"{FOR_THE_REAL_ARM}: plan has written it; expected a program for "
                                           "the arm as its controller knows it")
        return self.dialect.read(sources, setting)

    @collector_at_rest()
    def reread(self, contents: Sequence[bytes], setting: Setting) -> Program:
        """The program of other contents, as anyone would read it."""
        sources = tuple(SourceText(path, content) for path, content in zip(self.paths, contents))
        return getattr(self.dialect, "read_commands", self.dialect.read)(sources, setting)


def _within_memory(sources: Sequence[SourceText]) -> None:
    free, size = free_bytes(), sum(len(source.content) for source in sources)
    needed = BYTES_A_BYTE * size
    if free is not None and needed > SHARE * free:
        most = SHARE * free / BYTES_A_BYTE
        raise InputError(
            f"a program of {size / 1e6:.3g} MB needs about {needed / GIGABYTE:.3g} GB of memory, "
            f"{free / GIGABYTE:.3g} GB are free; expected at most {most / 1e6:.3g} MB: split it, and give "
            "each part its --start", file=sources[0].path)


def jobs(paths: Sequence[Path | MemoryTable]) -> list[Job]:
    """One for each program or table. Raises InputError for an unknown ending, a name given twice."""
    seen: dict[str, Path | MemoryTable] = {}
    groups: dict[tuple[str, str], list[Any]] = {}
    for path in paths:
        if path.name in seen:
            raise InputError(
                f"the same name as {seen[path.name]}; results have the names of the programs: expected each "
                "once",
                file=path,
            )
        seen[path.name] = path
        dialect = dialect_of(path)
        pair = dialect is krl
        groups.setdefault(
            (dialect.NAME, str(path.with_suffix("")).lower() if pair else str(path)), []
        ).append(path)
    by_name = {dialect.NAME: dialect for dialect in DIALECTS}
    made = [
        Job(by_name[name], tuple(sorted(group, key=lambda path: not path.name.lower().endswith(".src"))))
        for (name, _), group in groups.items()
        if name != rapid.NAME
    ] + _modules([path for (name, _), group in groups.items() if name == rapid.NAME for path in group])
    return sorted(made, key=lambda job: min(map(paths.index, job.paths)))


def _modules(paths: Sequence[Path]) -> list[Job]:
    """RAPID: a job for each group of modules that belong together."""
    if len(paths) == 1:
        return [Job(rapid, tuple(paths))]
    sources = [SourceText.read(path) for path in paths]
    return [Job(rapid, tuple(paths[i] for i in group)) for group in linked(sources)]


def dialect_of(path: Path | MemoryTable) -> ModuleType:
    if isinstance(path, MemoryTable):
        return target_table
    for dialect in DIALECTS:
        if path.suffix.lower() in dialect.SUFFIXES:
            return dialect
    known = ", ".join(f"{suffix} ({dialect.NAME})" for dialect in DIALECTS for suffix in dialect.SUFFIXES)
    raise InputError(f"ending {path.suffix!r} is not known; expected one of {known}", file=path)
