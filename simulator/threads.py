"""How many threads the libraries under this process use, and how many work beside it."""

from __future__ import annotations

import os


def use_one_for_matrices() -> None:
    """Have NumPy's and SciPy's library of matrices use one thread, unless the user has chosen.

    The matrices here are small: more threads mostly wait, and spend on that what the driver and the decoders could use;
    each has tens of megabytes of its own. For a program's start, before NumPy is imported: the library looks then.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def usable_processors() -> int:
    """Those that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def beside_the_caller() -> int:
    """Threads that keep the processors busy which a caller that goes on working leaves free; at least one."""
    return max(usable_processors() - 1, 1)
