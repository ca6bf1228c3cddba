"""ROS 2 messages in CDR encoding, by rosbags (optional dependency ``logs``)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from collections.abc import Mapping


class CdrEncoder:
    """CDR encoder of messages given as dictionaries.

    Parameters
    ----------
    definitions : mapping
        Definition text of each message type, including those of its parts, by type name.
    """

    def __init__(self, definitions: Mapping[str, str]) -> None:
        self._store = get_typestore(Stores.EMPTY)
        for kind, text in definitions.items():
            types = get_types_from_msg(text, kind)
            self._store.register({k: v for k, v in types.items() if k not in self._store.fielddefs})

    def encode(self, kind: str, value: Mapping[str, Any]) -> bytes:
        """Return a message in little-endian CDR."""
        return bytes(self._store.serialize_cdr(self._message(kind, value), kind))

    def _message(self, kind: str, value: Mapping[str, Any]) -> object:
        fields = self._store.fielddefs[kind][1]
        return self._store.types[kind](**{name: self._field(type_, value[name]) for name, type_ in fields})

    def _field(self, type_: Any, value: Any) -> Any:  # noqa: ANN401 - a field of any type
        node, inner = type_
        if node is Nodetype.NAME:
            return self._message(inner, value)
        if node is Nodetype.BASE:
            return value
        element, _length = inner
        if element[0] is Nodetype.NAME or element[1][0] == "string":
            return [self._field(element, item) for item in value]
        dtype = np.dtype(element[1][0])
        return np.frombuffer(value, dtype) if isinstance(value, bytes) else np.asarray(value, dtype)
