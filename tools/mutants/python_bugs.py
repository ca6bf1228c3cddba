"""Small plausible bugs in Python: cosmic-ray's operators, and those of numerical code that it has not."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import MutationVisitor
from cosmic_ray.operators.operator import Operator
from parso.python import tree

from tools.mutants.bug import Bug

if TYPE_CHECKING:
    from collections.abc import Iterator

    Position = tuple[int, int]

_SWAPPED = {
    "sin": "cos",
    "cos": "sin",
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "floor": "ceil",
    "ceil": "floor",
    "rint": "floor",
    "argmin": "argmax",
    "argmax": "argmin",
    "any": "all",
    "all": "any",
    "sqrt": "cbrt",
    "radians": "degrees",
    "degrees": "radians",
    "vstack": "hstack",
    "ones": "zeros",
    "zeros": "ones",
    "mean": "max",
}
_EITHER_WAY = {
    "min",
    "max",
    "minimum",
    "maximum",
    "hypot",
    "isclose",
    "allclose",
    "array_equal",
    "dot",
    "gcd",
}
_WHOLE_NUMBERS = (lambda n: n + 1, lambda n: n - 1)
_FACTORS = (2.0, 0.5, 1.1)


class _OneWay(Operator):  # type: ignore[misc]
    """An operator whose examples are in its tests."""

    @classmethod
    def examples(cls) -> tuple[Any, ...]:
        return ()


class Number(_OneWay):
    """A whole number off by one; a fraction twice, half or a tenth more of what it was."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:  # noqa: ANN401
        """One for each way to change a number."""
        if isinstance(node, tree.Number):
            value = ast.literal_eval(node.value)
            ways = _WHOLE_NUMBERS if isinstance(value, int) else _FACTORS
            if isinstance(value, complex) or not value * 1.1 < float("inf"):
                return
            for way in ways:
                if isinstance(value, int) or value * way != value:
                    yield (node.start_pos, node.end_pos)

    def mutate(self, node: Any, index: int) -> Any:  # noqa: ANN401
        """Write the other number, with what stood before it."""
        value = ast.literal_eval(node.value)
        new = _WHOLE_NUMBERS[index](value) if isinstance(value, int) else value * _FACTORS[index]
        text = f"({new})" if new < 0 else str(new) if isinstance(new, int) else repr(float(f"{new:.12g}"))
        return tree.Number(text, node.start_pos, prefix=node.prefix)


class SwappedFunction(_OneWay):
    """Another function of the same form: sin for cos, min for max."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:  # noqa: ANN401
        """Where such a function is called."""
        after = node.get_next_leaf() if isinstance(node, tree.Name) else None
        if after is not None and node.value in _SWAPPED and after.value == "(":
            yield (node.start_pos, node.end_pos)

    def mutate(self, node: Any, index: int) -> Any:  # noqa: ANN401, ARG002
        """Write the other name."""
        return tree.Name(_SWAPPED[node.value], node.start_pos, prefix=node.prefix)


class NotTransposed(_OneWay):
    """A matrix the other way round: ``.T`` left out."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:  # noqa: ANN401
        """Where a transpose is taken."""
        if node.type == "trailer" and [getattr(c, "value", "") for c in node.children] == [".", "T"]:
            yield (node.start_pos, node.end_pos)

    def mutate(self, node: Any, index: int) -> None:  # noqa: ANN401
        """Leave it out."""


class SwappedArguments(_OneWay):
    """The first two arguments of a call, the other way round."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:  # noqa: ANN401
        """Calls with two arguments by place that differ."""
        if node.type == "arglist" and node.parent.type == "trailer":
            given = node.children[0:3:2]
            plain = all(g.type != "argument" for g in given)
            called = node.parent.get_previous_leaf()
            if called is not None and called.value in _EITHER_WAY:
                return
            if len(given) == 2 and plain and given[0].get_code().strip() != given[1].get_code().strip():
                yield (node.start_pos, node.end_pos)

    def mutate(self, node: Any, index: int) -> Any:  # noqa: ANN401, ARG002
        """Swap them."""
        first, second = node.children[0], node.children[2]
        leaves = first.get_first_leaf(), second.get_first_leaf()
        leaves[0].prefix, leaves[1].prefix = leaves[1].prefix, leaves[0].prefix
        node.children[0], node.children[2] = second, first
        return node


class LeftOut(_OneWay):
    """A call made for what it does, left out."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:  # noqa: ANN401
        """Statements that are a call."""
        if node.type == "simple_stmt":
            only = node.children[0]
            if only.type == "atom_expr" and only.children[-1].get_code().startswith("("):
                yield (only.start_pos, only.end_pos)

    def mutate(self, node: Any, index: int) -> Any:  # noqa: ANN401, ARG002
        """Do nothing instead."""
        only = node.children[0]
        node.children[0] = tree.Name("None", only.start_pos, prefix=only.get_first_leaf().prefix)
        return node


