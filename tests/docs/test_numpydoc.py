"""Docstrings by numpydoc's rules: parameters in the signature's order with their types, and imperative summaries.

Checks of numpydoc's validation on every docstring of the product: PR02, PR03, PR04, SS05, and, where there is a
Parameters section, PR01. An Attributes section that stands for it is complete, too. A public function or class that
raises says so in a Raises section. RT01 holds for the names of `flyaround` and `flyaround.plugins`, and for those that
one room imports from another: functions, and methods of classes.
"""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("flyaround/cli", "flyaround/runs", "gui", "hil", "simulator", "tools")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")) + sorted(
    (ROOT / "flyaround").glob("*.py")
)
ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : (.*))?$")
# longer ones are sentences
LONGEST_TYPE_WORDS = 14
# imperatives that end like a third person
IMPERATIVES = {"Pass", "Press", "Process"}
# the docstrings of commands are their help texts, and those of tools are for their authors
WITHOUT_RAISES = ("flyaround/cli", "tools")
# rooms that one file imports from another: folders of these two, and the others whole
SPLIT_ROOMS = ("hil", "simulator")
# errors of the program itself, and of a base class
INTERNAL_ERRORS = {"AssertionError", "FrameGraphError", "NotImplementedError"}


def section(doc, title):
    lines = doc.split("\n")
    for number, line in enumerate(lines[:-1]):
        if line == title and set(lines[number + 1]) == {"-"}:
            body = []
            for k in range(number + 2, len(lines)):
                if k + 1 < len(lines) and lines[k] and set(lines[k + 1]) == {"-"}:
                    break
                body.append(lines[k])
            return body
    return None


def arguments(function):
    spec = function.args
    names = [a.arg for a in (*spec.posonlyargs, *spec.args)]
    names += [a.arg for a in (spec.vararg,) if a] + [a.arg for a in spec.kwonlyargs]
    names += [a.arg for a in (spec.kwarg,) if a]
    return [name for name in names if name not in {"self", "cls"}]


def fields(node, classes):
    """Names that the Parameters section of a class may have, in order; None when a base stands elsewhere."""
    names = []
    for base in node.bases:
        name = base.id if isinstance(base, ast.Name) else ""
        if name in classes:
            names += fields(classes[name], classes)
    for statement in node.body:
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and "ClassVar" not in ast.unparse(statement.annotation)
            and "init=False" not in ast.unparse(statement.value or statement.target)
        ):
            names.append(statement.target.id)
        if isinstance(statement, ast.FunctionDef) and statement.name in {"__init__", "__new__"}:
            names = arguments(statement)
    return names


def is_init(statement):
    return isinstance(statement, ast.FunctionDef) and statement.name in {"__init__", "__new__"}


def raises(function):
    """Return True if the function's own code has a raise with an exception that it does not catch itself."""
    left = list(function.body)
    while left:
        node = left.pop()
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            call = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if ast.unparse(call) not in INTERNAL_ERRORS:
                return True
        is_caught = isinstance(node, ast.Try) and node.handlers
        left += [*node.handlers, *node.orelse, *node.finalbody] if is_caught else ast.iter_child_nodes(node)
    return False


