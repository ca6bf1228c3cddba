"""Figures of the code's structure: lines, files of a folder, import circles, small files, unused names, long functions.

python tools/structure.py [--json] [--list]: run it in two states of the code to compare them.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path

PACKAGES = ("flyaround", "simulator", "gui", "hil", "shaders", "assets")
"""What goes into the wheel."""
SMALL_LINES = 60
COLD_STARTS = 5
CODE = (".py", ".c", ".h", ".glsl", ".vert", ".frag")


def tracked() -> list[Path]:
    """The files of the checkout."""
    names = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=True).stdout.split("\n")
    return [Path(name) for name in names if name and Path(name).is_file()]


def module_of(path: Path) -> str:
    """A file's dotted name."""
    parts = path.with_suffix("").parts
    if parts[0] in PACKAGES[1:]:
        parts = (PACKAGES[0], *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(tree: ast.AST, modules: set[str]) -> set[str]:
    """Modules of the project that a file imports, those for types alone among them."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in modules}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.add(whole if whole in modules else node.module)
    return found & modules


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other (Tarjan's strongly connected components of two and more)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def wheel_bytes() -> int:
    """Size of the wheel."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "-o", folder]
        subprocess.run(command, capture_output=True, check=True)
        return next(Path(folder).glob("*.whl")).stat().st_size


def cold_import_s() -> float:
    """The least time of some starts of Python with ``import flyaround`` and its first names used [s]."""
    code = "import flyaround as fa; fa.load_scenario, fa.plan_flight, fa.Renderer, fa.estimate, fa.capture"
    times = []
    for _ in range(COLD_STARTS):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - begin)
    return min(times)


def measure() -> tuple[dict[str, object], dict[str, list[str]]]:
    """The figures, and the places behind them."""
    files = tracked()
    ours = [p for p in files if p.parts[0] in PACKAGES]
    python = [p for p in ours if p.suffix == ".py"]
    texts = {p: p.read_text(encoding="utf-8") for p in python}
    trees = {p: ast.parse(text) for p, text in texts.items()}
    modules = {module_of(p) for p in python}
    graph = {module_of(p): imports_of(tree, modules) - {module_of(p)} for p, tree in trees.items()}
    importers: dict[str, set[str]] = defaultdict(set)
    for module, others in graph.items():
        for other in others:
            importers[other].add(module)
    lines = {p: text.count("\n") for p, text in texts.items()}
    small = [
        f"{p} {lines[p]}"
        for p in python
        if p.name != "__init__.py" and lines[p] < SMALL_LINES and len(importers[module_of(p)]) == 1
    ]
    folders = Counter(str(p.parent) for p in python if p.name != "__init__.py")
    functions: list[tuple[int, str, str]] = []
    classes: dict[str, list[str]] = defaultdict(list)
    words: Counter[str] = Counter()
    for p, tree in trees.items():
        words.update(re.findall(r"\w+", texts[p]))
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                functions.append(((node.end_lineno or 0) - node.lineno + 1, f"{p}:{node.name}", node.name))
            if isinstance(node, ast.ClassDef):
                classes[node.name].append(str(p))
    for p in files:
        if p.suffix == ".py" and p.parts[0] in ("tools", "examples", "docs"):
            words.update(re.findall(r"\w+", p.read_text(encoding="utf-8")))
    longest = max(functions)
    unused = [where for _, where, name in functions if words[name] == 1]
    twice = [f"{name}: {', '.join(where)}" for name, where in sorted(classes.items()) if len(where) > 1]
    found = circles(graph)
    figures = {
        "lines of code in the wheel": sum(
            p.read_text(encoding="utf-8").count("\n") for p in ours if p.suffix in CODE
        ),
        "lines of flyaround/": sum(n for p, n in lines.items() if p.parts[0] == "flyaround"),
        "Python files": len(python),
        "files of the largest folder": f"{folders.most_common(1)[0][1]} ({folders.most_common(1)[0][0]})",
        "folders of more than 16 files": sum(n > 16 for n in folders.values()),
        "import circles": len(found),
        f"files under {SMALL_LINES} lines with one importer": len(small),
        "definitions with no caller": len(unused),
        "class names used twice": len(twice),
        "longest function": f"{longest[0]} lines ({longest[1]})",
        "wheel size [MB]": round(wheel_bytes() / 1e6, 2),
        "cold import [s]": round(cold_import_s(), 3),
    }
    places = {
        "circles": [" ".join(group) for group in found],
        "small": small,
        "unused": unused,
        "twice": twice,
        "folders": [f"{n} {name}" for name, n in folders.most_common(20)],
        "long": [f"{n} {where}" for n, where, _ in sorted(functions, reverse=True)[:20]],
    }
    return figures, places


def main() -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--list", action="store_true", help="also the places behind the figures")
    choice = parser.parse_args()
    figures, places = measure()
    if choice.json:
        print(json.dumps(figures, indent=1))
    else:
        for name, value in figures.items():
            print(f"{name:45} {value}")
    if choice.list:
        for name, rows in places.items():
            print(f"\n{name}:", *rows, sep="\n  ")
    return 0


if __name__ == "__main__":
    sys.exit(main())
