"""Names of the estimation methods for ``--method``, and former names in older files."""

from __future__ import annotations

import logging
from functools import lru_cache

from flyaround.hil.board.errors import BoardModelError

logger = logging.getLogger(__name__)

HYBRID, HYBRID_TRACK = "hybrid", "hybrid-track"

METHODS = (HYBRID, "svd-2018", "svd-thesis", HYBRID_TRACK)

# Methods that need the compiled library.
WITH_LIBRARY = (HYBRID, HYBRID_TRACK)

NETWORK = "net:"

ALL_METHODS = (*METHODS, f"{NETWORK}FILE")
"""All methods, as listed in the help text."""

# Former names. Older releases gave the hybrid method the name of the published algorithm, SVD.
RENAMED = {"svd": HYBRID, "svd-track": HYBRID_TRACK}


def refuse_former_name(method: str) -> None:
    """Raise if ``method`` is a former name.

    Raises
    ------
    BoardModelError
        If it is; the message gives the current names.
    """
    if method in RENAMED:
        raise BoardModelError(
            f"method {method!r} is now called {RENAMED[method]!r}: use that name, or the published algorithm as"
            " 'svd-2018' or 'svd-thesis'"
        )


def name_in_file(method: str, path: object) -> str:
    """Return the current name of a method in a file. Log a warning if the file uses a former one.

    Parameters
    ----------
    method : str
        Name in the file.
    path : path-like
        The file, for the warning.

    Returns
    -------
    str
        Current name; the given one if it was never renamed.
    """
    if method in RENAMED:
        _warn(method, str(path))
    return RENAMED.get(method, method)


@lru_cache(maxsize=256)
def _warn(method: str, path: str) -> None:
    """Log a warning, once per file and name."""
    logger.warning("%s: method %r is read as %r, its current name", path, method, RENAMED[method])
