"""Serialisation of frozen dataclasses, tuples and arrays to one array of bytes and back, for the cache.

No pickle: what lies in a folder of the user's is data, and never code.
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
_ALIGNED = 64  # bytes: where an array of a processor's vectors may begin


def pack(tree: object, *kinds: type) -> ByteArray:
    """The bytes (n,) of a tree of dataclasses, tuples, numbers, texts, None and arrays of numbers.

    A dataclass is written as the place of its type among ``kinds`` and the values of its fields in their order: neither
    names nor modules matter.

    Parameters
    ----------
    kinds : types of the dataclasses in the tree, that of its root first.

    Raises
    ------
    TypeError
        If it holds anything else.
    """
    arrays: list[NDArray[Any]] = []
    head = json.dumps(_described(tree, kinds, arrays)).encode()
    pieces = [np.array([len(head)], "<u8").tobytes(), head]
    at = 8 + len(head)
    for array in arrays:
        pieces += [b"\0" * (-at % _ALIGNED), array.tobytes()]
        at += -at % _ALIGNED + array.nbytes
    return np.frombuffer(b"".join(pieces), np.uint8)


def unpack(packed: ByteArray, of: type[_T], *inner: type) -> _T:
    """What was packed; its arrays are parts of the bytes, not copies.

    Parameters
    ----------
    of, inner : the ``kinds`` that it was packed with.

    Raises
    ------
    TypeError
        If the bytes hold something else.
    """
    data = np.asarray(packed)  # a mapped file's own type takes ten times as long to cut
    length = int(data[:8].view("<u8")[0])
    tree = _Unpacker(data, 8 + length, (of, *inner)).read(json.loads(data[8 : 8 + length].tobytes()))
    if not isinstance(tree, of):
        raise TypeError(f"a {type(tree).__name__} is stored and a {of.__name__} was asked for")
    return tree


def _described(node: object, kinds: tuple[type, ...], arrays: list[NDArray[Any]]) -> object:
    """The tree as JSON; arrays go to a list, and their types and shapes stand for them."""
    if isinstance(node, np.ndarray):
        if node.dtype.kind not in "biuf":
            raise TypeError(f"an array of {node.dtype} cannot be stored; only numbers can")
        arrays.append(np.ascontiguousarray(node))
        return {"array": [node.dtype.str, list(node.shape)]}
    if dataclasses.is_dataclass(node) and not isinstance(node, type):
        if type(node) not in kinds:
            raise TypeError(f"a {type(node).__name__} cannot be stored: it is not among the kinds")
        values = [_described(getattr(node, f.name), kinds, arrays) for f in dataclasses.fields(node)]
        return {"kind": kinds.index(type(node)), "values": values}
    if isinstance(node, tuple):
        return {"tuple": [_described(one, kinds, arrays) for one in node]}
    if isinstance(node, np.generic):
        node = node.item()
    if node is None or isinstance(node, (bool, int, float, str)):
        return node
    raise TypeError(f"a {type(node).__name__} cannot be stored")


class _Unpacker:
    """Goes through a description in the order in which it was made, and through the arrays behind it."""

    def __init__(self, data: ByteArray, at: int, kinds: tuple[type, ...]) -> None:
        self._data, self._at, self._kinds = data, at, kinds

    def read(self, node: Any) -> Any:  # noqa: ANN401 - what JSON gives
        if not isinstance(node, dict):
            return node
        if "array" in node:
            return self._array(*node["array"])
        if "tuple" in node:
            return tuple(self.read(one) for one in node["tuple"])
        kind = self._kinds[node["kind"]] if node["kind"] < len(self._kinds) else None
        if not dataclasses.is_dataclass(kind):
            raise TypeError(f"a dataclass of kind {node['kind']} is stored, which was not asked for")
        names = [f.name for f in dataclasses.fields(kind)]
        if len(names) != len(node["values"]):
            raise TypeError(f"{len(node['values'])} values are stored of a {kind.__name__} of {len(names)}")
        return kind(**{name: self.read(one) for name, one in zip(names, node["values"], strict=True)})

    def _array(self, layout: str, shape: list[int]) -> NDArray[Any]:
        dtype = np.dtype(layout)
        start = self._at + -self._at % _ALIGNED
        self._at = start + dtype.itemsize * int(np.prod(shape))
        return self._data[start : self._at].view(dtype).reshape(shape)
