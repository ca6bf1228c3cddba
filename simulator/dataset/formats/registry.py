"""The formats of data sets: which there are, and what each reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from simulator.dataset.formats.speed_reader import read_shirt, read_speed, read_speedplus
from simulator.errors import UserError, near_names

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from simulator.dataset.formats.posed_pictures import PosedPictures


@dataclass(frozen=True, kw_only=True)
class DatasetFormat:
    """One format.

    Parameters
    ----------
    name : on the command line. title : what it is.
    read : the pictures with poses of a folder or a list; None of a folder of another kind.
    """

    name: str
    title: str
    read: Callable[[Path], PosedPictures | None] | None = None


_BUILT_IN = (
    DatasetFormat(name="speed", title="SPEED (Stanford, ESA)", read=read_speed),
    DatasetFormat(name="speedplus", title="SPEED+ (Stanford, ESA)", read=read_speedplus),
    DatasetFormat(name="shirt", title="SHIRT (Stanford)", read=read_shirt),
)


def formats() -> dict[str, DatasetFormat]:
    """All formats by name."""
    return {form.name: form for form in _BUILT_IN}


def find_format(name: str) -> DatasetFormat:
    """A format by its name.

    Raises
    ------
    UserError
        If there is none.
    """
    known = formats()
    if name not in known:
        near = near_names(name, list(known), 3)
        meant = f"did you mean {' or '.join(near)}?" if near else f"choose from {', '.join(known)}"
        raise UserError(f"there is no data-set format '{name}': {meant}")
    return known[name]


def read_foreign(place: Path, name: str | None = None) -> tuple[PosedPictures, str]:
    """The pictures with poses of somebody else's data set, and the name of its format.

    Parameters
    ----------
    place : the folder or the list of labels. name : of the format; found out unless given.

    Raises
    ------
    UserError
        If it is of no format that is read, of another, or has a mistake.
    """
    if not place.exists():
        raise UserError(f"there is no data set {place}; check the path")
    readers = {form.name: form.read for form in formats().values() if form.read is not None}
    if name is not None:
        if find_format(name).read is None:
            raise UserError(f"format {name} is written, not read; read are {', '.join(readers)}")
        readers = {name: readers[name]}
    for form, read in readers.items():
        found = read(place)
        if found is not None:
            if not found.pictures:
                raise UserError(f"{found.labels} lists no picture; give a list with some")
            return found, form
    raise UserError(f"{place} holds no data set of a format that is read here ({', '.join(readers)})")
