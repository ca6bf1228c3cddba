"""Contents of an exported file, entry by entry, for comparison with an independently written one."""

from __future__ import annotations

import codecs
import io
import json
import math
import re
import tarfile
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import OpenEXR

from flyaround.simulator.dataset.formats.base import import_needed
from flyaround.simulator.dataset.formats.exr import MAX_SIDE_PX
from flyaround.simulator.dataset.formats.native import decode_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.mcap_messages import mcap_messages
from flyaround.simulator.runtime.untrusted_files import refuse_deep, whole_number
from flyaround.simulator.targets.textures import picture_size

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

JPEG_MAX_DN, JPEG_RMS_DN = 8.0, 1.5
"""Bounds on the difference between two decoders of the same JPEG image [DN]."""

RELATIVE, ABSOLUTE = 1e-9, 1e-9
"""Tolerances of numbers computed with other versions of the libraries."""

# Maximum unpacked size of an archive [bytes].
MAX_ARRAYS_BYTES = 2**32
# Maximum unpacked size of a Parquet shard [bytes]; `Shards` gathers 128 MB, or a single larger frame.
MAX_SHARD_BYTES = 2**30
_NUMBER_BYTES, _MAX_SHIFT = 8, 63  # of the largest number in a column, and in a page's header
_TOO_LARGE = "it is larger than any camera's picture"
_PNG = b"\x89PNG\r\n\x1a\n"
_ENDS = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9", ".csv": b"\n", ".txt": b"\n"}
LONGEST_END = 8  # bytes at a file's end that show whether it is complete


@dataclass(frozen=True)
class Entry:
    """One value in a file.

    Parameters
    ----------
    key : str
        Unique in the file, or in the shards of a split.
    value : object
        The value.
    frame : int, optional
        Number of the frame, if the entry belongs to one.
    """

    key: str
    value: Any
    frame: int | None = None


@dataclass(frozen=True, eq=False)
class JpegPixels:
    """Decoded pixels of a lossy image."""

    pixels: NDArray[Any]


def entries(name: str, data: bytes) -> Iterator[Entry]:
    """Yield the contents of a file; a file of unknown type is a single entry, its bytes.

    Raises
    ------
    UserError
        If the file is damaged.
    """
    suffix = Path(name).suffix
    if is_truncated(name, data[-LONGEST_END:]):
        raise UserError("it is cut off")
    try:
        yield from _READERS.get(suffix, _bytes)(data)
    except (ValueError, LookupError, TypeError, RecursionError, OSError, RuntimeError, EOFError) as error:
        raise UserError(f"it cannot be read ({error})") from error
    except (tarfile.TarError, zipfile.BadZipFile) as error:
        raise UserError(f"it cannot be read ({error})") from error


def is_truncated(name: str, last_bytes: bytes) -> bool:
    """Return True if a file is truncated, judged by its type."""
    suffix = Path(name).suffix
    if not last_bytes:
        return suffix != ".txt"  # an empty image has an empty YOLO label
    return not last_bytes.endswith(_ENDS.get(suffix, b""))