def failures(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    for node in ast.walk(tree):
        if not isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        where = f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
        first = (ast.get_docstring(node) or "").partition(" ")[0]
        is_property = any("property" in ast.unparse(decorator) for decorator in node.decorator_list)
        if (
            not isinstance(node, ast.ClassDef)
            and not is_property
            and first.endswith("s")
            and first not in IMPERATIVES
        ):
            yield f"{where}: SS05 the summary begins with an imperative, not {first!r}"
        if (section(ast.get_docstring(node) or "", "Raises") or ["name"])[0].startswith((" ", "If ")):
            yield f"{where}: a Raises section names the exception before its condition"
        if (
            not isinstance(node, ast.ClassDef)
            and not node.name.startswith("_")
            and not path.relative_to(ROOT).as_posix().startswith(WITHOUT_RAISES)
            and ast.get_docstring(node)
            and not first.startswith("Raise")
            and "raises as `" not in ast.get_docstring(node).lower()
            and section(ast.get_docstring(node), "Raises") is None
            and raises(node)
        ):
            yield f"{where}: no Raises section"
        made_by = [
            f
            for f in (node.body if isinstance(node, ast.ClassDef) else [])
            if is_init(f) or (isinstance(f, ast.FunctionDef) and f.name == "__post_init__")
        ]
        if (
            any(map(raises, made_by))
            and not node.name.startswith("_")
            and not path.relative_to(ROOT).as_posix().startswith(WITHOUT_RAISES)
            and ast.get_docstring(node)
            and all(section(ast.get_docstring(n) or "", "Raises") is None for n in (node, *made_by))
        ):
            yield f"{where}: no Raises section for what its construction raises"
        body = section(ast.get_docstring(node) or "", "Parameters")
        listed = section(ast.get_docstring(node) or "", "Attributes")
        if (
            body is None
            and listed is not None
            and "other fields are those of `" not in ast.get_docstring(node)
        ):
            names = {m[1] for line in listed if (m := ENTRY.match(line))}
            missing = [name for name in fields(node, {}) if name not in names and not name.startswith("_")]
            if isinstance(node, ast.ClassDef) and missing and not any(map(is_init, node.body)):
                yield f"{where}: attributes not documented: {missing}"
        if body is None:
            continue
        known = fields(node, classes) if isinstance(node, ast.ClassDef) else arguments(node)
        foreign = isinstance(node, ast.ClassDef) and any(ast.unparse(b) not in classes for b in node.bases)
        order = []
        for number, line in enumerate(body):
            if not line or line.startswith(" "):
                continue
            entry = ENTRY.match(line)
            if entry is None:
                yield f"{where}: not an entry: {line!r}"
                continue
            kind = entry[2]
            described = number + 1 < len(body) and body[number + 1].startswith("    ")
            if not kind or kind.endswith(".") or len(kind.split()) > LONGEST_TYPE_WORDS or not described:
                yield f"{where}: PR04 type on the entry's line, description below it: {line!r}"
            if "," in entry[1]:
                yield f"{where}: one parameter an entry: {line!r}"
            order += [name.strip(" *") for name in entry[1].split(",")]
        extra = [] if foreign else [name for name in order if name not in known]
        if extra:
            yield f"{where}: PR02 no such parameters: {extra}"
        required = fields(node, {}) if isinstance(node, ast.ClassDef) else known
        # ``*_deg`` in the text above the section describes all names with that ending
        endings = tuple(re.findall(r"``\*?(_\w+)``", ast.get_docstring(node) or ""))
        missing = [name for name in required if name not in order and not name.startswith("_")]
        missing = [name for name in missing if not name.endswith(endings)]
        if missing:
            yield f"{where}: PR01 parameters not documented: {missing}"
        listed = [name for name in known if name in order]
        if [name for name in order if name in known] != listed:
            yield f"{where}: PR03 order of the signature is {listed}"


def module_file(module):
    path = ROOT / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def found_definition(module, name):
    """Return `definition`, or None for a constant, a type alias and a module."""
    try:
        return definition(module, name)
    except (LookupError, FileNotFoundError, TypeError):
        return None


def definition(module, name):
    """Return the function or class of that name, followed through imports; the last one, after overloads."""
    body = ast.parse(module_file(module).read_text(encoding="utf-8")).body
    found = [node for node in body if getattr(node, "name", "") == name]
    if found:
        return found[-1]
    for node in body:
        if isinstance(node, ast.ImportFrom) and any(name in (a.name, a.asname) for a in node.names):
            return definition(node.module, name)
    raise LookupError(f"{module} has no {name}")


def public_names():
    for name in ("flyaround", "flyaround.plugins"):
        for node in ast.walk(ast.parse(module_file(name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module.startswith(
                ("flyaround.hil", "flyaround.simulator")
            ):
                yield from ((node.module, alias.name) for alias in node.names)


def returns(function):
    """Return True for a function, no property, that returns a value and is no generator."""
    decorators = " ".join(map(ast.unparse, function.decorator_list))
    is_silent = function.returns is not None and ast.unparse(function.returns) in {"None", "NoReturn"}
    is_generator = any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(function))
    return "property" not in decorators and not is_silent and not is_generator


@pytest.mark.parametrize(("module", "name"), sorted(set(public_names())))
def test_public_functions_say_what_they_return(module, name):
    node = definition(module, name)
    functions = [node] if isinstance(node, ast.FunctionDef) else node.body
    functions = [f for f in functions if isinstance(f, ast.FunctionDef) and not f.name.startswith("_")]
    without = [
        f.name for f in functions if returns(f) and section(ast.get_docstring(f) or "", "Returns") is None
    ]
    assert without == []


def room_of(path):
    parts = path.resolve().relative_to(ROOT).parts
    return parts[:2] if parts[0] in SPLIT_ROOMS else parts[:1]


def imported_names():
    """Return (module, name) of every import from one room into another."""
    names = set()
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("flyaround."):
                continue
            home = module_file(node.module)
            if home.is_file() and room_of(home) != room_of(path):
                names |= {(node.module, alias.name) for alias in node.names if not alias.name.startswith("_")}
    return names


def test_functions_of_other_rooms_say_what_they_return():
    without = set()
    for module, name in imported_names():
        home = module_file(module).resolve().relative_to(ROOT).as_posix()
        node = found_definition(module, name)
        for f in [node] if isinstance(node, ast.FunctionDef) else getattr(node, "body", []):
            if not isinstance(f, ast.FunctionDef) or f.name.startswith("_") or not returns(f):
                continue
            if section(ast.get_docstring(f) or "", "Returns") is None:
                without.add(f"{home}: {f.name}")
    assert sorted(without) == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_parameters_sections_follow_numpydoc(path):
    assert list(failures(path)) == []
