"""Planted bugs: each changes one thing, what changes no result by rule is left alone, and a judge tells them apart."""

from __future__ import annotations

import ast
import os
import select
import signal
import subprocess
import time
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tools.mutants import judge, python_bugs, shader_bugs
from tools.mutants.__main__ import noticed, table
from tools.mutants.bug import difference
from tools.mutants.scope import LEFT_OUT, files
from tools.mutants.tests_of import SelectedTests

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]


def planted(source: str, kind: str, module=python_bugs) -> list[str]:
    """The second side of each bug's difference."""
    bugs = [bug for bug in module.bugs_of("a", source) if bug.kind == kind]
    after = [difference(source, module.planted(bug, source)) for bug in bugs]
    return [text.split("\n+")[-1] for text in after]


@pytest.mark.parametrize(
    ("source", "kind", "wanted"),
    [
        ("y = a + 2 * b\n", "- for +", ["y = a - 2 * b"]),
        ("y = a + 2 * b\n", "/ for *", ["y = a + 2 / b"]),
        ("y = a[0]\n", "another number", ["y = a[1]", "y = a[(-1)]"]),
        ("y = 4.0\n", "another number", ["y = 8.0", "y = 2.0", "y = 4.4"]),
        ("y = 0.0\n", "another number", []),
        ("y = np.sin(x) @ R.T\n", "another function", ["y = np.cos(x) @ R.T"]),
        ("y = np.sin(x) @ R.T\n", "transpose left out", ["y = np.sin(x) @ R"]),
        ("y = cross(a, b)\n", "arguments swapped", ["y = cross(b, a)"]),
        ("y = max(a, b)\n", "arguments swapped", []),
        ("def f(x):\n    self.check(x)\n    return -x\n", "call left out", ["    None"]),
        ("if a < b:\n    c()\n", "<= for <", ["if a <= b:"]),
        ("for k in ks:\n    c()\n", "loop not run", ["for k in []:"]),
    ],
)  # fmt: skip
def test_a_bug_in_python_changes_one_thing(source: str, kind: str, wanted: list[str]) -> None:
    assert planted(source, kind) == wanted


@pytest.mark.parametrize(
    "source",
    [
        "def f(a: int | None = None) -> Literal[3]:\n    ...\n",
        "if x:\n    raise ValueError(f'{x + 1} is more than {2 * 3}')\n",
        "@dataclass(frozen=True)\nclass A:\n    a: int\n",
        "if TYPE_CHECKING:\n    import a\n",
        "log.warning('so many: %d', 3)\n",
    ],
)
def test_what_alters_no_result_is_left_alone(source: str) -> None:
    kinds = {bug.kind for bug in python_bugs.bugs_of("a", source)}
    assert kinds <= {"condition turned"}


@pytest.mark.parametrize(
    ("source", "kind", "wanted"),
    [
        ("x = 0.5; // 2 of\n", "another number", ["x = 1.0; // 2 of", "x = 0.55; // 2 of"]),
        ("x = a.xy * 0.5;\n", "another swizzle", ["x = a.yx * 0.5;"]),
        ("x = a.z;\n", "another swizzle", ["x = a.x;"]),
        ("if (a < b) c();\n", ">= for <", ["if (a >= b) c();"]),
        ("x = f(-a);\n", "nothing for -", ["x = f(a);"]),
        ("x = max(a, 0.0);\n", "another function", ["x = min(a, 0.0);"]),
        ("layout(location = 0) out vec4 a;\n#if BANDS == 3\n", "another number", []),
        ("for (int i = 0; i < 4; i++) a += b;\n", "- for +", []),
    ],
)  # fmt: skip
def test_a_bug_in_a_shader_changes_one_thing(source: str, kind: str, wanted: list[str]) -> None:
    assert planted(source, kind, shader_bugs) == wanted


