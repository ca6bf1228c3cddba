"""Plants bugs one at a time in a throw-away copy of the tree, and runs the tests that may see each."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from tools.mutants.bug import Bug
    from tools.mutants.tests_of import SelectedTests

_LIBRARIES = [
    "numpy",
    "scipy.optimize",
    "scipy.integrate",
    "scipy.spatial.transform",
    "scipy.ndimage",
    "scipy.interpolate",
    "scipy.special",
    "scipy.sparse.linalg",
    "cv2",
    "pytest",
    "msgspec",
    "trimesh",
    "moderngl",
    "typer",
    "rich.progress",
    "erfa",
    "sgp4.api",
    "zstandard",
    "cobs",
    "serial",
    "yaml",
    "OpenEXR",
    "pyrr",  # warns where it is compiled, which would be an error in a test
]
"""Imported once, before the first fork: a judge then starts with them. Not what pytest rewrites (hypothesis)."""
_MEMORY_BYTES = 12 << 30
_TEST_FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)
_BROKEN = 99
_NO_SHADER = "GLSL Compiler failed"


@dataclass(frozen=True)
class Verdict:
    """What the tests said of one bug.

    Parameters
    ----------
    word : killed, timeout, survived, not covered, or invalid (a shader that does not compile). test : the one that
    failed. seconds : by the clock. asked : how many tests were to run.
    """

    word: str
    test: str = ""
    seconds: float = 0.0
    asked: int = 0


@dataclass
class Copy:
    """One tree that bugs are planted in, with what running it leaves behind.

    Parameters
    ----------
    folder : holds ``tree``, ``cache`` and ``compiled``. cache : the warm cache that each run starts from.
    """

    folder: Path
    cache: Path
    _stamp: int = field(default=0)

    @property
    def tree(self) -> Path:
        """The copy of the repository."""
        return self.folder / "tree"

    def make(self, root: Path) -> None:
        """Copy what git knows and what it does not ignore."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.tree.mkdir(parents=True)
        copy_tree(root, self.tree)

    def write(self, file: str, text: str) -> None:
        """Change a file; its time is one that it never had, so that nothing compiled is taken for it."""
        path = self.tree / file
        path.write_text(text, encoding="utf-8")
        self._stamp += 1
        os.utime(path, (1_000_000_000 + self._stamp, 1_000_000_000 + self._stamp))

    def fresh_cache(self) -> Path:
        """The warm cache again, by links: a bug may have written into the last one."""
        own = self.folder / "cache"
        shutil.rmtree(own, ignore_errors=True)
        shutil.copytree(self.cache, own, copy_function=os.link, symlinks=True)
        return own


def copy_tree(root: Path, to: Path) -> None:
    """The repository's files, tracked or new, without what git ignores."""
    said = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root,
        check=True,
        capture_output=True,
    )
    for name in filter(None, said.stdout.decode().split("\0")):
        if (root / name).is_file() or (root / name).is_symlink():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, to / name, follow_symlinks=False)


@dataclass
class Run:
    """Tests under way in a process of their own."""

    pid: int
    log: Path
    asked: int
    until: float
    began: float = field(default_factory=time.monotonic)

    def stop(self) -> None:
        """End the tests and whatever they started."""
        with contextlib.suppress(ProcessLookupError, ChildProcessError):
            os.kill(self.pid, signal.SIGKILL)  # it may not lead its group yet
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)

    def verdict(self) -> Verdict | None:
        """What came of it, or None while it runs."""
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        late = time.monotonic() > self.until
        if not pid and not late:
            return None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)  # a test may leave processes
        if not pid:
            os.waitpid(self.pid, 0)
        seconds = time.monotonic() - self.began
        text = self.log.read_text(encoding="utf-8", errors="replace")
        failed = _TEST_FAILED.search(text)
        name = failed.group(1) if failed else ""
        if late or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU):
            word = "timeout"
        elif os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL:
            raise RuntimeError("the tests were killed from outside: start again, what was judged is kept")
        elif _NO_SHADER in text:
            word = "invalid"
        elif os.WIFSIGNALED(status):
            word, name = "killed", f"signal {os.WTERMSIG(status)}"
        elif os.WEXITSTATUS(status) == _BROKEN:
            raise RuntimeError(f"the tests could not be run at all:\n{text[-2000:]}")
        elif "ERROR collecting" in text:  # its file cannot even be imported
            word = "killed"
        else:
            word = {0: "survived", 4: "not covered", 5: "not covered"}.get(os.WEXITSTATUS(status), "killed")
        return Verdict(word, name, seconds, self.asked)


