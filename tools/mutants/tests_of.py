"""Which tests run a line or a shader: recorded once, kept outside the repository, carried over to later texts."""

from __future__ import annotations

import ast
import difflib
import json
import os
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from coverage import CoverageData

from tools.mutants.recorder import FOLDER
from tools.mutants.scope import PYTHON, SHADERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

PARTS = {
    "numbers": ("tests/simulator", "tests/tools", "-m", "not slow and not gl"),
    "link": ("tests/hil", "--ignore=tests/hil/board/svd", "-m", "not slow"),
    "commands": ("tests/flyaround", "-m", "not slow"),
    "pictures": ("tests/simulator", "tests/tools", "-m", "not slow and gl"),
}
"""What is recorded, one run each. Left out: the window (tests/gui), the wheel (tests/packaging) and the
estimator's tests, which hardly touch what bugs are planted in and are the slowest."""
_NOT_ASKED = ("tests/gui", "tests/packaging", "tests/hil/board/svd/", "tests/tools/test_mutants")
_MADE_ONCE = 20
_CONSTANT = re.compile(r"(_?[A-Z]\w*)\b.*=")
_UNKNOWN_S = 2.0
"""A test that was not recorded is taken to last this long."""


def record(root: Path, kept: Path, parts: Iterable[str] = tuple(PARTS)) -> None:
    """Run the fast suite under coverage, and keep which test ran what.

    Parameters
    ----------
    root : a tree that nobody edits meanwhile. kept : a folder; a part that stands there is not run again.
    """
    for part in parts:
        folder = kept / part
        if (folder / "tests.json").exists():
            continue
        folder.mkdir(parents=True, exist_ok=True)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "tools.mutants.recorder",
            "-p",
            "no:cacheprovider",
        ]
        environment = {
            **os.environ,
            FOLDER: str(folder),
            "PYTHONPATH": str(root),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        with (folder / "log.txt").open("w") as log:
            subprocess.run(
                [*command, *PARTS[part]],
                cwd=root,
                env=environment,
                stdout=log,
                stderr=log,
                check=False,
            )
    texts = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for folder in (*PYTHON, SHADERS, "tests")
        for path in sorted((root / folder).rglob("*"))
        if path.suffix in {".py", ".glsl", ".vert", ".frag"}
    }
    (kept / "texts.json").write_text(json.dumps({"root": str(root), "files": texts}), encoding="utf-8")


@dataclass(frozen=True)
class SelectedTests:
    """Tests that may see a bug, most likely first, and how long they take in all [s]."""

    tests: tuple[str, ...]
    seconds: float


