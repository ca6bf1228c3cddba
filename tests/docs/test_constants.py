"""Numbers with a name say what they are: a comment above or beside them, or a string below their group."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# the console's sizes and colours are names of themselves
ROOMS = ("flyaround/cli", "flyaround/runs", "hil", "simulator")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
NAMED = re.compile(r"^[A-Z_]\w*\b.* = ")


def is_numeric(node):
    try:
        value = ast.literal_eval(node)
    except ValueError:
        return False
    values = value if isinstance(value, tuple) and value else (value,)
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def unexplained(source):
    lines, body = source.split("\n"), ast.parse(source).body
    for k, statement in enumerate(body):
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
        if not re.search("[A-Z]{2}", ast.unparse(target)) or not is_numeric(statement.value):
            continue
        first = statement.lineno - 1
        beside = any("#" in line for line in lines[first : statement.end_lineno])
        while first and NAMED.match(lines[first - 1]):
            first -= 1
        above = first > 0 and lines[first - 1].startswith("#")
        last = k
        while last + 1 < len(body) and body[last + 1].lineno == body[last].end_lineno + 1:
            last += 1
            if isinstance(body[last], ast.Expr):
                break
        below = isinstance(body[last], ast.Expr)
        if not (beside or above or below):
            yield f"{statement.lineno}: {lines[statement.lineno - 1]}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_numbers_with_a_name_are_explained(path):
    assert list(unexplained(path.read_text(encoding="utf-8"))) == []


def test_a_bare_number_is_found():
    assert list(unexplained("MAX_S = 5.0\n\nMIN_S = 1.0  # least\n# greatest\nTOP_S = 9\nEND_S = 3\n")) == [
        "1: MAX_S = 5.0"
    ]
