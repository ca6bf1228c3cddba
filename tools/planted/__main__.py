"""``python -m tools.planted [NAME...]``: plants the bugs of ``bugs.toml`` and tells which ones the tests notice."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shutil
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from platformdirs import user_cache_path

from tools.mutants import judge
from tools.mutants.__main__ import NOTICED, say
from tools.mutants.bug import Bug
from tools.mutants.tests_of import SelectedTests

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tools.mutants.judge import Case, Copy, Verdict

LONGEST_S = 1200.0  # of the tests of one bug, by which the judge sets its limits
_WIDER = {"shaders": "tests/simulator/render"}


class PlantedBug(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A replacement of text in one file.

    Parameters
    ----------
    file : str
        Relative to the root.
    old, new : str
        Text that stands once in the file, and what replaces it.
    wrong : str
        What a user gets, in a sentence.
    first : tuple of str
        Files and folders of tests that are run before the wider ones.
    """

    name: str
    file: str
    old: str
    new: str
    wrong: str
    first: tuple[str, ...]

    @property
    def wider(self) -> str:
        """The folder of tests beside the file's package."""
        parts = Path(self.file).parts
        return _WIDER.get(parts[0], "/".join(("tests", *parts[:2])))

    def planted(self, source: str) -> str:
        """Return the file's text with the bug.

        Raises
        ------
        ValueError
            If the old text is not there, or more than once.
        """
        count = source.count(self.old)
        if count != 1:
            raise ValueError(f"bug {self.name}: its old text stands {count} times in {self.file}")
        return source.replace(self.old, self.new)


def read_bugs() -> tuple[PlantedBug, ...]:
    """Return the bugs in the order of ``bugs.toml``."""
    document = tomllib.loads(Path(__file__).with_name("bugs.toml").read_text(encoding="utf-8"))
    return msgspec.convert(document["bug"], tuple[PlantedBug, ...])


def case_of(root: Path, bug: PlantedBug, tests: Iterable[str]) -> Case:
    """Return what the judge needs: the file with and without the bug, and the tests that are not slow."""
    source = (root / bug.file).read_text(encoding="utf-8")
    line = source[: source.find(bug.old)].count("\n") + 1
    choice = SelectedTests(("-m", "not slow", *tests), LONGEST_S)
    return judge.Case(Bug(bug.file, line, bug.name, 0), bug.file, source, bug.planted(source), choice)


def failing(copy: Copy, tests: Sequence[str]) -> set[str]:
    """Return those of the tests that fail in a copy without any bug."""
    run = judge.start(copy, ("-m", "not slow", *tests), LONGEST_S, first_failure=False)
    while run.verdict() is None:
        time.sleep(0.5)
    text = run.log.read_text(encoding="utf-8", errors="replace")
    return {
        test for test in tests if re.search(rf"^(FAILED|ERROR) {re.escape(test)}( |$)", text, re.MULTILINE)
    }


def _link(source: str, to: str) -> None:
    """Link a file of the user's cache, from which others may take it away meanwhile."""
    with contextlib.suppress(FileNotFoundError):
        os.link(source, to)


def main() -> int:
    """See `--help`."""
    parser = argparse.ArgumentParser(prog="python -m tools.planted", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of bugs; all unless given")
    parser.add_argument("--at-once", type=int, default=2, help="bugs judged side by side")
    parser.add_argument("--narrow", action="store_true", help="run each bug's first tests alone")
    parser.add_argument(
        "--least", type=float, default=0.85, help="share to be noticed; below it the exit code is 1"
    )
    told = parser.parse_args()
    bugs = {bug.name: bug for bug in read_bugs() if not told.names or bug.name in told.names}
    if unknown := set(told.names) - set(bugs):
        parser.error(f"no bug is called {', '.join(sorted(unknown))}")
    root, started, verdicts = Path.cwd(), time.monotonic(), dict[str, "Verdict"]()
    os.nice(10)
    cache = Path(os.environ.get("FLYAROUND_CACHE_DIR") or user_cache_path("flyaround"))
    # links to the cache must stay on its disk
    with tempfile.TemporaryDirectory(dir=cache.parent, prefix="flyaround-planted-") as folder:
        warm = Path(folder) / "cache"
        cache.mkdir(parents=True, exist_ok=True)
        shutil.copytree(cache, warm, copy_function=_link, ignore=shutil.ignore_patterns("*.lock"))
        copies = [judge.Copy(Path(folder) / str(k), warm) for k in range(told.at_once)]
        for copy in copies:
            copy.make(root)
        judge.load_libraries()

        def heard(case: Case, verdict: Verdict) -> None:
            verdicts[case.what.kind] = verdict
            say(f"{verdict.word:11s} {verdict.seconds:5.0f} s  {case.what.kind}  {verdict.test}")

        judge.judge((case_of(root, bug, bug.first) for bug in bugs.values()), copies, heard)
        left = [bugs[name] for name, verdict in verdicts.items() if verdict.word not in NOTICED]
        if not told.narrow:
            judge.judge((case_of(root, bug, [bug.wider]) for bug in left), copies, heard)
        blamed = {v.test for v in verdicts.values() if v.word in NOTICED and v.test.startswith("tests/")}
        wrong = failing(copies[0], sorted(blamed)) if blamed else set()
        for copy in copies:
            shutil.rmtree(copy.folder, ignore_errors=True)
    for test in sorted(wrong):
        say(f"{test} fails without any bug")
    missed = [n for n, v in verdicts.items() if v.word not in NOTICED or v.test in wrong]
    for name in missed:
        say(f"unnoticed: {name}: {bugs[name].wrong}")
    share = 1 - len(missed) / len(bugs)
    say(f"{len(bugs) - len(missed)} of {len(bugs)} noticed, {share:.0%}, {time.monotonic() - started:.0f} s")
    return 0 if share >= told.least else 1


if __name__ == "__main__":
    sys.exit(main())
