"""YAML of camera files: YAML 1.2 numbers, no anchors, no duplicate keys, bounded length and depth."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import yaml

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import MAX_DEPTH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MAX_YAML_BYTES = 1_000_000  # parsed in a second by libyaml
# possessive quantifiers prevent backtracking over long digits
NUMBER = r"[-+]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][-+]?[0-9]++)?+"
_SCALARS: tuple[tuple[re.Pattern[str], Callable[[str], Any]], ...] = (
    (re.compile(r"|~|null|Null|NULL"), lambda _: None),
    (re.compile(r"true|True|TRUE|false|False|FALSE"), lambda text: text.lower() == "true"),
    (re.compile(r"[-+]?[0-9]++"), int),
    (re.compile(NUMBER), float),
    (re.compile(r"[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)"), lambda text: float(text.replace(".", "", 1))),
)
_TAGS = re.compile(r"tag:yaml\.org,2002:(?:opencv-(?:nd-)?matrix|map|seq|str|int|float|bool|null)|!")


def scalar(text: str) -> Any:  # noqa: ANN401 - number, truth value, text or None
    """Convert a plain scalar as YAML 1.2 does.

    In YAML 1.1, as read by PyYAML's loaders, 1e-05 is text, 0640 is 416 and 640:480 is 38880.
    """
    for pattern, convert in _SCALARS:
        if pattern.fullmatch(text):
            return convert(text)
    return text


def parse_yaml(text: str, source: str) -> tuple[Any, bool]:
    """Parse the first document that is not empty; return it, and True if other documents follow.

    Raises
    ------
    UserError
        If it is not YAML, has a duplicate key, or is longer or deeper than a camera file.
    """
    if len(text) > MAX_YAML_BYTES:
        raise UserError(f"{source} is YAML of more than {MAX_YAML_BYTES / 1e6:g} MB: give the camera alone")
    # OpenCV writes %YAML:1.0, which YAML does not allow
    text = re.sub(r"^%YAML[: ].*$", "", text, flags=re.MULTILINE)
    document = None
    try:
        events = yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        for event in events:
            if isinstance(event, yaml.NodeEvent):
                document = _Composer(events).value(event)
                if document is not None:
                    break
        next(events)  # the end of the document
        # a separator at the end of the file begins an empty document
        has_more = (
            isinstance(next(events), yaml.DocumentStartEvent) and getattr(next(events), "value", None) != ""
        )
    except StopIteration:
        has_more = False
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        location = " ".join(str(error).split())
        raise UserError(f"{source} is not JSON and not YAML: {location}; give a camera file") from error
    return document, has_more


class _Composer:
    """Builds values from the parser's events."""

    def __init__(self, events: Iterator[Any]) -> None:
        self._events = events
        self._depth = 0

    def value(self, event: Any) -> Any:  # noqa: ANN401 - the library has no types
        """Return the value that starts with an event.

        Raises
        ------
        YAMLError, ValueError
            If it has an alias, nests too deep, has a duplicate key, or is a language-specific object.
        """
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f"line {line} refers to another place, which a camera file does not")
        if event.tag is not None and not _TAGS.fullmatch(event.tag):
            raise ValueError(
                f"line {line} has an object of type {event.tag.rpartition(':')[2]}; write arrays with .tolist()"
            )
        if isinstance(event, yaml.ScalarEvent):
            return scalar(event.value) if event.implicit[0] else event.value
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ValueError(f"line {line} nests more than {MAX_DEPTH} tables in each other")
        value = self._list() if isinstance(event, yaml.SequenceStartEvent) else self._table()
        self._depth -= 1
        return value

    def _list(self) -> list[Any]:
        items = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            items.append(self.value(event))
        return items

    def _table(self) -> dict[str, Any]:
        table: dict[str, Any] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            line = event.start_mark.line + 1
            if not isinstance(event, yaml.ScalarEvent):
                raise yaml.YAMLError(f"line {line} has a key that is not a word")
            if event.value in table:
                raise ValueError(f"line {line} has the key {event.value[:60]} a second time; delete one")
            table[event.value] = self.value(next(self._events))
        return table


def yaml_text(table: dict[str, Any]) -> str:
    """Return a table as YAML, lists in one line."""
    return str(yaml.safe_dump(table, sort_keys=False, default_flow_style=None, width=1000))
