"""Navigation messages in XML (CCSDS 505.0-B): orbit ephemerides, states and mean elements, as segments."""

from __future__ import annotations

from xml.parsers import expat

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.messages.ccsds import HEADER_KEYS, META_KEYS, Segment, refuse_unknown_key
from flyaround.simulator.world.messages.state_message import COVARIANCE, KEYS

KINDS = ("oem", "opm", "omm")
# Largest text, deepest nesting and longest value that are read. They bound time and memory: a state takes some 400
# bytes, messages nest 7 deep (from ndm to X), and values are numbers or short words.
MAX_BYTES = 50_000_000
_MAX_DEPTH = 16
_MAX_VALUE_LENGTH = 10_000
_VECTOR = ("EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT", "X_DDOT", "Y_DDOT", "Z_DDOT")
_STATE_LENGTHS = (7, 10)  # values of a state: epoch, position, velocity, and optionally acceleration
_UNITS = {"X": "km", "Y": "km", "Z": "km", "X_DOT": "km/s", "Y_DOT": "km/s", "Z_DOT": "km/s"}


class _Reader:
    """Callbacks of the XML parser; an element without children is a key with its value."""

    def __init__(self, source: str) -> None:
        self.where = source
        self.kind = ""
        self.segments: list[Segment] = []
        self._path: list[str] = []
        self._text: list[str] = []
        self._leaf = False
        self._header: dict[str, str] = {}
        self._vector: dict[str, str] = {}
        self.parser = expat.ParserCreate()
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._add_text

    @property
    def _location(self) -> str:
        return f"{self.where}, line {self.parser.CurrentLineNumber}"

    def _refuse_doctype(self, *_: object) -> None:
        raise UserError(
            f"{self._location}: the XML declares a DTD, which no navigation message has: remove it"
        )

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        if not self._path and name not in (*KINDS, "ndm"):
            raise UserError(
                f"{self.where} is XML of kind <{name[:40]}>, read are <oem>, <opm> and <omm>: export one of these"
            )
        if name in KINDS and len(self._path) < 2:
            if self.kind not in {"", name}:
                raise UserError(
                    f"{self._location}: messages of kinds {self.kind} and {name} in one file: split it"
                )
            self.kind, self._header = name, {}
        elif self._path == ["ndm"] and name not in {"COMMENT", "MESSAGE_ID"}:
            raise UserError(
                f"{self._location}: <{name[:40]}> is not read, only {', '.join(KINDS)}: take it out of the file"
            )
        if len(self._path) >= _MAX_DEPTH:
            raise UserError(
                f"{self._location}: elements nest more than {_MAX_DEPTH} deep, which no such message does"
            )
        self._path.append(name)
        self._text, self._leaf = [], True
        if name == "segment":
            self.segments.append(Segment(self.where, dict(self._header)))
        elif name == "stateVector":
            self._vector = {}
        unit, expected = attributes.get("units"), _UNITS.get(name)
        if unit is not None and expected is not None and unit.lower() != expected:
            raise UserError(f"{self._location}: {name} is in {unit[:20]}, allowed: {expected}")

    def _add_text(self, text: str) -> None:
        if self._leaf and sum(map(len, self._text)) < _MAX_VALUE_LENGTH:
            self._text.append(text)

    def _end(self, _: str) -> None:
        name = self._path.pop()
        if name == "stateVector" and self.kind == "oem":
            self._end_vector()
        elif self._leaf and name != "COMMENT":
            self._set(name, "".join(self._text).strip())
        self._leaf = False

    def _end_vector(self) -> None:
        words = [self._vector[key] for key in _VECTOR if key in self._vector]
        if len(words) not in _STATE_LENGTHS or len(words) != len(self._vector):
            available, needed = ", ".join(self._vector), ", ".join(_VECTOR[:7])
            raise UserError(f"{self._location}: a stateVector has {available}, needed: {needed}")
        self.segments[-1].rows.append((self.parser.CurrentLineNumber, words))

    def _set(self, key: str, value: str) -> None:
        if "header" in self._path:
            refuse_unknown_key(key, HEADER_KEYS, self._location)
        elif (
            not self.segments
            or key.startswith("USER_DEFINED")
            or ("covarianceMatrix" in self._path and self.kind == "oem")
        ):
            return
        elif "stateVector" in self._path and self.kind == "oem":
            refuse_unknown_key(key, _VECTOR, self._location)
            self._vector[key] = value
        elif self._path[-1] == "maneuverParameters":
            if key == "MAN_EPOCH_IGNITION":
                self.segments[-1].rows.append((self.parser.CurrentLineNumber, [value]))
        else:
            known_keys = META_KEYS["OEM"] if self.kind == "oem" else (*KEYS[self.kind.upper()], *COVARIANCE)
            refuse_unknown_key(key, known_keys, self._location)
            self.segments[-1].set_once(key, value, self._location)


def read_ndm(text: str, source: str) -> tuple[str, list[Segment]]:
    """Read a message, or several of one kind, from XML.

    Parameters
    ----------
    text : str
        Contents of the file.
    source : str
        Name of the file in error messages.

    Returns
    -------
    tuple
        ``oem``, ``opm`` or ``omm``, and the segments; keys of an OPM or OMM are all in ``meta``, ignition times in
        ``rows``.

    Raises
    ------
    UserError
        If it is not XML, declares a DTD, or is another message.
    """
    if len(text) > MAX_BYTES:
        raise UserError(
            f"{source} has {len(text):,} characters of XML, at most {MAX_BYTES:,} are read: make it smaller"
        )
    reader = _Reader(source)
    try:
        reader.parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UserError(f"{source} is not well-formed XML: {error}: export it again") from error
    if not reader.segments:
        raise UserError(f"{source} has no <segment>: export it again")
    return reader.kind, reader.segments
