"""What memory a process can still have: of the machine, of its control group, of its own limit."""

from pathlib import Path

GIGABYTE = 2.0**30
SHARE = 0.9  # of what is free that one command, or one file, may take
MEMINFO, GROUP, STATM = Path("/proc/meminfo"), Path("/sys/fs/cgroup"), Path("/proc/self/statm")


def free_bytes() -> float | None:
    """What a process can still have: of the machine, of its control group, of its own limit; None where the
    system says nothing."""
    told = [each for each in (_of_machine(), _of_group(), _of_process()) if each is not None]
    return max(min(told), 0.0) if told else None


def _of_machine() -> float | None:
    try:
        lines = MEMINFO.read_text(encoding="ascii").splitlines()
        return 1024.0 * int(next(line.split()[1] for line in lines if line.startswith("MemAvailable:")))
    except (OSError, StopIteration, ValueError, IndexError):
        return None


def _of_group() -> float | None:
    """Of a container (Linux control groups, version 2); the word max stands for no limit."""
    try:
        most, used = (int((GROUP / name).read_text(encoding="ascii"))
                      for name in ("memory.max", "memory.current"))
    except (OSError, ValueError):
        return None
    return float(most - used)


def _of_process() -> float | None:
    """Of its address space, as `ulimit -v` bounds it."""
    try:
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        pages = int(STATM.read_text(encoding="ascii").split()[0])
    except (ImportError, OSError, ValueError, IndexError):
        return None
    return None if most == resource.RLIM_INFINITY else float(most - pages * resource.getpagesize())
