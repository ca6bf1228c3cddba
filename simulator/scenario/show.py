"""Annotated text of built-in scenarios and recipes, with all unused keys as comments, as templates for users."""

from __future__ import annotations

import inspect
import re
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import inspect as mi

from flyaround.simulator.runtime.toml_file import parse_toml
from flyaround.simulator.runtime.toml_text import toml_value
from flyaround.simulator.runtime.validation_errors import alternatives, describe_all
from flyaround.simulator.scenario.load import TARGET_RECIPE, built_in_text, target_in
from flyaround.simulator.scenario.recipe import Recipe
from flyaround.simulator.scenario.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDTH = 100  # width of comment lines
_COMMENT_COLUMN = 44  # column of the allowed values
_LISTS = (mi.ListType, mi.VarTupleType)
_HEADER = re.compile(r"\[+([\w.]+)\]+")


def show_scenario(name: str) -> str:
    """Annotate a built-in scenario with its unused keys.

    Returns
    -------
    str
        A valid scenario file, equivalent to the built-in one, with each unused key as a comment: default and
        allowed values.

    Raises
    ------
    UserError
        If there is none.
    """
    header_lines = [
        f"# Scenario {name}. Keep it as mine.toml, change it, and look: flyaround render mine.toml -o mine.png",
        "# A key behind a # has the value shown unless it is given; ... is for one that has none, or is needed.",
        "# Keys are explained in docs/formats/scenario.md; units are in their names.",
    ]
    return _annotated_text(built_in_text("scenario", name), Scenario, header_lines)


def show_recipe(name: str) -> str:
    """Annotate a built-in recipe with its unused keys.

    Returns
    -------
    str
        A recipe file with each unused key as a comment: default and allowed values.

    Raises
    ------
    UserError
        If there is none.
    """
    target = target_in(name)
    text = built_in_text("recipe", name if target is None else TARGET_RECIPE)
    if target is not None:
        text = text.replace('target = "tango"', f'target = "{target}"')
    header_lines = [
        f"# Recipe {name}. Keep it as mine.toml, change it, and draw: flyaround capture mine.toml -n 20 -o mine",
        "# A key behind a # has the value shown unless it is given, here or in the base; ... is for one that has none.",
        "# Keys are explained in docs/datasets.md; units are in their names.",
    ]
    return _annotated_text(text, Recipe, header_lines)


def _annotated_text(text: str, root: type[msgspec.Struct], header_lines: Sequence[str]) -> str:
    """Return the text of a typed TOML file with each unused key as a comment.

    Parameters
    ----------
    text : str
        TOML text.
    root : type
        Type of the file.
    header_lines : sequence of str
        Comment lines that come first.
    """
    raw = parse_toml(text.encode(), "the file shown")
    top = _struct_type(mi.type_info(root), raw)
    lines = [*header_lines, ""]
    for path, block in _text_by_section(text):
        table, kind = _table_at(raw, path, top)
        lines += [*_description(kind), *block] if path else block
        lines += [*_keys_to_add(kind, table), *_other_kinds(top, path), ""]
    for path, kind, is_list in _sections_to_add(raw, top, ""):
        header = f"[[{path}]]" if is_list else f"[{path}]"
        tag = [f"# {kind.tag_field} = {toml_value(kind.tag)}"] if is_list and kind.tag_field else []
        lines += [*_description(kind), f"# {header}", *tag, *_keys_to_add(kind, {})]
        lines += [*_kinds_of_items(top, path), ""] if is_list else [""]
    return "\n".join(lines).rstrip() + "\n"


def _text_by_section(text: str) -> list[tuple[str, list[str]]]:
    """Return the text by sections: path (empty for the top) and lines, without trailing blank ones."""
    sections: list[tuple[str, list[str]]] = [("", [])]
    for line in text.splitlines():
        if header := _HEADER.match(line):
            sections.append((header[1], []))
        sections[-1][1].append(line)
    return [(path, "\n".join(lines).rstrip().splitlines()) for path, lines in sections]


def _table_at(raw: dict[str, Any], path: str, kind: mi.StructType) -> tuple[dict[str, Any], mi.StructType]:
    """Return the table at a path, and its type."""
    table: Any = raw
    for key in path.split(".") if path else ():
        table = table[key]
        field = next(f for f in kind.fields if f.encode_name == key)
        # the first of a list of tables represents all
        is_list = isinstance(table, list)
        table = table[0] if is_list else table
        kind = _struct_type(_item(field.type) if is_list else field.type, table)
    return table, kind


