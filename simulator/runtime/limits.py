"""Limits of a process on memory and open files (``ulimit``), looked at before libraries meet them and end it."""

from __future__ import annotations

LEAST_FILES = 64
"""Files that a command has open at once: libraries, the driver, caches, and room."""
LEAST_BYTES, LEAST_DRAWING_BYTES = 640 * 2**20, 1536 * 2**20
"""Address space of a command that reads a scenario, and of one that draws a frame: peaks of VmPeak, and a tenth."""


def limits_problem(*, drawing: bool) -> str | None:
    """Return one sentence if this process's limits are too low for a command, or None.

    Under them numeric libraries and the graphics driver end the process, or wait for ever, instead of raising.

    Parameters
    ----------
    drawing : whether the command draws.
    """
    try:
        import resource  # noqa: PLC0415 - Unix alone has it
    except ImportError:
        return None
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if 0 <= files < LEAST_FILES:
        return f"this shell allows {files} open files, at least {LEAST_FILES} are needed: raise it with ulimit -n 1024"
    least = LEAST_DRAWING_BYTES if drawing else LEAST_BYTES
    size = resource.getrlimit(resource.RLIMIT_AS)[0]
    if 0 <= size < least:
        return (
            f"this shell allows {size / 2**20:.0f} MB of memory, at least {least / 2**20:.0f} are needed: raise it "
            "with ulimit -v unlimited"
        )
    return None