def load_libraries() -> None:
    """Import what every judge needs, and nothing of this project."""
    for name in _LIBRARIES:
        importlib.import_module(name)


def start(copy: Copy, tests: Sequence[str], seconds: float, *, first_failure: bool = True) -> Run:
    """Run tests in a copy.

    Parameters
    ----------
    tests : as pytest is asked for them. seconds : how long they take; a run has four times that of the processor and
    fifteen times that by the clock, with a minute more.
    """
    log, cache = copy.folder / "log.txt", copy.fresh_cache()
    (copy.folder / "asked.txt").write_text("\n".join(tests), encoding="utf-8")
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        return Run(pid, log, len(tests), time.monotonic() + 120 + 15 * seconds)
    try:
        os.setsid()
        cpu = int(60 + 4 * seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, _MEMORY_BYTES))
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        os.chdir(copy.tree)
        compiled = str(copy.folder / "compiled")
        os.environ.update(
            FLYAROUND_CACHE_DIR=str(cache),
            PYTHONPATH=str(copy.tree),
            PYTHONPYCACHEPREFIX=compiled,
            TMPDIR=_temporary(copy),
        )
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        sys.path[:0] = [str(copy.tree)]
        sys.pycache_prefix, sys.dont_write_bytecode = compiled, False
        import pytest  # noqa: PLC0415 (loaded before the fork)

        options = [
            "-q",
            "-p",
            "no:cacheprovider",
            "--tb=short",
            "-o",
            "timeout=0",
            *(["-x"] if first_failure else []),
        ]
        code = int(pytest.main([*options, f"@{copy.folder / 'asked.txt'}"]))
        sys.stdout.flush()
    except BaseException:  # noqa: BLE001 (whatever it was, this process must not go on as its parent)
        traceback.print_exc()
        sys.stderr.flush()
        code = _BROKEN
    os._exit(code)


def _temporary(copy: Copy) -> str:
    folder = copy.folder / "temporary"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    tempfile.tempdir = str(folder)
    return str(folder)


@dataclass(frozen=True)
class Case:
    """A bug to judge: what it is, its file with and without it, and the tests."""

    what: Bug
    file: str
    before: str
    after: str
    choice: SelectedTests


def judge(cases: Iterable[Case], copies: Sequence[Copy], told: Callable[[Case, Verdict], None]) -> None:
    """Judge every case, one in each copy at a time.

    Parameters
    ----------
    told : called with each verdict as it comes. However this ends, no tests go on running.
    """
    waiting = iter(cases)
    busy: dict[int, tuple[Copy, Case, Run]] = {}
    free = list(copies)
    over = False
    try:
        while busy or not over:
            while free and not over:
                case = next(waiting, None)
                if case is None:
                    over = True
                elif not case.choice.tests:
                    told(case, Verdict("not covered"))
                else:
                    copy = free.pop()
                    copy.write(case.file, case.after)
                    run = start(copy, case.choice.tests, case.choice.seconds)
                    busy[run.pid] = (copy, case, run)
            for pid, (copy, case, run) in list(busy.items()):
                verdict = run.verdict()
                if verdict is not None:
                    del busy[pid]
                    copy.write(case.file, case.before)
                    free.append(copy)
                    told(case, verdict)
            time.sleep(0.1)
    finally:
        # a session of its own hears nothing of Ctrl-C
        for _, _, run in busy.values():
            run.stop()
