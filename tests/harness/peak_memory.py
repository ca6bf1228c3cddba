"""The most memory that a process had at once."""

import resource
from pathlib import Path


def peak_bytes() -> int:
    """Of this process alone: what ``getrusage`` tells begins with its parent's at the fork, whatever was run since."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
