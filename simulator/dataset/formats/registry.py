"""Registry of data-set formats by name; packages may add their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.dataset.formats.arrays_writer import EXR, NPZ
from flyaround.simulator.dataset.formats.base import DatasetFormat
from flyaround.simulator.dataset.formats.bop import BOP
from flyaround.simulator.dataset.formats.coco import COCO
from flyaround.simulator.dataset.formats.mcap_writer import MCAP
from flyaround.simulator.dataset.formats.parquet import PARQUET
from flyaround.simulator.dataset.formats.spark import SPARK
from flyaround.simulator.dataset.formats.speed_reader import read_shirt
from flyaround.simulator.dataset.formats.speed_writer import SPEED, SPEEDPLUS
from flyaround.simulator.dataset.formats.urso import URSO
from flyaround.simulator.dataset.formats.web_shards import WEBDATASET
from flyaround.simulator.dataset.formats.yolo import YOLO
from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.plugins import Plugin, plugins

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.posed_pictures import PosedPictures

NATIVE = "native"
SHIRT = DatasetFormat(name="shirt", title="SHIRT (Stanford)", read=read_shirt)
BUILT_IN = (SPEED, SPEEDPLUS, SHIRT, URSO, SPARK, BOP, COCO, YOLO, WEBDATASET, PARQUET, MCAP, NPZ, EXR)


def formats() -> dict[str, DatasetFormat]:
    """Return all formats except the native layout, by name."""
    plugin_formats = {name: _load_plugin(plugin) for name, plugin in plugins("format").items()}
    return {**plugin_formats, **{format_.name: format_ for format_ in BUILT_IN}}


def _load_plugin(plugin: Plugin) -> DatasetFormat:
    """Return a format of another package.

    Raises
    ------
    UserError
        If it cannot be imported, or is not a format.
    """
    format_ = plugin.load()
    if not isinstance(format_, DatasetFormat) or format_.name != plugin.name:
        raise plugin.wrong(f"is not a DatasetFormat named {plugin.name}")
    return format_


def readable() -> tuple[str, ...]:
    """Return the names of the formats that can be read.

    Returns
    -------
    tuple of str
        Names with those of packages first and without the native layout, which is read separately.
    """
    return tuple(format_.name for format_ in formats().values() if format_.read is not None)


def writable() -> tuple[str, ...]:
    """Return the names of the formats that can be written.

    Returns
    -------
    tuple of str
        Names with the native layout first, then those of packages, then the built-in ones.
    """
    return (NATIVE, *(format_.name for format_ in formats().values() if format_.writer is not None))


def find_format(name: str) -> DatasetFormat:
    """Return a format by its name.

    Raises
    ------
    UserError
        If there is none.
    """
    all_formats = formats()
    if name not in all_formats:
        near = near_names(name, list(all_formats), 3)
        hint = f"did you mean {' or '.join(near)}?" if near else f"choose from {', '.join(all_formats)}"
        raise UserError(f"unknown data-set format '{name}': {hint}")
    return all_formats[name]


def parse_formats(text: str) -> tuple[str, ...]:
    """Parse a comma-separated list of formats to write.

    Returns
    -------
    tuple of str
        Distinct names in the order of the text, at least one.

    Raises
    ------
    UserError
        If there is none, or one is unknown or only read.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise UserError(f"--format '{text}' names no data-set format; choose from {', '.join(writable())}")
    for name in names:
        if name not in writable():
            if name in readable():
                raise UserError(f"format {name} can only be read; choose from {', '.join(writable())}")
            raise UserError(
                f"unknown data-set format '{name}' in --format; choose from {', '.join(writable())}"
            )
    return names


def check_formats(names: Iterable[str], card: DatasetCard) -> list[str]:
    """Return a sentence for each format that states which labels of a data set it keeps and which it omits.

    Raises
    ------
    UserError
        If a format cannot represent the data set.
    """
    selected = [find_format(name) for name in names if name != NATIVE]
    for format_ in selected:
        format_.check(card)
    return [format_.sentence(card) for format_ in selected]


def read_foreign(place: Path, name: str | None = None) -> tuple[PosedPictures, str]:
    """Read the images with poses of a foreign data set, and return them with the name of its format.

    Parameters
    ----------
    place : Path
        Folder or list of labels.
    name : str, optional
        Name of the format; by default it is detected.

    Returns
    -------
    PosedPictures
        Images with poses.
    str
        Name of the format.

    Raises
    ------
    UserError
        If it is in no readable format, in another one, or has a mistake.
    """
    if not place.exists():
        raise UserError(f"there is no data set {place}; check the path")
    readers = {format_.name: format_.read for format_ in formats().values() if format_.read is not None}
    if name is not None:
        if find_format(name).read is None:
            raise UserError(f"format {name} can only be written; readable are {', '.join(readers)}")
        readers = {name: readers[name]}
    for format_, read in readers.items():
        pictures = read(place)
        if pictures is not None:
            if not pictures.pictures:
                raise UserError(f"{pictures.labels} lists no picture; give another list")
            return pictures, format_
    raise UserError(f"{place} holds no data set in a readable format ({', '.join(readers)})")
