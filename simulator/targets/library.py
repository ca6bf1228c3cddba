"""Targets by name: built once by code, kept as target files in the user's cache, always read from there.

What is drawn is therefore what was exported. Meshes that the user added stand beside them, in the data folder.
"""

from __future__ import annotations

import difflib
import functools
import hashlib
import importlib
import logging
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

from simulator.errors import UserError
from simulator.targets.glb import load_glb, write_glb
from simulator.targets.importing.install import user_file, user_targets

if TYPE_CHECKING:
    from simulator.targets.model import Target

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class TargetEntry:
    """A built-in target: its name and the function that builds it, imported only when it must."""

    name: str
    module: str
    function: str


ENTRIES = (
    TargetEntry(name="tango", module="simulator.targets.tango", function="build_tango"),
    TargetEntry(name="tango-mli", module="simulator.targets.tango", function="build_tango_mli"),
)


def list_targets() -> tuple[str, ...]:
    """Names of the built-in targets, then of those the user added."""
    built_in = built_in_targets()
    return (*built_in, *(n for n in user_targets() if n not in built_in))


def built_in_targets() -> tuple[str, ...]:
    """Names of the targets built by code."""
    return tuple(e.name for e in ENTRIES)


def load_target(name_or_path: str | Path) -> Target:
    """A built-in target or one that the user added by name, or a target file (``.glb``).

    Raises
    ------
    UserError
        If the name is unknown or the file is not a target.
    """
    text = str(name_or_path)
    entry = next((e for e in ENTRIES if e.name == text), None)
    if entry is not None:
        return _built_in(entry)
    if text in user_targets():
        return load_glb(user_file(text))
    path = Path(name_or_path)
    if path.suffix.lower() == ".glb" or path.is_file():
        return load_glb(path)
    near = difflib.get_close_matches(text, list_targets(), cutoff=0.4) or list_targets()
    raise UserError(
        f"unknown target {text!r}: name one of {', '.join(near)}, or give the path of a .glb target file"
    )


def cache_folder() -> Path:
    """Where built targets are kept: ``FLYAROUND_CACHE_DIR`` or the user's cache folder."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR")
    return (Path(chosen) if chosen else platformdirs.user_cache_path("flyaround", False)) / "targets"


@functools.cache
def source_key() -> str:
    """Hash of the code that builds targets, so that an edit never meets an old file."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(here.rglob("*.py")):
        digest.update(file.relative_to(here).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _built_in(entry: TargetEntry) -> Target:
    path = cache_folder() / f"{entry.name}-{source_key()}.glb"
    if path.is_file():
        try:
            return load_glb(path)
        except UserError as error:
            # a damaged cache is not the user's mistake: build again
            log.warning("rebuilding %s: %s", entry.name, error)
    target: Target = getattr(importlib.import_module(entry.module), entry.function)()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_glb(target, path)
    except (OSError, UserError) as error:
        raise UserError(
            f"cannot keep target {entry.name} in {path.parent}; set FLYAROUND_CACHE_DIR to a folder you may "
            "write to"
        ) from error
    return load_glb(path)