def _struct_type(type_: mi.Type, table: dict[str, Any]) -> mi.StructType:
    """Return the struct type that the table's tag selects among the allowed ones."""
    structs = [t for t in alternatives(type_) if isinstance(t, mi.StructType)]
    return next((t for t in structs if t.tag_field and table.get(t.tag_field) == t.tag), structs[0])


def _item(type_: mi.Type) -> mi.Type:
    """Return the item type of a list of tables."""
    return next(t.item_type for t in alternatives(type_) if isinstance(t, _LISTS))


def _is_section(field: mi.Field) -> bool:
    kinds = alternatives(field.type)
    if any(isinstance(t, mi.StrType) for t in kinds):
        return False  # such a field also accepts a name
    lists = [i for t in kinds if isinstance(t, _LISTS) for i in alternatives(t.item_type)]
    return any(isinstance(t, mi.StructType) for t in (*kinds, *lists))


def _keys_to_add(kind: mi.StructType, table: dict[str, Any]) -> list[str]:
    """Return a commented line for each plain key that a table lacks."""
    lines = []
    for field in kind.fields:
        if field.encode_name in table or _is_section(field):
            continue
        default = None if field.required else _default(field)
        value = "..." if default is None else toml_value(default)
        prefix = "needed: " if field.required else ""
        start = f"# {field.encode_name} = {value}"
        lines.append(f"{start:{_COMMENT_COLUMN}} # {prefix}{describe_all(alternatives(field.type))}")
    return lines


def _other_kinds(top: mi.StructType, path: str) -> list[str]:
    """Return a line with the alternatives of a section whose keys depend on its kind."""
    field = next((f for f in top.fields if f.encode_name == path), None)
    return [] if field is None else _kinds(field.type)


def _kinds_of_items(top: mi.StructType, path: str) -> list[str]:
    """Return a line with the alternatives of the tables in a list."""
    kind = top
    *sections, name = path.split(".")
    for key in sections:
        kind = _struct_type(next(f for f in kind.fields if f.encode_name == key).type, {})
    return _kinds(_item(next(f for f in kind.fields if f.encode_name == name).type))


def _kinds(type_: mi.Type) -> list[str]:
    kinds = [t for t in alternatives(type_) if isinstance(t, mi.StructType)]
    if len(kinds) < 2 or kinds[0].tag_field is None:
        return []
    names = ", ".join(str(t.tag) for t in kinds)
    return _comment(f"{kinds[0].tag_field}: {names}; each has its own keys")


def _default(field: mi.Field) -> Any:  # noqa: ANN401 - a TOML value is anything
    if field.default is msgspec.UNSET:
        return None
    if field.default is not msgspec.NODEFAULT:
        return msgspec.to_builtins(field.default)
    return field.default_factory() if callable(field.default_factory) else None


def _sections_to_add(
    table: dict[str, Any], kind: mi.StructType, path: str
) -> list[tuple[str, mi.StructType, bool]]:
    """Return the sections that a table may have and lacks: path, type, and whether several are allowed."""
    sections = []
    for field in kind.fields:
        name = field.encode_name
        if not _is_section(field):
            continue
        section_table, section_path = table.get(name), f"{path}.{name}" if path else name
        is_list = any(isinstance(t, _LISTS) for t in alternatives(field.type))
        if isinstance(section_table, dict):
            sections += _sections_to_add(section_table, _struct_type(field.type, section_table), section_path)
        elif section_table is None:
            section = _struct_type(_item(field.type) if is_list else field.type, {})
            sections.append((section_path, section, is_list))
            # sections inside a section that can be added
            sections += _sections_to_add({}, section, section_path)
    return sections


def _description(kind: mi.StructType) -> list[str]:
    """Return the description of a section from its type's docstring."""
    text = inspect.cleandoc(kind.cls.__doc__ or "").replace("``", "").replace("`", "")
    return _comment(re.split(r"\n\n(?:Parameters|Attributes)\n", text)[0])


def _comment(text: str) -> list[str]:
    lines, line = [], "#"
    for word in text.split():
        if len(line) + 1 + len(word) > WIDTH:
            lines.append(line)
            line = "#"
        line += f" {word}"
    return [*lines, line]
