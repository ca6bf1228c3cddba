"""Judge of planted bugs: write one at a time into a copy of the tree and run the tests that may detect it."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

DETECTED = {"killed", "timeout"}
TEST_S, CASE_S = 300.0, 3600.0  # wall-clock limits of one test, and of all tests of one bug
# resident memory, because a limit of the address space stops programs under AddressSanitizer
RESIDENT_BYTES = 12 << 30
_FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)
_OPTIONS = ("-q", "-p", "no:cacheprovider", "--tb=short", "-m", "not slow", "-o", "timeout_method=thread")


@dataclass(frozen=True)
class Case:
    """A bug to judge.

    Parameters
    ----------
    name : str
        Name shown next to the verdict.
    file : str
        Path relative to the root.
    before : str
        Text of the file without the bug.
    after : str
        Text of the file with the bug.
    tests : tuple of str
        Files and folders of tests, the most relevant first.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """Result of the tests for one bug.

    Parameters
    ----------
    word : str
        ``killed``, ``timeout`` (also for memory), ``survived``, ``not covered``, or ``invalid`` for a shader that
        does not compile.
    test : str
        First test that failed; empty if none.
    seconds : float
        Wall-clock time of the tests.
    """

    word: str
    test: str = ""
    seconds: float = 0.0


