"""Base class of runs: fields, exclusions, reader and writer."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, get_origin

import msgspec
from msgspec import inspect as mi
from typer.models import ArgumentInfo, OptionInfo

from flyaround.hil.board.method_names import name_in_file
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.runtime.toml_file import parse_toml, read_toml
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.runtime.urls import without_secrets
from flyaround.simulator.runtime.validation_errors import explain

if TYPE_CHECKING:
    from collections.abc import Iterator

RUN_TOML = "run.toml"
PATH = "path"

NOT_RECORDED = "how"
"""Metadata of a field that affects only the destination or the processes; such fields are not recorded."""


class Only(NamedTuple):
    """A field that is valid only with some values of another field.

    Parameters
    ----------
    field : str
        Key of the field, such as ``pictures.n``.
    other : str
        Key of the other field.
    values : tuple of object or None
        Allowed values of the other field; None for any but its default.
    sentence : str
        Error message; ``{value}`` is replaced by the field's value.
    """

    field: str
    other: str
    values: tuple[Any, ...] | None
    sentence: str


class Run(Section, frozen=True, kw_only=True, tag_field="schema"):
    """Options of a command. Paths are relative to the working directory, as on the command line."""

    version: Literal[1] = 1
    RULES: ClassVar[tuple[Only, ...]] = ()


class RunField(NamedTuple):
    """Field of a run that is an option or an argument.

    Parameters
    ----------
    key : str
        Key in the document, such as ``line.listen``.
    section : type
        Type of its table.
    kind : msgspec.inspect.Type
        Type of its value.
    default : object
        Default value; ``msgspec.NODEFAULT`` for a required field.
    declared : OptionInfo or ArgumentInfo
        Help and names on the command line.
    recorded : bool
        False for a field marked ``NOT_RECORDED``.
    """

    key: str
    section: type[Section]
    kind: mi.Type
    default: Any
    declared: OptionInfo | ArgumentInfo
    recorded: bool

    @property
    def name(self) -> str:
        """Name of the field in its section."""
        return self.key.rpartition(".")[2]

    @property
    def panel(self) -> str | None:
        """Title of its section; None at the top level."""
        return self.key.rpartition(".")[0].replace("_", " ").capitalize() or None

    @property
    def flag(self) -> str:
        """Name on the command line."""
        if isinstance(self.declared, ArgumentInfo):
            return self.name.upper()
        # Typer expects the name in place of a default
        names = [n for n in (self.declared.default, *(self.declared.param_decls or ())) if isinstance(n, str)]
        long = [name for name in names if name.startswith("--")]
        return [*long, *names, f"--{self.name.replace('_', '-')}"][0].partition("/")[0]


def run_fields(kind: type[Section], above: str = "") -> Iterator[RunField]:
    """Yield the fields of a run and of its sections, in order."""
    for field in msgspec.structs.fields(kind):
        key = f"{above}{field.name}"
        if isinstance(field.type, type) and issubclass(field.type, Section):
            yield from run_fields(field.type, f"{key}.")
        elif get_origin(field.type) is Annotated:
            marks = field.type.__metadata__
            yield RunField(
                key,
                kind,
                mi.type_info(field.type),
                field.default,
                next(mark for mark in marks if isinstance(mark, OptionInfo | ArgumentInfo)),
                NOT_RECORDED not in marks,
            )


def read_run(path: Path, kind: type[Run]) -> dict[str, Any]:
    """Read and validate the keys of a run's file; the command line may add missing ones.

    Raises
    ------
    UserError
        If the file cannot be read, belongs to another command, or has an error: file, key, value and allowed values.
    """
    source = f"--run {path}"
    raw = parse_toml(read_toml(path, source, "give a TOML file of a run"), source)
    tag = mi.type_info(kind).tag  # type: ignore[attr-defined]
    schema = raw.get("schema", tag)
    if schema != tag:
        raise UserError(
            f"{source} has the schema {schema!r}, but this command's runs have {tag!r}: give a file of this command"
        )
    _rename_methods(raw, path)
    try:
        msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        if "missing required field" not in str(error) or " - at " in str(error):
            raise UserError(f"{source}: {explain(str(error), raw, kind)}") from error
    return raw


def _rename_methods(table: dict[str, Any], path: Path) -> None:
    """Replace former names of estimators in a table and its sections."""
    for key, value in table.items():
        if isinstance(value, dict):
            _rename_methods(value, path)
        elif key == "method" and isinstance(value, str):
            table[key] = name_in_file(value, path)
        elif key == "methods" and isinstance(value, list):
            table[key] = [name_in_file(v, path) if isinstance(v, str) else v for v in value]


def given_fields(run: Run) -> list[RunField]:
    """Return the fields whose values differ from the defaults."""
    return [field for field in run_fields(type(run)) if attrgetter(field.key)(run) != field.default]


def refuse_exclusions(run: Run) -> None:
    """Raise if fields exclude each other.

    Raises
    ------
    UserError
        If so; the message is that of the first violated rule.
    """
    set_keys = {field.key for field in given_fields(run)}
    for rule in run.RULES:
        fits = rule.other in set_keys if rule.values is None else attrgetter(rule.other)(run) in rule.values
        if rule.field in set_keys and not fits:
            raise UserError(rule.sentence.format(value=attrgetter(rule.field)(run)))


def run_toml(run: Run) -> bytes:
    """Return a run as TOML: every key with a value, without secrets in URLs.

    Fields that do not affect the result are omitted: output folder, processes and devices.
    """
    table = msgspec.to_builtins(run)
    for field in run_fields(type(run)):
        *sections, name = field.key.split(".")
        section = table
        for inner in sections:
            section = section[inner]
        if not field.recorded:
            del section[name]
        elif isinstance(section[name], str):
            section[name] = without_secrets(section[name])
    non_empty = {key: value for key, value in table.items() if value != {}}
    return to_toml(non_empty).encode()


def write_run(path: Path, run: Run) -> None:
    """Write a run into a folder as ``run.toml``, or next to a file as ``NAME.run.toml``.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_atomic(path / RUN_TOML if path.is_dir() else path.with_suffix(f".{RUN_TOML}"), run_toml(run))
