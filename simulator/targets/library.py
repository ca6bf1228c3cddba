"""Targets by name: built by code or shipped, cached as target files, and always read from those files.

What is drawn is therefore what was exported. Each target comes in three levels of detail: ``tango`` is Tango in
full, ``tango@medium`` and ``tango@low`` have fewer triangles and the same labels. The SHA-256 covers the geometry, so
every level has its own; a record keeps name and hash of the level that was drawn, and is replayed with that level.
Meshes that the user added stand beside them, in the data folder, at one level.
"""

from __future__ import annotations

import functools
import importlib
import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.cache import cache_folder, entry_name, read_checked, store_checked
from flyaround.simulator.runtime.plugins import Plugin, plugins
from flyaround.simulator.runtime.prebuilt import prebuilt_bytes
from flyaround.simulator.targets.glb.read import load_glb, target_from
from flyaround.simulator.targets.installed import user_file, user_targets
from flyaround.simulator.targets.level_of_detail import DETAILS, Detail, level_name, split_level

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target

log = logging.getLogger(__name__)
FILE_VERSION = 1  # of what all targets are built with: the builders, and how a target file is written
_MOST_IN_USE = 4  # targets that one process keeps: megabytes each


@dataclass(frozen=True, kw_only=True)
class TargetEntry:
    """A built-in target: its name and the function of a level that builds it, imported only when it must.

    Parameters
    ----------
    version : of that function; raise it when the target that it builds changes in anything, titles included.
    """

    name: str
    module: str
    function: str
    version: int = 1


ENTRIES = (
    TargetEntry(name="tango", module="flyaround.simulator.targets.tango.build", function="build_tango"),
    TargetEntry(
        name="tango-mli", module="flyaround.simulator.targets.tango.build", function="build_tango_mli"
    ),
    TargetEntry(
        name="tango-mockup",
        module="flyaround.simulator.targets.tango.build",
        function="build_tango_mockup",
        version=2,
    ),
    TargetEntry(
        name="dragon", module="flyaround.simulator.targets.craft.dragon.crew", function="build_dragon"
    ),
    TargetEntry(
        name="dragon-cargo",
        module="flyaround.simulator.targets.craft.dragon.cargo",
        function="build_dragon_cargo",
    ),
    TargetEntry(
        name="soyuz-ms", module="flyaround.simulator.targets.craft.soyuz.soyuz_ms", function="build_soyuz_ms"
    ),
    TargetEntry(
        name="tianzhou",
        module="flyaround.simulator.targets.craft.tianzhou.tianzhou",
        function="build_tianzhou",
    ),
    TargetEntry(
        name="tango-thesis",
        module="flyaround.simulator.targets.craft.tango_thesis",
        function="build_tango_thesis",
    ),
    TargetEntry(
        name="change6-ascender",
        module="flyaround.simulator.targets.craft.change6.ascender",
        function="build_change6_ascender",
    ),
    TargetEntry(
        name="cubesat-1u",
        module="flyaround.simulator.targets.craft.cubesat.swisscube",
        function="build_cubesat_1u",
    ),
    TargetEntry(
        name="cubesat-3u",
        module="flyaround.simulator.targets.craft.cubesat.triple",
        function="build_cubesat_3u",
    ),
    TargetEntry(
        name="cubesat-6u", module="flyaround.simulator.targets.craft.cubesat.six", function="build_cubesat_6u"
    ),
    TargetEntry(name="envisat", module="flyaround.simulator.targets.craft.envisat", function="build_envisat"),
    TargetEntry(
        name="calibration-board",
        module="flyaround.simulator.targets.craft.charuco",
        function="build_calibration_board",
    ),
    TargetEntry(
        name="chessboard", module="flyaround.simulator.targets.craft.chessboard", function="build_chessboard"
    ),
)


def list_targets() -> tuple[str, ...]:
    """Names of the built-in targets, then of those the user added, then of those that other packages add."""
    built_in = built_in_targets()
    users = [n for n in user_targets() if n not in built_in]
    return (*built_in, *users, *(n for n in plugins("target") if n not in {*built_in, *users}))


def built_in_targets() -> tuple[str, ...]:
    """Names of the targets built by code."""
    return tuple(e.name for e in ENTRIES)