def is_same(expected: Any, actual: Any) -> bool:  # noqa: ANN401 - any value of a file
    """Return True if two values agree, numbers within rounding and JPEG pixels within the codec's error."""
    if isinstance(expected, JpegPixels):
        a, b = expected.pixels.astype(np.float32), actual.pixels.astype(np.float32)
        if a.shape != b.shape:
            return False
        difference = np.abs(a - b)
        return bool(
            difference.max() <= JPEG_MAX_DN and math.sqrt(float(np.mean(difference**2))) <= JPEG_RMS_DN
        )
    if isinstance(expected, np.ndarray):
        if (expected.shape, expected.dtype) != (actual.shape, actual.dtype):
            return False
        # bytes first: comparing floats that may be NaN is slower
        return expected.tobytes() == actual.tobytes() or (
            expected.dtype.kind == "f" and np.array_equal(expected, actual, equal_nan=True)
        )
    if isinstance(expected, dict):
        return (
            isinstance(actual, dict)
            and expected.keys() == actual.keys()
            and all(is_same(value, actual[key]) for key, value in expected.items())
        )
    if isinstance(expected, list):
        return (
            isinstance(actual, list)
            and len(expected) == len(actual)
            and all(is_same(a, b) for a, b in zip(expected, actual, strict=True))
        )
    if isinstance(expected, bytes) and expected != actual and expected.startswith(_PNG):
        # other versions of the library compress differently
        return bool(np.array_equal(decode_png(expected, "picture"), decode_png(actual, "picture")))
    if isinstance(expected, float) and isinstance(actual, int | float):
        return math.isclose(expected, actual, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return type(expected) is type(actual) and bool(expected == actual)


def _bytes(data: bytes) -> Iterator[Entry]:
    yield Entry("bytes", data)


def _png(data: bytes) -> Iterator[Entry]:
    yield Entry("picture", decode_png(data, "picture"))


def _jpeg(data: bytes) -> Iterator[Entry]:
    if max(picture_size(data) or (0,)) > MAX_SIDE_PX:
        raise ValueError(_TOO_LARGE)
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("not a JPEG")
    yield Entry("picture", JpegPixels(pixels))


def _json(data: bytes) -> Iterator[Entry]:
    refuse_deep(data, "it")
    document = json.loads(data, object_pairs_hook=_without_repeats)
    if isinstance(document, list):  # SPEED, SPEED+
        for row in document:
            yield Entry(str(row["filename"]), row, _number_in(row["filename"]))
        return
    for name, value in document.items():
        if isinstance(value, list) and value and all(isinstance(v, dict) and "id" in v for v in value):
            for row in value:  # COCO
                frame = row.get("image_id", row["id"] if name == "images" else None)
                yield Entry(f"{name} {row['id']}", row, frame)
        else:
            yield Entry(str(name), value, whole_number(name))  # BOP


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) < len(pairs):
        repeated = next(name for k, (name, _) in enumerate(pairs) if name in dict(pairs[:k]))
        raise ValueError(f"key {repeated!r} occurs twice")
    return document


def refuse_repeated_keys(data: bytes, source: str) -> None:
    """Raise if a JSON object has a duplicate key, on which readers disagree.

    Raises
    ------
    UserError
        If a key is repeated, or the data are not JSON or nested too deeply.
    """
    refuse_deep(data, source)
    try:
        json.loads(data.removeprefix(codecs.BOM_UTF8), object_pairs_hook=_without_repeats)
    except json.JSONDecodeError as error:
        raise UserError(f"{source} is not JSON: {error}") from error
    except ValueError as error:
        raise UserError(f"{source}: {error}; remove one") from error


def _number_in(name: str) -> int | None:
    digits = re.search(r"\d+", Path(name).stem)
    return whole_number(digits[0]) if digits else None


def _lines(data: bytes) -> Iterator[Entry]:
    """Yield the lines of a table, with numbers rounded."""
    counts: dict[str, int] = {}
    for line in data.decode().splitlines():
        text = ",".join(_rounded(cell) for cell in line.split(","))
        counts[text] = counts.get(text, 0) + 1
        name = re.search(r"\w*?(\d+)(_rgb)?\.png", line)
        yield Entry(f"line {text} ({counts[text]})", "", whole_number(name[1]) if name else None)


def _rounded(cell: str) -> str:
    try:
        return f"{float(cell) + 0.0:.9g}" if "." in cell else cell
    except ValueError:
        return cell


def _text(data: bytes) -> Iterator[Entry]:
    yield Entry("text", data.decode())


def _npz(data: bytes) -> Iterator[Entry]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(info.file_size for info in archive.infolist()) > MAX_ARRAYS_BYTES:
            raise ValueError("its arrays are larger than any frame's")
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        for name in arrays.files:
            yield Entry(name, arrays[name])


def _exr(data: bytes) -> Iterator[Entry]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        path.write_bytes(data)
        for part in OpenEXR.File(str(path), separate_channels=True, header_only=True).parts:
            low, high = (np.asarray(corner, np.int64) for corner in part.header["dataWindow"])
            if max((high - low + 1).tolist()) > MAX_SIDE_PX:
                raise ValueError(_TOO_LARGE)
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        for name, channel in channels.items():
            yield Entry(name, np.asarray(channel.pixels))


