"""The published method stands alone: few lines, numpy and OpenCV, nothing of the other method, nothing compiled."""

import ast
import io
import json
import sys
import tokenize
from pathlib import Path

from programs import completed

MOST_LINES = 2300
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
PROGRAM = """
import json, sys
import numpy, cv2
theirs = set(sys.modules)
from flyaround.hil.board import methods
import flyaround.hil.board.svd.pipeline
own = sorted(set(sys.modules) - theirs)
standard = sys.stdlib_module_names
print(json.dumps({
    "project": {n: sys.modules[n].__file__ for n in own if n.split(".")[0] == "flyaround"},
    "others": sorted({n.split(".")[0] for n in own} - {"flyaround"} - set(standard)),
}))
"""


def code_lines(text):
    """Lines that hold a token other than a comment or a docstring."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            if (
                isinstance(statement, ast.Expr)
                and isinstance(statement.value, ast.Constant)
                and isinstance(statement.value.value, str)
            ):
                docstrings.update(range(statement.lineno, (statement.end_lineno or 0) + 1))
    found: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            found.update(range(token.start[0], token.end[0] + 1))
    return len(found - docstrings)


def test_the_published_method_imports_little_and_nothing_of_the_other():
    done = completed(sys.executable, "-c", PROGRAM, check=True)
    found = json.loads(done.stdout)
    assert found["others"] == []
    names = set(found["project"])
    assert "flyaround.hil.board.svd.refinement" in names
    assert not [n for n in names if "hybrid" in n or "native" in n or ".net" in n or "link" in n]
    lines = {n: code_lines(Path(path).read_text(encoding="utf-8")) for n, path in found["project"].items()}
    assert sum(lines.values()) <= MOST_LINES, lines