_LIBRARY = {
    **{
        f"{a} for {b}": f"core/ReplaceBinaryOperator_{y}_{x}"
        for a, b, y, x in (
            ("-", "+", "Add", "Sub"),
            ("+", "-", "Sub", "Add"),
            ("/", "*", "Mul", "Div"),
            ("*", "/", "Div", "Mul"),
            ("*", "**", "Pow", "Mul"),
            ("/", "//", "FloorDiv", "Div"),
            ("//", "%", "Mod", "FloorDiv"),
            ("|", "&", "BitAnd", "BitOr"),
            ("&", "|", "BitOr", "BitAnd"),
            ("<<", ">>", "RShift", "LShift"),
            (">>", "<<", "LShift", "RShift"),
        )
    },
    **{
        f"{a} for {b}": f"core/ReplaceComparisonOperator_{y}_{x}"
        for a, b, y, x in (
            ("<=", "<", "Lt", "LtE"),
            ("<", "<=", "LtE", "Lt"),
            (">=", ">", "Gt", "GtE"),
            (">", ">=", "GtE", "Gt"),
            ("the other of", "<", "Lt", "GtE"),
            ("the other of", ">", "Gt", "LtE"),
            ("!=", "==", "Eq", "NotEq"),
            ("==", "!=", "NotEq", "Eq"),
            ("is not", "is", "Is", "IsNot"),
            ("is", "is not", "IsNot", "Is"),
        )
    },
    "sign left out": "core/ReplaceUnaryOperator_Delete_USub",
    "not left out": "core/ReplaceUnaryOperator_Delete_Not",
    "~ left out": "core/ReplaceUnaryOperator_Delete_Invert",
    "condition turned": "core/AddNot",
    "False for True": "core/ReplaceTrueWithFalse",
    "True for False": "core/ReplaceFalseWithTrue",
    "or for and": "core/ReplaceAndWithOr",
    "and for or": "core/ReplaceOrWithAnd",
    "continue for break": "core/ReplaceBreakWithContinue",
    "break for continue": "core/ReplaceContinueWithBreak",
    "loop not run": "core/ZeroIterationForLoop",
}
_OWN: dict[str, type[Operator]] = {
    "another number": Number,
    "another function": SwappedFunction,
    "transpose left out": NotTransposed,
    "arguments swapped": SwappedArguments,
    "call left out": LeftOut,
}


def _operators() -> dict[str, Operator]:
    library = {kind: cosmic_ray.plugins.get_operator(name)() for kind, name in _LIBRARY.items()}
    return {**library, **{kind: operator() for kind, operator in _OWN.items()}}


def bugs_of(file: str, source: str) -> list[Bug]:
    """Every bug that could be planted in a file, without those that change nothing by rule (see `_quiet`)."""
    quiet = _quiet(source)
    whole = list(ast_nodes(get_ast(source)))
    found = []
    for kind, operator in _operators().items():
        at = [place for node in whole for place in operator.mutation_positions(node)]
        for occurrence, (start, _) in enumerate(at):
            if not any(low <= start < high for low, high in quiet):
                found.append(Bug(file, start[0], kind, occurrence))
    return found


def planted(bug: Bug, source: str) -> str:
    """The file's text with the bug."""
    return str(MutationVisitor.mutate_code(source, _operators()[bug.kind], bug.occurrence))


_QUIET_DECORATORS = {
    "cache",
    "lru_cache",
    "dataclass",
    "property",
    "staticmethod",
    "classmethod",
    "runtime_checkable",
}
_QUIET_CALLS = {"warn", "print", "debug", "info", "warning", "add_task", "set_description"}
_QUIET_KEYWORDS = {
    "strict",
    "frozen",
    "slots",
    "eq",
    "kw_only",
    "indent",
    "encoding",
    "repr",
    "stacklevel",
    "daemon",
}


def _quiet(source: str) -> list[tuple[Position, Position]]:
    """Stretches of a file where a change alters no result.

    Type hints (never evaluated here), what a refusal says, ``TYPE_CHECKING`` and ``__main__`` blocks, ``__all__``,
    decorators that save time or declare a form, messages and progress, keywords of layout or of guards (``strict``).
    """
    lines = source.splitlines()
    out = []

    def leave(node: ast.AST | None) -> None:
        if node is not None and (end := getattr(node, "end_lineno", None)) is not None:
            low = (node.lineno, len(lines[node.lineno - 1].encode()[: node.col_offset].decode()))  # type: ignore[attr-defined]
            high = (end, len(lines[end - 1].encode()[: node.end_col_offset].decode()))  # type: ignore[attr-defined]
            out.append((low, high))

    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.arg(annotation=hint):
                leave(hint)
            case ast.AnnAssign(annotation=hint):
                leave(hint)
            case ast.Raise():
                leave(node)
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                leave(node)
            case ast.If(test=ast.Compare(left=ast.Name(id="__name__"))):
                leave(node)
            case ast.Assign(targets=[ast.Name(id="__all__")]):
                leave(node)
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in _QUIET_CALLS:
                leave(node)
            case ast.keyword(arg=name) if name in _QUIET_KEYWORDS:
                leave(node)
            case ast.JoinedStr():
                leave(node)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            leave(node.returns)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            for decorator in node.decorator_list:
                named = decorator.func if isinstance(decorator, ast.Call) else decorator
                if getattr(named, "id", getattr(named, "attr", "")) in _QUIET_DECORATORS:
                    leave(decorator)
    return out
