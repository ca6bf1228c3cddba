"""Validation errors of typed files as sentences: key, value, and allowed values."""

from __future__ import annotations

import re
from typing import Any, TypeVar

import msgspec
from msgspec import inspect as mi

from flyaround.simulator.errors import UserError, near_names

_T = TypeVar("_T", bound=msgspec.Struct)

_PATH = re.compile(r"(?P<what>.*?)(?: - at `\$(?P<path>[^`]*)`)?", re.DOTALL)


def convert_document(raw: dict[str, Any], kind: type[_T], source: str) -> _T:
    """Convert a file's content to its type.

    Parameters
    ----------
    raw : dict
        Content of the file.
    kind : type
        Type of the document.
    source : str
        Name of the file in messages.

    Returns
    -------
    object
        Content of the given type.

    Raises
    ------
    UserError
        If a key is wrong; the message states the key, its value and what is allowed.
    """
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {explain(str(error), raw, kind)}") from error


def explain(message: str, raw: dict[str, Any], root: type[msgspec.Struct]) -> str:
    """Return the sentence for a `msgspec.ValidationError`.

    Parameters
    ----------
    message : str
        Text of the error.
    raw : dict
        The file's content, to quote the value from.
    root : type
        Type of the file, to describe what is allowed.

    Returns
    -------
    str
        Sentence with the key, its value and what is allowed.
    """
    match = _PATH.fullmatch(message)
    what, path = (match["what"], match["path"] or "") if match else (message, "")
    key = path.lstrip(".")
    if unknown := re.search(r"unknown field `(.*)`", what):
        _, types = _walk(raw, root, path)
        return _unknown(unknown[1], key, types)
    if missing := re.search(r"missing required field `(.*)`", what):
        _, types = _walk(raw, root, path)
        return _missing(missing[1], key, types)
    value, types = _walk(raw, root, path)
    near = near_names(str(value), _choices(types)) if isinstance(value, str) else []
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    return f"key {key} is {_short(value)}, allowed: {describe_all(types)}{hint}"


def _unknown(name: str, key: str, types: list[mi.Type]) -> str:
    keys = _keys(types)
    near = near_names(name, keys)
    where = f"in section [{key}]" if key else "at the top level"
    hint = f"did you mean {near[0]}? " if near else ""
    return f"unknown key {name} {where}: {hint}allowed: {', '.join(keys)}"


def _missing(name: str, key: str, types: list[mi.Type]) -> str:
    where = f"section [{key}] lacks" if key else "the top level lacks"
    allowed = [
        field.type
        for t in types
        if isinstance(t, mi.StructType)
        for field in t.fields
        if field.encode_name == name
    ]
    tags = [t.tag for t in types if isinstance(t, mi.StructType) and t.tag_field == name]
    description = ", ".join(str(tag) for tag in tags) if tags else describe_all(allowed)
    return f"{where} the key {name}, allowed: {description}"


def _walk(raw: Any, root: type[msgspec.Struct], path: str) -> tuple[Any, list[mi.Type]]:  # noqa: ANN401 - TOML
    """Return the value at a ``path`` such as ``.orbit.kind`` or ``.a[0]``, and the types that it may have."""
    types, value = alternatives(mi.type_info(root)), raw
    for step in re.findall(r"[^.\[\]]+", path):
        if isinstance(value, dict):
            types = _at_key(types, value, step)
            value = value.get(step)
        else:
            types = [a for t in types for a in _item_alternatives(t, int(step))]
            value = value[int(step)]
    if isinstance(value, dict):
        types = _by_tag(types, value)
    return value, types


def _at_key(types: list[mi.Type], table: dict[str, Any], key: str) -> list[mi.Type]:
    structs = [t for t in types if isinstance(t, mi.StructType)]
    if tags := [t.tag for t in structs if t.tag_field == key]:
        return [mi.LiteralType(values=tuple(tags))]
    tables = [t for t in _by_tag(types, table) if isinstance(t, mi.StructType)]
    return [a for t in tables for f in t.fields if f.encode_name == key for a in alternatives(f.type)]


def _by_tag(types: list[mi.Type], table: dict[str, Any]) -> list[mi.Type]:
    """Return the table types that match the file's tag (``kind``, ``mode``); all of them if it has none."""
    matching: list[mi.Type] = [
        t for t in types if isinstance(t, mi.StructType) and t.tag_field and table.get(t.tag_field) == t.tag
    ]
    return matching or [t for t in types if isinstance(t, mi.StructType)] or types


def alternatives(type_: mi.Type) -> list[mi.Type]:
    """Expand unions and annotations into every type that a key may have.

    Returns
    -------
    list of msgspec.inspect.Type
        Types without metadata, in the order of the union; None is left out.
    """
    if isinstance(type_, mi.UnionType):
        return [a for t in type_.types for a in alternatives(t)]
    if isinstance(type_, mi.Metadata):
        return alternatives(type_.type)
    return [] if isinstance(type_, mi.NoneType) else [type_]


def _item_alternatives(type_: mi.Type, index: int) -> list[mi.Type]:
    """Return the types that an item of a list may have; none if it is not a list."""
    if isinstance(type_, mi.TupleType):
        return alternatives(type_.item_types[index])
    return alternatives(type_.item_type) if isinstance(type_, mi.VarTupleType | mi.ListType) else []


def _keys(types: list[mi.Type]) -> list[str]:
    keys: dict[str, None] = {}
    for t in types:
        if isinstance(t, mi.StructType):
            keys.update(dict.fromkeys([t.tag_field] if t.tag_field else []))
            keys.update(dict.fromkeys(f.encode_name for f in t.fields))
    return list(keys)


def _choices(types: list[mi.Type]) -> list[str]:
    return [str(v) for t in types if isinstance(t, mi.LiteralType) for v in t.values]


def describe_all(types: list[mi.Type]) -> str:
    """Describe the allowed values of a key in words.

    Returns
    -------
    str
        Distinct descriptions joined by ``or``, such as ``a number of more than 0`` or ``a list of 3, each a number``.
    """
    return " or ".join(dict.fromkeys(_describe(t) for t in types))


def _describe(t: mi.Type) -> str:
    if isinstance(t, mi.FloatType | mi.IntType):
        return ("a number" if isinstance(t, mi.FloatType) else "a whole number") + _bounds(t)
    if isinstance(t, mi.LiteralType):
        return ", ".join(str(v) for v in t.values)
    if isinstance(t, mi.TupleType):
        return f"a list of {len(t.item_types)}, each {describe_all(alternatives(t.item_types[0]))}"
    if isinstance(t, mi.VarTupleType | mi.ListType):
        return f"a list, each {describe_all(alternatives(t.item_type))}"
    if isinstance(t, mi.StructType):
        return f"a table with the keys {', '.join(_keys([t]))}"
    return {mi.BoolType: "true or false", mi.StrType: "text in quotes"}.get(type(t), "another type")


def _bounds(t: mi.FloatType | mi.IntType) -> str:
    low = (
        f"at least {t.ge:.10g}" if t.ge is not None else f"more than {t.gt:.10g}" if t.gt is not None else ""
    )
    high = (
        f"at most {t.le:.10g}" if t.le is not None else f"less than {t.lt:.10g}" if t.lt is not None else ""
    )
    both = " and ".join(filter(None, [low, high]))
    return f" of {both}" if both else ""


def _short(value: Any) -> str:  # noqa: ANN401 - TOML
    text = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