@dataclass
class Copy:
    """A copy of the tree in which bugs are planted, with the files that its tests create.

    Parameters
    ----------
    folder : Path
        Folder with subfolders ``tree``, ``cache`` and ``temporary``.
    cache : Path
        Warm cache from which each run starts.
    """

    folder: Path
    cache: Path
    _stamp: int = field(default=0)

    @property
    def tree(self) -> Path:
        """Copy of the repository."""
        return self.folder / "tree"

    def make(self, root: Path) -> None:
        """Copy the files that git tracks, and untracked files that it does not ignore."""
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=root,
            check=True,
            capture_output=True,
        )
        for name in filter(None, listed.stdout.decode().split("\0")):
            if (root / name).is_file() or (root / name).is_symlink():
                (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, self.tree / name, follow_symlinks=False)

    def write(self, file: str, text: str) -> None:
        """Replace a file's text and set a new modification time, so that nothing compiled before is reused."""
        path = self.tree / file
        path.write_text(text, encoding="utf-8")
        self._stamp += 1
        os.utime(path, (1_000_000_000 + self._stamp, 1_000_000_000 + self._stamp))

    def start(self, tests: Sequence[str], *options: str) -> Run:
        """Run tests with fresh links to the warm cache, because a bug may have written into it."""
        for name in ("cache", "temporary"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        shutil.copytree(self.cache, self.folder / "cache", copy_function=os.link, symlinks=True)
        (self.folder / "temporary").mkdir()
        environment = os.environ | {
            "FLYAROUND_CACHE_DIR": str(self.folder / "cache"),
            "PYTHONPATH": str(self.tree),
            "TMPDIR": str(self.folder / "temporary"),
        }
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        command = [sys.executable, "-m", "pytest", *_OPTIONS, "-o", f"timeout={TEST_S:g}", *options, *tests]
        log = self.folder / "log.txt"
        with log.open("wb") as out:
            process = subprocess.Popen(
                command,
                cwd=self.tree,
                env=environment,
                stdout=out,
                stderr=out,
                start_new_session=True,
            )
        return Run(process, log)


@dataclass
class Run:
    """Running tests, in a separate session of processes."""

    process: subprocess.Popen[bytes]
    log: Path
    began: float = field(default_factory=time.monotonic)

    def stop(self) -> None:
        """Kill the tests and the processes that they started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def verdict(self) -> Verdict | None:
        """Return the verdict, or None while the tests run.

        Raises
        ------
        RuntimeError
            If the tests were killed by another process.
        """
        code, seconds = self.process.poll(), time.monotonic() - self.began
        if code is None and seconds < CASE_S and self._resident_bytes() < RESIDENT_BYTES:
            return None
        self.stop()
        text = self.log.read_text(encoding="utf-8", errors="replace")
        failed = _FAILED.search(text)
        name = failed.group(1) if failed else ""
        if code is None or "+ Timeout +" in text:
            word = "timeout"
        elif code == -signal.SIGKILL:
            raise RuntimeError("the tests were killed by another process: start again")
        elif "GLSL Compiler failed" in text:
            word = "invalid"
        elif code < 0:
            word, name = "killed", f"signal {-code}"
        elif "ERROR collecting" in text:  # the test file cannot be imported
            word = "killed"
        else:
            word = {0: "survived", 4: "not covered", 5: "not covered"}.get(code, "killed")
        return Verdict(word, name, seconds)

    def _resident_bytes(self) -> int:
        with contextlib.suppress(OSError, IndexError):
            pages = Path(f"/proc/{self.process.pid}/statm").read_text(encoding="ascii").split()[1]
            return int(pages) * os.sysconf("SC_PAGESIZE")
        return 0


@contextlib.contextmanager
def copies(root: Path, n: int) -> Iterator[list[Copy]]:
    """Make copies of a tree with links to the user's cache, and remove them at the end."""
    os.nice(10)
    cache = Path(os.environ.get("FLYAROUND_CACHE_DIR") or user_cache_path("flyaround"))
    cache.mkdir(parents=True, exist_ok=True)
    # hard links to the cache must stay on its disk
    folder = cache.parent / f"flyaround-planted-{os.getpid()}"
    try:
        warm = folder / "cache"
        shutil.copytree(cache, warm, copy_function=_link, ignore=shutil.ignore_patterns("*.lock"))
        trees = [Copy(folder / str(k), warm) for k in range(n)]
        for copy in trees:
            copy.make(root)
        yield trees
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _link(source: str, to: str) -> None:
    """Link a file of the user's cache, which other processes may remove at any time."""
    with contextlib.suppress(FileNotFoundError):
        os.link(source, to)


def judge(cases: Iterable[Case], copies: Sequence[Copy], report: Callable[[Case, Verdict], None]) -> None:
    """Judge every case, one at a time in each copy; no test keeps running when this returns or raises.

    Parameters
    ----------
    cases : iterable of Case
        Bugs to judge.
    copies : sequence of Copy
        Copies of the tree, one for each concurrent case.
    report : callable
        Function called with each verdict.
    """
    waiting = iter(cases)
    busy: list[tuple[Copy, Case, Run]] = []
    free = list(copies)
    over = False
    try:
        while busy or not over:
            while free and not over:
                case = next(waiting, None)
                if case is None:
                    over = True
                else:
                    copy = free.pop()
                    copy.write(case.file, case.after)
                    busy.append((copy, case, copy.start(case.tests, "-x")))
            for entry in list(busy):
                copy, case, run = entry
                verdict = run.verdict()
                if verdict is not None:
                    busy.remove(entry)
                    copy.write(case.file, case.before)
                    free.append(copy)
                    report(case, verdict)
                    say(f"{verdict.word:11s} {verdict.seconds:5.0f} s  {case.name}  {verdict.test}")
            time.sleep(0.1)
    finally:
        # a separate session does not receive Ctrl-C
        for _, _, run in busy:
            run.stop()


def failing(copy: Copy, verdicts: Iterable[Verdict]) -> set[str]:
    """Return the tests that detected a bug and also fail without one, in an unchanged copy."""
    blamed = sorted({v.test for v in verdicts if v.word in DETECTED and v.test.startswith("tests/")})
    if not blamed:
        return set()
    run = copy.start(blamed)
    while run.verdict() is None:
        time.sleep(0.5)
    failed = set(_FAILED.findall(run.log.read_text(encoding="utf-8", errors="replace"))) & set(blamed)
    for test in sorted(failed):
        say(f"{test} fails without any bug")
    return failed


def mirrored(file: str) -> str:
    """Return the folder of tests that mirrors the package of a file."""
    parts = Path(file).parts
    return "tests/simulator/render" if parts[0] == "shaders" else "/".join(("tests", *parts[:2]))


def say(text: str) -> None:
    """Print a line with the time of day."""
    sys.stdout.write(f"{time.strftime('%H:%M:%S')} {text}\n")
    sys.stdout.flush()
