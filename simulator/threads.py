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


def share_processors(processes: int) -> None:
    """Have a software driver in this process start its share of threads, unless the user has chosen.

    By default llvmpipe starts one for each processor, in each process: of two that draw at once, four threads get in
    each other's way, which costs up to a third of the frames (docs/validation/scaling.md). With no more than one
    processor to itself a process draws by its own thread alone. For a process's start: the driver looks when its
    context is made.

    Parameters
    ----------
    processes : that draw at once, this one too; of one alone nothing is changed.
    """
    if processes > 1:
        share = usable_processors() // processes
        os.environ.setdefault(
            "LP_NUM_THREADS", str(share if share > 1 or processes < usable_processors() else 0)
        )
