"""Options of a command, derived from the fields of its run; they override the keys of ``--run FILE``."""

from __future__ import annotations

import copy
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import msgspec
import typer
from msgspec import inspect as mi
from typer.models import OptionInfo

from flyaround.runs.document import PATH, Run, RunField, read_run, refuse_exclusions, run_fields
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.validation_errors import explain

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

_R = TypeVar("_R", bound=Run)


def with_run_options(command: Callable[..., None], kind: type[Run] | None = None) -> Callable[..., None]:
    """Return a command whose options are the fields of its argument ``run``, then its own, then ``--run FILE``.

    Parameters
    ----------
    command : callable
        Command to extend.
    kind : type, optional
        Type of the run; by default the argument's annotation.
    """
    signature = inspect.signature(command, eval_str=True)
    command_parameters = [
        p.replace(kind=p.KEYWORD_ONLY) for p in signature.parameters.values() if p.name != "run"
    ]
    kind = signature.parameters["run"].annotation if kind is None else kind
    fields = {field.name: field for field in run_fields(kind)}

    def wrapper(**values: Any) -> None:  # noqa: ANN401 - option values
        run = make_run(kind, {name: values[name] for name in fields})
        command(run=run, **{p.name: values[p.name] for p in command_parameters})

    parameters = [*map(_parameter, fields.values()), *command_parameters, _run_parameter(kind, fields)]
    wrapper.__doc__, wrapper.__name__, wrapper.__module__ = (
        command.__doc__,
        command.__name__,
        command.__module__,
    )
    wrapper.__annotations__ = {p.name: p.annotation for p in parameters}
    vars(wrapper)["__signature__"] = signature.replace(parameters=parameters)
    return wrapper


def make_run(kind: type[_R], values: Mapping[str, Any]) -> _R:
    """Return the run for option values by field name; None stands for the default.

    Raises
    ------
    UserError
        If a value is not allowed, or options exclude each other.
    """
    table: dict[str, Any] = {}
    flags = {}
    for field in run_fields(kind):
        value = _document_value(values.get(field.name), field.kind)
        *sections, name = field.key.split(".")
        section = table
        for inner in sections:
            section = section.setdefault(inner, {})
        if value is not None:
            section[name] = value
        flags[field.key] = field.flag
    try:
        run = msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        sentence = explain(str(error), table, kind)
        key = sentence.removeprefix("key ").partition(" ")[0]
        raise UserError(sentence.replace(f"key {key}", flags.get(key, f"key {key}"), 1)) from error
    refuse_exclusions(run)
    return run


def _document_value(value: Any, kind: mi.Type) -> Any:  # noqa: ANN401 - an option value
    """Return an option value as in the document: choices in any case, None for an empty list."""
    if isinstance(value, list | tuple):
        return [_document_value(item, kind) for item in value] or None
    if isinstance(value, Path):
        return str(value)
    choices = [v for t in _alternatives(kind) if isinstance(t, mi.LiteralType) for v in t.values]
    if isinstance(value, str):
        return next((choice for choice in choices if str(choice).lower() == value.lower()), value)
    return value


def _alternatives(kind: mi.Type) -> tuple[mi.Type, ...]:
    return kind.types if isinstance(kind, mi.UnionType) else (kind,)


def _parameter(field: RunField) -> inspect.Parameter:
    """Return the Typer parameter of a field, with the bounds of its type."""
    declared = copy.copy(field.declared)
    if isinstance(declared, OptionInfo):
        declared.rich_help_panel = declared.rich_help_panel or field.panel
    kind = next(t for t in _alternatives(field.kind) if not isinstance(t, mi.NoneType))
    if isinstance(kind, mi.IntType | mi.FloatType):
        declared.min, declared.max = kind.ge, kind.le
    annotation = _annotation(kind)
    required = field.default is msgspec.NODEFAULT
    default = inspect.Parameter.empty if required else field.default
    if default is None or default == ():
        annotation, default = annotation | None, None
    return inspect.Parameter(
        field.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=default,
        annotation=Annotated[annotation, declared],
    )


def _annotation(kind: mi.Type) -> Any:  # noqa: ANN401 - a type
    """Return the type with which the command line converts a value; the document checks choices."""
    match kind:
        case mi.Metadata(extra=extra) if extra and extra.get(PATH):
            return Path
        case mi.VarTupleType(item_type=item):
            return list[_annotation(item)]  # type: ignore[misc]
        case mi.IntType():
            return int
        case mi.FloatType():
            return float
        case mi.BoolType():
            return bool
    return str


def _run_parameter(kind: type[Run], fields: Mapping[str, RunField]) -> inspect.Parameter:
    """Return the option ``--run FILE``, which is read first and sets the defaults of the others."""

    def read(context: typer.Context, file: Path | None) -> Path | None:
        if file is not None:
            raw = read_run(file, kind)
            context.default_map = {
                field.name: v for field in fields.values() if (v := _value_at(raw, field.key)) is not None
            }
        return file

    option = typer.Option(
        "--run",
        metavar="FILE",
        is_eager=True,
        callback=read,
        help="Take the run from this TOML file; options on the command line override its keys (docs/runs.md).",
    )
    return inspect.Parameter(
        "run_file",
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[Path | None, option],
    )


def _value_at(table: Any, key: str) -> Any:  # noqa: ANN401 - TOML
    """Return the value at a dotted key such as ``line.listen``, or None."""
    for step in key.split("."):
        table = table.get(step) if isinstance(table, dict) else None
    return table
