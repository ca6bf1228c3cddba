"""How many threads the libraries under this process use."""

from __future__ import annotations

import os


def use_one_for_matrices() -> None:
    """Have NumPy's and SciPy's library of matrices use one thread, unless the user has chosen.

    The matrices here are small: more threads mostly wait, and spend on that what the driver and the decoders could use;
    each has tens of megabytes of its own. For a program's start, before NumPy is imported: the library looks then.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