class TestsOf:
    """The record, read.

    Parameters
    ----------
    kept : the folder that `record` wrote. root : the tree as it is now.
    """

    __test__ = False

    def __init__(self, kept: Path, root: Path) -> None:
        self._root = root
        told = json.loads((kept / "texts.json").read_text(encoding="utf-8"))
        self._then: dict[str, str] = told["files"]
        self._then_root: str = told["root"]
        self.tests: dict[str, dict[str, Any]] = {}
        self._data = []
        for part in PARTS:
            if (kept / part / "tests.json").exists():
                self.tests |= json.loads((kept / part / "tests.json").read_text(encoding="utf-8"))
                data = CoverageData(str(kept / part / "lines"))
                data.read()
                self._data.append(data)
        self._read: dict[str, dict[int, set[str]]] = {}

    def lines(self, file: str) -> Mapping[int, set[str]]:
        """The tests that run each line of a file as it is now; a line that is new has its neighbour's."""
        if file not in self._read:
            then: dict[int, set[str]] = defaultdict(set)
            for data in self._data:
                for line, contexts in data.contexts_by_lineno(f"{self._then_root}/{file}").items():
                    then[line] |= {c for c in contexts if c in self.tests}
            now = (self._root / file).read_text(encoding="utf-8").splitlines()
            old = self._then.get(file, "").splitlines()
            moved = {
                new + k + 1: was + k + 1
                for was, new, size in difflib.SequenceMatcher(
                    None, old, now, autojunk=False
                ).get_matching_blocks()
                for k in range(size)
            }
            out: dict[int, set[str]] = {}
            last: set[str] = set()
            for line in range(1, len(now) + 1):
                if line in moved:
                    last = then.get(moved[line], set())
                    out[line] = last
                else:
                    out[line] = last
            self._read[file] = _statements(out, now)
        return self._read[file]

    def run(self, file: str) -> bool:
        """Whether any test runs anything of a file."""
        if file.endswith(".py"):
            return any(self.lines(file).values())
        return any(file in self._included(root) for root in self._shader_roots)

    def knows(self, test: str) -> bool:
        """Whether a name is one of a test, as far as is known."""
        return test in self.tests or (self._root / test.split("::", maxsplit=1)[0]).is_file()

    def seconds(self, tests: Iterable[str]) -> float:
        """How long tests take."""
        return sum(self.tests.get(test, {}).get("seconds", _UNKNOWN_S) for test in tests)

    def leave_out(self, tests: Iterable[str]) -> None:
        """Ask these no more."""
        self._silent.update(tests)

    @cached_property
    def _silent(self) -> set[str]:
        return set()

    @cached_property
    def _covers(self) -> dict[str, int]:
        """How many lines each test runs: the fewer, the more it says about each."""
        counts: dict[str, int] = defaultdict(int)
        for data in self._data:
            for file in data.measured_files():
                for contexts in data.contexts_by_lineno(file).values():
                    for context in contexts:
                        counts[context] += 1
        return counts

    def of_line(self, file: str, line: int, budget_s: float) -> SelectedTests:
        """Tests for a bug in a line of Python, as many as the time allows."""
        lines = self.lines(file)
        run = set(lines.get(line, ()))
        if not run:  # run at import: those that use its name, else those that run anything of this file
            run = self._by_name(file, line) or set().union(*lines.values())
        return self._ranked(run, file, budget_s)

    def of_shader(self, file: str, budget_s: float) -> SelectedTests:
        """Tests that ask for a program which includes a shader."""
        roots = {root for root in self._shader_roots if file in self._included(root)}
        run = {
            name for name, told in self.tests.items() if roots & {f"{SHADERS}/{s}" for s in told["shaders"]}
        }
        if len(run) < _MADE_ONCE:  # asked for when the shared renderer was made: all that draw use it
            run |= {name for name, told in self.tests.items() if told["shaders"]}
        return self._ranked(run, file, budget_s)

    @cached_property
    def _shader_roots(self) -> set[str]:
        return {f"{SHADERS}/{s}" for told in self.tests.values() for s in told["shaders"]}

    def _included(self, file: str) -> set[str]:
        path = self._root / file
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        names = re.findall(r'#include\s+"([^"]+)"', text)
        return {file}.union(*(self._included(f"{SHADERS}/{name}") for name in names))

    def _by_name(self, file: str, line: int) -> set[str]:
        text = (self._root / file).read_text(encoding="utf-8").splitlines()
        at = line - 1
        while at > 0 and not (match := _CONSTANT.match(text[at])):
            at -= 1
        match = _CONSTANT.match(text[at])
        if match is None:
            return set()
        word = re.compile(rf"\b{match.group(1)}\b")
        found: set[str] = set()
        for other in (f for f in self._then if f.endswith(".py") and f.startswith(PYTHON)):
            if (self._root / other).exists() and word.search(self._then[other]):
                now = (self._root / other).read_text(encoding="utf-8").splitlines()
                covered = self.lines(other)
                found = found.union(*(covered.get(k + 1, ()) for k, t in enumerate(now) if word.search(t)))
        return found

    def _ranked(self, run: set[str], file: str, budget_s: float) -> SelectedTests:
        """The most telling first: those named after the file, then those that run little else, then quick ones."""
        stem = file.rsplit("/", maxsplit=1)[-1].split(".", maxsplit=1)[0]
        words = {w for w in re.split(r"_", stem) if len(w) > 3} | {stem}
        late = self._later_tests(file, run)
        chosen: dict[str, None] = dict.fromkeys(late)
        spent = _UNKNOWN_S * len(late)

        def rank(test: str) -> tuple[float, float]:
            told = self.tests[test]
            named = any(w in test.split("::", maxsplit=1)[0] for w in words)
            return (not named) * 0.5 + self._covers.get(test, 0) / 4000 + told["seconds"] / 20, told[
                "seconds"
            ]

        able = [t for t in run if self.tests[t]["passed"] and self._stands(t) and t not in self._silent]
        for test in sorted(able, key=rank):
            if not chosen or spent + self.tests[test]["seconds"] <= budget_s:
                chosen[test] = None
                spent += self.tests[test]["seconds"]
        chosen = dict.fromkeys(self._asked(test) for test in chosen)
        # one file's tests together, since they share what is made for them
        files = {test.split("::")[0]: k for k, test in reversed(list(enumerate(chosen)))}
        return SelectedTests(tuple(sorted(chosen, key=lambda t: files[t.split("::")[0]])), spent)

    def _stands(self, test: str) -> bool:
        """Whether a recorded test is still in its file."""
        file, _, name = test.partition("::")
        function = name.split("[")[0].split("::")[-1]
        return function in self._functions(file)

    def _asked(self, test: str) -> str:
        """A test as pytest is asked for it: the whole function where its file was edited since."""
        file, _, _ = test.partition("::")
        path = self._root / file
        same = path.exists() and path.read_text(encoding="utf-8") == self._then.get(file)
        return test if same else test.split("[", maxsplit=1)[0]

    def _functions(self, file: str) -> set[str]:
        if file not in self._named:
            path = self._root / file
            text = path.read_text(encoding="utf-8") if path.exists() else ""
            self._named[file] = set(re.findall(r"def (test_\w+)", text))
        return self._named[file]

    @cached_property
    def _named(self) -> dict[str, set[str]]:
        return {}

    @cached_property
    def _later(self) -> dict[str, tuple[str, list[str]]]:
        """Test functions that are newer than the record, with their file's text."""
        out = {}
        for path in sorted((self._root / "tests").rglob("test_*.py")):
            file = path.relative_to(self._root).as_posix()
            text = path.read_text(encoding="utf-8")
            if text != self._then.get(file) and not file.startswith(_NOT_ASKED):
                slow = set(re.findall(r"mark\.slow[^\n]*\n(?:@[^\n]*\n)*def (test_\w+)", text))
                before = set(re.findall(r"def (test_\w+)", self._then.get(file, "")))
                new = sorted(self._functions(file) - before - slow)
                out[file] = (text, [f"{file}::{name}" for name in new])
        return out

    def _later_tests(self, file: str, run: Iterable[str]) -> list[str]:
        """Tests that are newer than the record: those of files that name this one, or that hold a test which runs it.

        Of shaders all that draw.
        """
        dotted = file.removesuffix(".py").replace("/", ".")
        package, _, stem = dotted.rpartition(".")
        told = re.compile(rf"{re.escape(dotted)}\b|from {re.escape(package)} import [^\n]*\b{stem}\b")
        beside = {test.split("::", maxsplit=1)[0] for test in run}
        drawn = not file.endswith(".py")
        return [
            test
            for name, (text, tests) in self._later.items()
            if name in beside or told.search(text) or (drawn and "mark.gl" in text)
            for test in tests
            if test not in self._silent
        ]


