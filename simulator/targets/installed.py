"""The user's own targets: target files in the user's data folder, listed with the built-in ones."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Target

NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,62}")


def user_folder() -> Path:
    """Return the folder of the user's targets: ``FLYAROUND_DATA_DIR`` or the user's data folder."""
    folder = os.environ.get("FLYAROUND_DATA_DIR")
    return (Path(folder) if folder else platformdirs.user_data_path("flyaround", False)) / "targets"


def user_targets() -> tuple[str, ...]:
    """List the user's targets.

    Returns
    -------
    tuple of str
        Names in alphabetical order; empty if the folder does not exist.
    """
    folder = user_folder()
    return tuple(sorted(p.stem for p in folder.glob("*.glb"))) if folder.is_dir() else ()


def user_file(name: str) -> Path:
    """Return the path of the user's target called ``name``, whether it exists or not."""
    return user_folder() / f"{name}.glb"


def network_file(name: str) -> Path:
    """Return the file of the keypoint network trained for a target.

    Returns
    -------
    Path
        Path in the user's folder, whether the file exists or not.
    """
    return user_folder() / f"{name}.keypoints.npz"


def sheet_folder(name: str) -> Path:
    """Return the folder of the contact sheet of the user's target called ``name``.

    Returns
    -------
    Path
        Path in the user's folder, whether the folder exists or not.
    """
    return user_folder() / f"{name}-sheet"


def check_name(name: str, built_in: Sequence[str], *, replace: bool) -> None:
    """Check that a name is valid and not in use.

    Raises
    ------
    UserError
        If it is; the message says which names are allowed.
    """
    if not NAME.fullmatch(name):
        raise UserError(
            f"target name {name!r} cannot be used; name it with --name in small letters, digits, '-', '_' and '.'"
        )
    if name in built_in:
        raise UserError(f"{name!r} is a built-in target; choose another name with --name")
    if user_file(name).exists() and not replace:
        raise UserError(
            f"a target called {name!r} is already in {user_folder()}; add --replace, or choose another name with --name"
        )


def install(target: Target) -> Path:
    """Write the target file into the user's data folder, and read it back as a check.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    UserError
        If the folder cannot be written, or the file does not read back.
    """
    path = user_file(target.name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(
            path.parent, error, "set FLYAROUND_DATA_DIR to a folder you may write to"
        ) from error
    write_glb(target, path)
    load_glb(path)
    return path


def remove(name: str, built_in: Sequence[str]) -> Path:
    """Delete a user's target and the files that belong to it.

    Returns
    -------
    Path
        Former path of the target file.

    Raises
    ------
    UserError
        If the target is built in, does not exist, or cannot be deleted.
    """
    if name in built_in:
        raise UserError(
            f"{name!r} is a built-in target and stays; only targets that were added can be removed"
        )
    path = user_file(name)
    if not NAME.fullmatch(name) or not path.is_file():
        names = ", ".join(user_targets()) or "none"
        raise UserError(f"no target called {name!r} in {user_folder()}; added there: {names}")
    try:
        path.unlink()
        path.with_suffix(".run.toml").unlink(missing_ok=True)
        network_file(name).unlink(missing_ok=True)
        shutil.rmtree(sheet_folder(name), ignore_errors=True)
    except OSError as error:
        raise UserError(f"cannot remove {path}: {error.strerror}; check its permissions") from error
    return path
