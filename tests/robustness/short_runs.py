"""One short run of every command, for the sanitizers and the kills: words of the command line, where the name
of a sample (samples.py) or of a file made here stands for that file."""

from __future__ import annotations

import os
from pathlib import Path

from robustness.samples import samples

RUNS: dict[str, tuple[str, ...]] = {
    "accept": ("draft.toml",),
    "batch": ("manifest.csv", "--again"),
    "calibrate": ("ur10", "poses.csv"),
    "certify": ("ur10", "poses.csv"),
    "check": ("ur10", "poses.csv", "day.csv"),
    "compensate": ("ur10", "part.script", "--points", "calculated",
                   "--keep-refused"),
    "corners": ("ur10", "joints.csv", "board.png", "--fixture", "board.toml"),
    "demo": ("--steps", "racer_plan"),
    "design": ("racer-7-1.4", "--count", "20", "--validation", "4"),
    "diagnose": ("ur10", "poses.csv"),
    "evaluate": ("ur10", "poses.csv"),
    "export": ("ur10", "--format", "urdf"),
    "gear": ("kr300", "runs.csv", "--kind", "gear_run"),
    "identifiable": ("ur10.toml", "poses.csv"),
    "identify": ("tx40", "motion.csv"),
    "loop": ("racer-7-1.4", "--path", "path.toml", "--count", "40",
             "--effect", "gear_ratio joint=2 scale=3e-4"),
    "merge": ("ur10", "log.csv", "points.txt", "--unit", "mm"),
    "plan": ("racer-7-1.4", "path.toml"),
    "simulate": ("racer-7-1.4", "--measure", "motion", "--runs", "1", "--seconds", "2"),
    "study": ("racer-7-1.4", "path.toml", "--nu", "1e-12,1e-9"),
}

# As on a machine without wide registers and fused multiplications, for OpenBLAS, NumPy and the C library.
OTHER_PROCESSOR = {
    "OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX512F,-AVX512VL,-FMA",
}


def prepare(folder: Path) -> None:
    """Writes all files that the runs read."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in samples().items():
        (folder / name).write_bytes(content)


def words_of(command: str, folder: Path, out: Path) -> list[str]:
    """The arguments of `exactarm` for the short run of `command` into `out`."""
    given = [str(folder / word) if (folder / word).is_file() else word for word in RUNS[command]]
    return [command, *given, "--out", str(out), "--threads", "1", "--quiet"]


def environment(package: Path, folder: Path) -> dict[str, str]:
    """Variables of a run with the package in `package`, that touches nothing outside of `folder`."""
    return os.environ | {
        "PYTHONPATH": str(package), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
        "EXACTARM_EFFECTS": str(folder / "effects"), "MPLCONFIGDIR": str(folder / "matplotlib"),
    }