def test_every_bug_in_files_of_each_kind_can_be_planted_and_read() -> None:
    names = files(ROOT)
    assert not set(LEFT_OUT) & set(names)
    assert all((ROOT / name).exists() for name in LEFT_OUT)
    for name in ("simulator/world/frames/lvlh.py", "hil/link/framing/cobs.py", "shaders/sky/sun.frag"):
        assert name in names
        source = (ROOT / name).read_text(encoding="utf-8")
        module = python_bugs if name.endswith(".py") else shader_bugs
        bugs = module.bugs_of(name, source)
        assert len({bug.name(source) for bug in bugs}) == len(bugs) > 10
        for bug in islice(bugs, 0, None, 7):
            text = module.planted(bug, source)
            assert text != source
            if name.endswith(".py"):
                ast.parse(text)
                changed = difference(source, text).splitlines()
                assert len(changed) == 2
                assert source.splitlines()[bug.line - 1] == changed[0][1:]


def test_the_table_counts_and_lists_what_nobody_noticed() -> None:
    rows = [
        {"file": "simulator/world/a.py", "line": 3, "kind": "k", "word": word, "asked": 2, "diff": f"-{word}"}
        for word in ("killed", "timeout", "survived", "not covered")
    ]
    text = table(rows)
    assert noticed(rows) == 2
    assert "50%" in text
    assert "-survived" in text
    assert "-not covered" in text
    assert "-killed" not in text


_SMALL = """
def seen(x):
    return x + 1


def unseen(x):
    return x + 2


def counted(x):
    while x > 0:
        x -= 1
    return x
"""
_SMALL_TESTS = """
import small


def test_seen():
    assert small.seen(1) == 2


def test_counted():
    assert small.counted(3) == 0
"""


@pytest.mark.slow
def test_a_judge_tells_what_is_seen_from_what_is_not(tmp_path: Path) -> None:
    """A package of three functions, of which the tests look at one, hang on one and never call one."""
    root, cache = tmp_path / "root", tmp_path / "cache"
    cache.mkdir()
    root.mkdir()
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    (root / "small.py").write_text(_SMALL)
    (root / "test_small.py").write_text(_SMALL_TESTS)
    copy = judge.Copy(tmp_path / "copy", cache)
    copy.make(root)
    heard: dict[str, str] = {}
    changes = {"seen": ("x + 1", "x - 1"), "unseen": ("x + 2", "x - 2"), "counted": ("-= 1", "+= 1")}
    cases = []
    for what, (old, new) in changes.items():
        assert _SMALL.count(old) == 1
        after = _SMALL.replace(old, new)
        bug = python_bugs.Bug("small.py", 1, what, 0)
        # no time at all, so that what hangs is stopped after a minute of the processor
        cases.append(judge.Case(bug, "small.py", _SMALL, after, SelectedTests(("test_small.py",), 0.0)))
    judge.judge(cases, [copy], lambda case, verdict: heard.update({case.what.kind: verdict.word}))
    assert heard == {"seen": "killed", "unseen": "survived", "counted": "timeout"}
    assert (copy.tree / "small.py").read_text() == _SMALL


def test_a_judge_that_is_interrupted_leaves_no_tests_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a test, and a process that it started, that would run for minutes."""
    command = ["sh", "-c", "sleep 100 & echo; wait"]
    with subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE) as tests:
        assert tests.stdout is not None
        tests.stdout.readline()
        under_way = judge.Run(tests.pid, tmp_path / "log.txt", 1, time.monotonic() + 300)
        monkeypatch.setattr(judge, "start", lambda *_: under_way)
        (tmp_path / "tree").mkdir()
        copies = [judge.Copy(tmp_path, tmp_path)] * 2
        with pytest.raises(KeyboardInterrupt):
            judge.judge(_interrupted(), copies, lambda *_: None)
        try:
            # both had it open for writing
            assert select.select([tests.stdout], [], [], 30)[0]
        finally:
            with suppress(ProcessLookupError):
                os.killpg(tests.pid, signal.SIGKILL)


def _interrupted() -> Iterator[judge.Case]:
    bug = python_bugs.bugs_of("a.py", "y = a + b\n")[0]
    yield judge.Case(bug, "a.py", "y = a + b\n", "y = a - b\n", SelectedTests(("a",), 1.0))
    raise KeyboardInterrupt