def _tar(data: bytes) -> Iterator[Entry]:
    # not compressed, as our shards: "r" alone would unpack a stream of any size
    with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as tar:
        for member in tar:
            if member.size > len(data):  # a sparse file
                raise ValueError(f"{member.name} is larger than its archive")
            file = tar.extractfile(member) if member.isfile() else None
            yield Entry(
                member.name, b"" if file is None else file.read(), _number_in(member.name.split(".")[0])
            )


def _parquet(data: bytes) -> Iterator[Entry]:
    parquet = import_needed("pyarrow.parquet", "formats", "parquet")
    file = parquet.ParquetFile(io.BytesIO(data))
    size = sum(
        _unpacked_size(data, file.metadata.row_group(group).column(k), file.schema.column(k))
        for group in range(file.metadata.num_row_groups)
        for k in range(file.metadata.num_columns)
    )
    if size > MAX_SHARD_BYTES:
        raise ValueError(f"it unpacks to {size:,} bytes, at most {MAX_SHARD_BYTES:,} are read")
    # one row, because all of them may repeat the largest value
    for batch in file.iter_batches(batch_size=1):
        for row in batch.to_pylist():
            for column, value in row.items():
                yield Entry(f"row {row['number']} {column}", value, row["number"])


def _unpacked_size(data: bytes, column: Any, schema: Any) -> int:  # noqa: ANN401 - the library has no types
    """Return the unpacked size of a column chunk by the headers of its pages, which the decoder follows.

    References
    ----------
    parquet-format, parquet.thrift: PageHeader 2 is the unpacked size, 3 the packed size; of the headers of data pages
    (5, 8) 1 is the number of values.
    """
    starts = (column.dictionary_page_offset, column.data_page_offset)
    at = min(start for start in starts if start is not None)
    end = at + column.total_compressed_size
    size = n_values = dictionary = 0
    while at < end:
        header, at = _thrift_struct(data, at)
        size, at = size + header[2], at + header[3]
        n_values += sum(header[k][1] for k in (5, 8) if k in header)
        dictionary = max(dictionary, header[2] if 7 in header else 0)
        if min(header[2], header[3], n_values) < 0:
            raise ValueError("a page has a size below 0")
    is_text = column.physical_type == "BYTE_ARRAY"
    # a page repeats a value in few bits: the values of a list are unpacked together, each perhaps the whole dictionary
    return size + n_values * (dictionary if is_text and schema.max_repetition_level else _NUMBER_BYTES)


def _thrift_struct(data: bytes, at: int) -> tuple[dict[int, Any], int]:
    """Return the integers and structures of a structure in Thrift's compact protocol, and the offset of its end."""
    fields: dict[int, Any] = {}
    number = 0
    while kind := data[at] & 15:
        step, at = data[at] >> 4, at + 1
        if not step:
            step, at = _thrift_integer(data, at)
            number = 0
        number += step
        if kind in (4, 5, 6):
            fields[number], at = _thrift_integer(data, at)
        elif kind == 8:
            length, at = _varint(data, at)
            at += length
        elif kind == 12:
            fields[number], at = _thrift_struct(data, at)
        elif kind not in (1, 2):  # true, false
            raise ValueError(f"a page's header has a field of type {kind}")
    return fields, at + 1


def _thrift_integer(data: bytes, at: int) -> tuple[int, int]:
    value, at = _varint(data, at)
    return value >> 1 ^ -(value & 1), at


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while data[at] & 128:
        if shift > _MAX_SHIFT:
            raise ValueError("a page's header has a number of more than 64 bits")
        value, shift, at = value | (data[at] & 127) << shift, shift + 7, at + 1
    return value | data[at] << shift, at + 1


def _mcap(data: bytes) -> Iterator[Entry]:
    import_needed("mcap", "logs", "mcap")
    for _, channel, message in mcap_messages(io.BytesIO(data)):
        value = [message.log_time, message.data]
        yield Entry(f"{channel.topic} {message.sequence}", value, message.sequence)


_READERS: dict[str, Callable[[bytes], Iterator[Entry]]] = {
    ".png": _png,
    ".jpg": _jpeg,
    ".json": _json,
    ".csv": _lines,
    ".txt": _text,
    ".yaml": _text,
    ".md": _text,
    ".npz": _npz,
    ".exr": _exr,
    ".tar": _tar,
    ".parquet": _parquet,
    ".mcap": _mcap,
}
