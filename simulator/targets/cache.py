"""Where what is computed once of a target is kept."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """``targets`` in ``FLYAROUND_CACHE_DIR`` or in the user's cache folder."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR")
    return (Path(chosen) if chosen else platformdirs.user_cache_path("flyaround", False)) / "targets"