def _statements(lines: dict[int, set[str]], text: list[str]) -> dict[int, set[str]]:
    """Lines with each line of a statement run by what runs its first: tracing names few of the others."""
    out = dict(lines)
    try:
        whole = ast.parse("\n".join(text))
    except SyntaxError:
        return out
    for node in ast.walk(whole):
        if isinstance(node, ast.stmt) and not isinstance(
            node,
            ast.FunctionDef
            | ast.AsyncFunctionDef
            | ast.ClassDef
            | ast.If
            | ast.For
            | ast.While
            | ast.With
            | ast.Try,
        ):
            covered = set().union(
                *(lines.get(k, set()) for k in range(node.lineno, (node.end_lineno or 0) + 1))
            )
            for k in range(node.lineno, (node.end_lineno or 0) + 1):
                out[k] = covered
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            # defaults are made at import, and matter where the function is called
            covered = set().union(
                *(lines.get(k, set()) for k in range(node.body[0].lineno, (node.end_lineno or 0) + 1))
            )
            for k in range(node.lineno, node.body[0].lineno):
                out[k] = out.get(k, set()) | covered
        elif isinstance(node, ast.If | ast.While | ast.For | ast.With):
            head = node.body[0].lineno
            covered = set().union(
                *(lines.get(k, set()) for k in range(node.lineno, max(head, node.lineno + 1)))
            )
            for k in range(node.lineno, max(head, node.lineno + 1)):
                out[k] = out.get(k, set()) | covered
    return out
