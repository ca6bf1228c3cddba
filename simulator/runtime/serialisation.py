"""Serialisation of frozen dataclasses, tuples and arrays to one array of bytes, for the cache.

No pickle: files in a user's folder are data, never code.
"""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray

_T = TypeVar("_T")
_ALIGNMENT = 64  # bytes: array alignment for vector instructions


def pack(tree: object, *kinds: type) -> ByteArray:
    """Serialise a tree of dataclasses, tuples, numbers, texts, None and numeric arrays to bytes (n,).

    A dataclass is stored as the index of its type in ``kinds`` and its field values in order; names and modules do not
    matter.

    Parameters
    ----------
    tree : object
        Tree to serialise.
    kinds : type
        Types of the dataclasses in the tree, the root's first.

    Returns
    -------
    (n,) array
        Bytes, uint8.

    Raises
    ------
    TypeError
        If it holds anything else.
    """
    arrays: list[NDArray[Any]] = []
    head = json.dumps(_describe_tree(tree, kinds, arrays)).encode()
    pieces = [np.array([len(head)], "<u8").tobytes(), head]
    offset = 8 + len(head)
    for array in arrays:
        pieces += [b"\0" * (-offset % _ALIGNMENT), array.tobytes()]
        offset += -offset % _ALIGNMENT + array.nbytes
    return np.frombuffer(b"".join(pieces), np.uint8)


def unpack(packed: ByteArray, of: type[_T], *inner: type) -> _T:
    """Return the tree that `pack` serialised; its arrays are views of the bytes, not copies.

    Parameters
    ----------
    packed : (n,) array
        Bytes from `pack`.
    of : type
        Type of the tree's root, the first type given to `pack`.
    inner : type
        Further types given to `pack`, in the same order.

    Returns
    -------
    object
        Tree of the type ``of``.

    Raises
    ------
    TypeError
        If the bytes hold something else.
    """
    data = np.asarray(packed)  # slicing a memmap is slower
    length = int(data[:8].view("<u8")[0])
    tree = _Unpacker(data, 8 + length, (of, *inner)).read(json.loads(data[8 : 8 + length].tobytes()))
    if not isinstance(tree, of):
        raise TypeError(f"a {type(tree).__name__} is stored, but a {of.__name__} was requested")
    return tree


def _describe_tree(node: object, kinds: tuple[type, ...], arrays: list[NDArray[Any]]) -> object:
    """Return the tree as JSON; arrays are appended to a list and represented by type and shape."""
    if isinstance(node, np.ndarray):
        if node.dtype.kind not in "biuf":
            raise TypeError(f"an array of {node.dtype} cannot be stored; only numbers can")
        arrays.append(np.ascontiguousarray(node))
        return {"array": [node.dtype.str, list(node.shape)]}
    if dataclasses.is_dataclass(node) and not isinstance(node, type):
        if type(node) not in kinds:
            raise TypeError(f"a {type(node).__name__} cannot be stored: it is not among the kinds")
        values = [_describe_tree(getattr(node, f.name), kinds, arrays) for f in dataclasses.fields(node)]
        return {"kind": kinds.index(type(node)), "values": values}
    if isinstance(node, tuple):
        return {"tuple": [_describe_tree(item, kinds, arrays) for item in node]}
    if isinstance(node, np.generic):
        node = node.item()
    if node is None or isinstance(node, (bool, int, float, str)):
        return node
    raise TypeError(f"a {type(node).__name__} cannot be stored")


class _Unpacker:
    """Rebuilds a tree from its description and the arrays behind it, both in order."""

    def __init__(self, data: ByteArray, at: int, kinds: tuple[type, ...]) -> None:
        self._data, self._at, self._kinds = data, at, kinds

    def read(self, node: Any) -> Any:  # noqa: ANN401 - what JSON gives
        if not isinstance(node, dict):
            return node
        if "array" in node:
            return self._array(*node["array"])
        if "tuple" in node:
            return tuple(self.read(item) for item in node["tuple"])
        kind = self._kinds[node["kind"]] if node["kind"] < len(self._kinds) else None
        if not dataclasses.is_dataclass(kind):
            raise TypeError(
                f"a dataclass of kind {node['kind']} is stored, which is not among the requested kinds"
            )
        names = [f.name for f in dataclasses.fields(kind)]
        if len(names) != len(node["values"]):
            raise TypeError(f"{len(node['values'])} values are stored of a {kind.__name__} of {len(names)}")
        return kind(**{name: self.read(item) for name, item in zip(names, node["values"], strict=True)})

    def _array(self, layout: str, shape: list[int]) -> NDArray[Any]:
        dtype = np.dtype(layout)
        start = self._at + -self._at % _ALIGNMENT
        self._at = start + dtype.itemsize * int(np.prod(shape))
        return self._data[start : self._at].view(dtype).reshape(shape)
