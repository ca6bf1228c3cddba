"""XML of OpenCV's FileStorage as a table; document types are refused, so that entities cannot expand."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree as ET

from flyaround.simulator.camera.lens.formats.yaml_text import scalar
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import MAX_DEPTH

ROOT = "opencv_storage"


class _Tree(ET.TreeBuilder):
    """Builds a tree of bounded depth."""

    depth = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> ET.Element:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ValueError(f"it nests more than {MAX_DEPTH} elements in each other")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        self.depth -= 1
        return super().end(tag)

    def doctype(self, name: str, pubid: str, system: str) -> None:  # noqa: ARG002 - the parser's signature
        raise ValueError("it has a document type, which is not read")


def parse_xml(text: str, source: str) -> dict[str, Any]:
    """Parse a file of OpenCV's FileStorage.

    Raises
    ------
    UserError
        If the text is not XML, has a document type, nests too deeply, repeats a key, or has another root.
    """
    text = re.sub(r"^\s*<\?xml.*?\?>", "", text, count=1, flags=re.DOTALL)  # its encoding has been applied
    try:
        parser = ET.XMLParser(target=_Tree())  # noqa: S314 - without document type, bounded in length and depth
        parser.feed(text)
        root = parser.close()
        if root.tag != ROOT:
            raise ValueError(
                f"its root is {root.tag[:60]}, and the only XML camera file read is OpenCV's {ROOT}"
            )
        value = _value(root)
    except (ET.ParseError, ValueError) as error:
        raise UserError(
            f"{source} is not OpenCV's XML: {error}; give a calibration as JSON or YAML"
        ) from error
    if not isinstance(value, dict):
        raise UserError(f"{source} holds no keys; give a camera file")
    return value


def _value(element: ET.Element) -> Any:  # noqa: ANN401 - a node of FileStorage is anything
    children = list(element)
    if not children:
        text = (element.text or "").strip()
        return text.strip('"') if text.startswith('"') else scalar(text)
    if all(child.tag == "_" for child in children):
        return [_value(child) for child in children]
    table: dict[str, Any] = {}
    for child in children:
        if child.tag in table:
            raise ValueError(f"it has the key {child.tag} twice")
        table[child.tag] = _value(child)
    return table
