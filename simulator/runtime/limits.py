"""Limits of a process on memory and open files (``ulimit``), checked before libraries fail on them."""

from __future__ import annotations

MIN_FILES = 64
"""Files that a command has open at once: libraries, driver, caches, and a reserve."""

MIN_BYTES, MIN_DRAWING_BYTES = 640 * 2**20, 1536 * 2**20
"""Address space of a command that reads a scenario, and of one that draws a frame: above the VmPeak of ``scenarios``
and of ``render`` with Mesa's software driver."""


def limits_problem(*, drawing: bool) -> str | None:
    """Return one sentence if this process's limits are too low for a command, or None.

    Beyond them numerical libraries and graphics drivers end the process, or hang, instead of raising.

    Parameters
    ----------
    drawing : bool
        True if the command draws.

    Returns
    -------
    str or None
        Sentence with the limit and what is needed.
    """
    try:
        import resource  # noqa: PLC0415 - Unix only
    except ImportError:
        return None
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if 0 <= files < MIN_FILES:
        return f"this shell allows {files} open files, at least {MIN_FILES} are needed: raise it with ulimit -n 1024"
    least = MIN_DRAWING_BYTES if drawing else MIN_BYTES
    size = resource.getrlimit(resource.RLIMIT_AS)[0]
    if 0 <= size < least:
        return (
            f"this shell allows {size / 2**20:.0f} MiB of memory, at least {least / 2**20:.0f} are needed: raise it "
            "with ulimit -v unlimited"
        )
    return None
