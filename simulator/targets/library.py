"""Targets by name (built-in, the user's, or from other packages), and target files.

The built-in targets are the files of ``assets/targets``, made by `tools.craft`, each in three levels of detail:
``tango`` is Tango in full, ``tango@medium`` and ``tango@low`` have fewer triangles and the same labels. The SHA-256
covers the geometry, so every level has its own; a record stores name and hash of the drawn level. Meshes that the user
added are in the data folder, at one level.
"""

from __future__ import annotations

import functools
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import zstandard

from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.plugins import Plugin, plugins
from flyaround.simulator.targets.glb.read import load_glb, target_from
from flyaround.simulator.targets.installed import user_file, user_targets
from flyaround.simulator.targets.model import DETAILS, Detail, level_name, split_level

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target

SUFFIX = ".glb.zst"
"""Suffix of the built-in targets' files, which are compressed (51 MB otherwise)."""
_CACHE_SIZE = 4  # targets cached per process, megabytes each


def list_targets() -> tuple[str, ...]:
    """Return the names of all targets: built-in, the user's, then those of other packages.

    Returns
    -------
    tuple of str
        Names that `load_target` accepts.
    """
    built_in = built_in_targets()
    users = [n for n in user_targets() if n not in built_in]
    return (*built_in, *users, *(n for n in plugins("target") if n not in {*built_in, *users}))


@functools.cache
def built_in_targets() -> tuple[str, ...]:
    """List the built-in targets.

    Returns
    -------
    tuple of str
        Names without levels, in alphabetical order.
    """
    files = (path.name for path in resources.files("flyaround.assets").joinpath("targets").iterdir())
    names = (file.removesuffix(SUFFIX) for file in files if file.endswith(SUFFIX))
    return tuple(sorted({split_level(name)[0] for name in names}))


def load_target(name_or_path: str | Path, detail: Detail = "full") -> Target:
    """Load a target by name, or from a target file (``.glb``).

    Parameters
    ----------
    name_or_path : str or Path
        Name from `list_targets`, optionally with a level (``tango@low``), or path of a target file.
    detail : Detail, optional
        Level of a built-in target whose name states none; files have one level only.

    Returns
    -------
    Target
        Checked target.

    Raises
    ------
    UserError
        If the name is unknown or the file is not a target.
    """
    text = str(name_or_path)
    name, name_detail = split_level(text)
    if name in built_in_targets():
        return _built_in(name, detail if name == text else name_detail)
    if text in user_targets():
        return load_glb(user_file(text))
    if text in plugins("target"):
        return _load_plugin(plugins("target")[text])
    path = Path(name_or_path)
    if path.suffix.lower() == ".glb" or path.is_file():
        return load_glb(path)
    suggestions = near_names(name, list_targets(), 3) or list_targets()
    raise UserError(
        f"unknown target {text!r}: name one of {', '.join(suggestions)}, or another that "
        "`flyaround targets` lists (with @medium or @low for fewer triangles), or give the path of a .glb target file"
    )


def _load_plugin(plugin: Plugin) -> Target:
    """Return a target of another package: from its function, or its target file.

    Raises
    ------
    UserError
        If it cannot be imported, fails, or is not a target.
    """
    source = plugin.load()
    if isinstance(source, str | Path):
        target = load_glb(Path(source))
    else:
        try:
            target = source()
        except UserError:
            raise
        except Exception as error:
            raise plugin.wrong(f"cannot be built ({type(error).__name__}: {error})") from error
    if getattr(target, "name", None) != plugin.name:
        raise plugin.wrong(f"is not a Target named {plugin.name}")
    return target


@functools.lru_cache(maxsize=_CACHE_SIZE)
def target_in_use(name: str, sha256: str) -> Target:
    """Load a target as `load_target` does, and cache it together with data derived from its mesh.

    It is meant for processes that receive a target's name with each frame. If the user imports a mesh again, its hash
    changes and it is loaded again.

    Parameters
    ----------
    name : str
        Name of the target.
    sha256 : str
        Hash of the expected target.

    Raises
    ------
    UserError
        As in `load_target`, and if the name now refers to another target; the next call tries again.
    """
    target = load_target(name)
    if target.sha256 != sha256:
        raise UserError(
            f"target {name} has changed ({target.sha256[:12]}) since the scene was made ({sha256[:12]}); "
            "plan it anew, or import the former mesh again"
        )
    return target


def _built_in(name: str, detail: Detail) -> Target:
    if detail not in DETAILS:
        raise UserError(f"target {name} has no level {detail!r}: choose from {', '.join(DETAILS)}")
    file = resources.files("flyaround.assets").joinpath("targets", level_name(name, detail) + SUFFIX)
    try:
        data = zstandard.decompress(file.read_bytes())
    except (OSError, zstandard.ZstdError, MemoryError) as error:
        raise UserError(f"{file} cannot be read ({error}): install Flyaround again") from error
    return target_from(data, Path(str(file)), checked=True)
