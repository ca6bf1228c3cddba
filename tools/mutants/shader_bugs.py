"""Small plausible bugs in GLSL, by its tokens: comments, includes and layouts stay as they are."""

from __future__ import annotations

import re

from tools.mutants.bug import Bug

_TOKEN = re.compile(
    r"(?P<skip>//[^\n]*|/\*.*?\*/|^[ \t]*\#[ \t]*(?:include|if|ifdef|ifndef|elif|else|endif|version|undef)[^\n]*"
    r"|layout[ \t]*\([^)]*\)|\[[ \t]*\d+[ \t]*\]|\bfor[ \t]*\([^\n]*)"
    r"|(?P<swizzle>(?<=\.)[xyzwrgba]{1,4}\b)"
    r"|(?P<number>(?<![\w.])(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?(?![\w.]))"
    r"|(?P<word>[A-Za-z_]\w*(?=[ \t]*\())"
    r"|(?P<two>[<>=!]=|&&|\|\||[-+*/]=|\+\+|--|<<|>>)"
    r"|(?P<one>[-+*/<>])",
    re.DOTALL | re.MULTILINE,
)
_OPERATORS = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": ">=",
    ">": "<=",
    "<=": ">",
    ">=": "<",
    "==": "!=",
    "!=": "==",
    "&&": "||",
    "||": "&&",
    "+=": "-=",
    "-=": "+=",
    "*=": "/=",
}
_FUNCTIONS = {
    "sin": "cos",
    "cos": "sin",
    "min": "max",
    "max": "min",
    "floor": "ceil",
    "ceil": "floor",
    "exp": "exp2",
    "exp2": "exp",
    "log": "log2",
    "sqrt": "abs",
    "inversesqrt": "abs",
    "fract": "abs",
    "normalize": "abs",
    "dFdx": "dFdy",
    "dFdy": "dFdx",
}
_TURNED = str.maketrans("xyzwrgba", "yxwzgrab")


def bugs_of(file: str, source: str) -> list[Bug]:
    """Every bug that could be planted in a shader, each at its own line."""
    return [
        Bug(file, source.count("\n", 0, at) + 1, kind, k)
        for k, (at, _, kind, _) in enumerate(_changes(source))
    ]


def planted(bug: Bug, source: str) -> str:
    """The shader's text with the bug."""
    at, length, _, new = _changes(source)[bug.occurrence]
    return source[:at] + new + source[at + length :]


def _changes(source: str) -> list[tuple[int, int, str, str]]:
    """Where, how many characters, what kind, and what stands there instead."""
    out = []
    for token in _TOKEN.finditer(source):
        at, text = token.start(), token.group()
        if token.lastgroup == "number":
            out += [(at, len(text), "another number", new) for new in _other_numbers(text)]
        elif token.lastgroup == "swizzle" and (new := _other_swizzle(text)) != text:
            out.append((at, len(text), "another swizzle", new))
        elif token.lastgroup == "word" and text in _FUNCTIONS:
            out.append((at, len(text), "another function", _FUNCTIONS[text]))
        elif token.lastgroup in {"one", "two"} and text in _OPERATORS:
            new = _OPERATORS[text]
            if text == "-" and re.search(r"(?:[(,=?:*/<>+]|return)\s*$", source[:at]):
                new = ""  # a sign
            out.append((at, len(text), f"{new or 'nothing'} for {text}", new))
    return out


def _other_numbers(text: str) -> list[str]:
    if text.isdigit():
        return [str(int(text) + 1)]
    value = float(text)
    others = (2 * value, 1.1 * value) if value else (1.0,)
    return [repr(float(f"{other:.9g}")) for other in others]


def _other_swizzle(text: str) -> str:
    """Two components the other way round, or another one: within those that are surely there."""
    if len(text) == 1:
        return text.translate(_TURNED) if text in "xyrg" else text.translate(str.maketrans("zwba", "xzrb"))
    return text[::-1]