def load_target(name_or_path: str | Path, detail: Detail = "full") -> Target:
    """A built-in target or one that the user added by name, or a target file (``.glb``).

    Parameters
    ----------
    name_or_path : a name of `list_targets`, alone or with a level (``tango@low``), or the path of a file.
    detail : level of a built-in target whose name gives none; a file has one level only and ignores it.

    Raises
    ------
    UserError
        If the name is unknown or the file is not a target.
    """
    text = str(name_or_path)
    name, level = split_level(text)
    entry = next((e for e in ENTRIES if e.name == name), None)
    if entry is not None:
        return _built_in(entry, detail if name == text else level)
    if text in user_targets():
        return load_glb(user_file(text))
    if text in plugins("target"):
        return _added(plugins("target")[text])
    path = Path(name_or_path)
    if path.suffix.lower() == ".glb" or path.is_file():
        return load_glb(path)
    near = near_names(name, list_targets(), 3) or list_targets()
    raise UserError(
        f"unknown target {text!r}: name one of {', '.join(near)}, or another that "
        "`flyaround targets` lists (with @medium or @low for fewer triangles), or give the path of a .glb target file"
    )


def _added(plugin: Plugin) -> Target:
    """A target of another package: a function that builds it, or the path of a target file.

    Raises
    ------
    UserError
        If it cannot be imported, fails, or is none.
    """
    given = plugin.load()
    if isinstance(given, str | Path):
        built = load_glb(Path(given))
    else:
        try:
            built = given()
        except UserError:
            raise
        except Exception as error:
            raise plugin.wrong(f"cannot be built ({type(error).__name__}: {error})") from error
    if getattr(built, "name", None) != plugin.name:
        raise plugin.wrong(f"is no Target called {plugin.name}")
    return built


@functools.lru_cache(maxsize=_MOST_IN_USE)
def target_in_use(name: str, sha256: str) -> Target:
    """`load_target`, the same object again for the same craft: what is worked out of its mesh is kept with it.

    For processes that are told a target's name with each frame. A mesh that the user imports anew has another hash and
    is read anew.

    Parameters
    ----------
    sha256 : of the target that is meant.

    Raises
    ------
    UserError
        As `load_target`, and where what has the name now is another target; it is looked for again the next time.
    """
    target = load_target(name)
    if target.sha256 != sha256:
        raise UserError(
            f"target {name} has changed ({target.sha256[:12]}) since the scene was made ({sha256[:12]}); "
            "plan it anew, or import the former mesh again"
        )
    return target


def cache_name(name: str, detail: Detail = "full") -> str:
    """File name of a built-in target in the cache, and where it is shipped."""
    entry = next(e for e in ENTRIES if e.name == name)
    return _cache_name(entry, detail)


def _cache_name(entry: TargetEntry, detail: Detail) -> str:
    return f"{entry_name(level_name(entry.name, detail), entry.version, FILE_VERSION)}.glb"


def _built_in(entry: TargetEntry, detail: Detail) -> Target:
    if detail not in DETAILS:
        raise UserError(f"target {entry.name} has no level {detail!r}: choose from {', '.join(DETAILS)}")
    name = level_name(entry.name, detail)
    path = cache_folder("targets") / _cache_name(entry, detail)
    if (target := _sound(read_checked(path), name, path)) is not None:
        return target
    data = prebuilt_bytes(path.name)
    target = _sound(data, name, path)
    if target is None or data is None:
        data = _built(entry, detail, name)
        target = target_from(data, path)
    # where it cannot be kept it is made at every start
    store_checked(path, lambda file: file.write(data))
    return target


def _sound(data: bytes | None, name: str, path: Path) -> Target | None:
    """The target of a file that was found sound when it was made; ``None`` where there is no such file now."""
    if data is None:
        return None
    try:
        return target_from(data, path, checked=True)
    except UserError as error:
        # a damaged cache is not the user's mistake: build again
        log.warning("rebuilding %s: %s", name, error)
        return None


def _built(entry: TargetEntry, detail: Detail, name: str) -> bytes:
    """The target file of a target that is built now."""
    from flyaround.simulator.targets.glb.write import glb_bytes  # noqa: PLC0415 - slow to import, needed here alone

    built: Target = getattr(importlib.import_module(entry.module), entry.function)(detail)
    # the hash does not cover the name: builders need not know how levels are called
    return glb_bytes(replace(built, name=name))
