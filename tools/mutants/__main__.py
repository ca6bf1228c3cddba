"""``python -m tools.mutants``: plants a seeded sample of bugs, tells which ones the tests notice."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from platformdirs import user_cache_path

from tools.mutants import judge, python_bugs, shader_bugs
from tools.mutants.bug import Bug, difference
from tools.mutants.scope import PYTHON, SHADERS, files, folder_of
from tools.mutants.tests_of import TestsOf, record

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from types import ModuleType

    from tools.mutants.judge import Case, Copy, Verdict


def draw(root: Path, tests: TestsOf, seed: int, only: Sequence[str] = ()) -> Iterator[Bug]:
    """Bugs in an order that the seed fixes: a line at random, of its kinds one, of its places one.

    Parameters
    ----------
    tests : files that none of them runs are left out. only : beginnings of paths; all unless given.
    """
    at: dict[tuple[str, int], list[Bug]] = {}
    for file in files(root):
        for bug in _kind(file).bugs_of(file, (root / file).read_text(encoding="utf-8")):
            at.setdefault((file, bug.line), []).append(bug)
    chance = random.Random(seed)
    places = sorted(at)
    chance.shuffle(places)
    run: dict[str, bool] = {}
    for place in places:
        kind = chance.choice(sorted({bug.kind for bug in at[place]}))
        bug = chance.choice([bug for bug in at[place] if bug.kind == kind])
        if bug.file not in run:
            wanted = not only or bug.file.startswith(tuple(only))
            run[bug.file] = wanted and tests.run(bug.file)
        if run[bug.file]:
            yield bug


def _is_shader(file: str) -> bool:
    return not file.endswith(".py")


def _kind(file: str) -> ModuleType:
    return shader_bugs if _is_shader(file) else python_bugs


class Results:
    """Verdicts so far, kept as they come: what was broken off goes on where it was."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.of: dict[str, dict[str, object]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                told = json.loads(line)
                self.of[told["name"]] = told

    def add(self, name: str, case: Case, verdict: Verdict, tests: str) -> None:
        """Keep one, with what it was judged by."""
        diff = difference(case.before, case.after)
        told = {"name": name, **asdict(case.what), **asdict(verdict), "diff": diff, "tests": tests}
        self.of[name] = told
        with self._path.open("a", encoding="utf-8") as f:
            f.write(json.dumps(told) + "\n")

    def word(self, name: str) -> str:
        """What came of a bug, or nothing yet."""
        return str(self.of.get(name, {}).get("word", ""))

    def settled(self, name: str, tests: str) -> bool:
        """Whether a bug needs no more judging: it was noticed, or these very tests do not notice it."""
        known = self.of.get(name)
        return known is not None and (
            known["word"] not in {"survived", "not covered"} or known["tests"] == tests
        )

    def blamed_wrongly(self, names: Sequence[str], copy: Copy, tests: TestsOf) -> list[str]:
        """Tests that fail in a copy without any bug; no bug is theirs, and they judge no more."""
        blamed = {str(self.of[name]["test"]) for name in names if self.word(name) == "killed"}
        asked = sorted(name for name in blamed if "::" in name and tests.knows(name))
        run = judge.start(copy, asked, 60.0 + tests.seconds(asked), first_failure=False)
        while (verdict := run.verdict()) is None:
            time.sleep(0.5)
        text = run.log.read_text(encoding="utf-8", errors="replace")
        wrong = [
            name
            for name in asked
            if re.search(rf"^(FAILED|ERROR) {re.escape(name)}( |$)", text, re.MULTILINE)
        ]
        if verdict.word == "timeout":
            wrong = asked
        self.of = {name: told for name, told in self.of.items() if told["test"] not in wrong}
        tests.leave_out(wrong)
        return wrong


def main() -> int:
    """See `--help`."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="how many bugs")
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--only", nargs="*", default=(), help="beginnings of paths; all folders unless given")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds of tests for a bug, as recorded")
    parser.add_argument("--at-once", type=int, default=2, help="bugs judged side by side")
    parser.add_argument(
        "--least", type=float, default=0.8, help="share to be noticed; below it the exit code is 1"
    )
    parser.add_argument(
        "--kept", type=Path, default=user_cache_path("flyaround-mutants"), help="folder of the record"
    )
    parser.add_argument("-o", type=Path, default=Path("out/mutants"), help="where the table goes")
    told = parser.parse_args()
    root, kept = Path.cwd(), told.kept.absolute()
    kept.mkdir(parents=True, exist_ok=True)
    os.nice(10)
    cache = kept / "cache"
    cache.mkdir(exist_ok=True)
    if not (kept / "record" / "texts.json").exists():
        say("recording which test runs what: about twice as long as the fast suite, once")
        copy = judge.Copy(kept / "recorded", cache)
        copy.make(root)
        os.environ["FLYAROUND_CACHE_DIR"] = str(cache)
        record(copy.tree, kept / "record")
    tests = TestsOf(kept / "record", root)
    results = Results(kept / "results.jsonl")
    state = tests_now(root, kept)
    copies = [judge.Copy(kept / f"copy-{os.getpid()}-{k}", cache) for k in range(told.at_once)]
    for copy in copies:
        copy.make(root)
    judge.load_libraries()
    order = [
        (bug.name((root / bug.file).read_text(encoding="utf-8")), bug)
        for bug in draw(root, tests, told.seed, told.only)
    ]
    sample: list[str] = []

    def cases() -> Iterator[Case]:
        sample.clear()
        for name, bug in order:
            if sum(results.word(n) != "invalid" for n in sample) >= told.n:
                return
            sample.append(name)
            if results.settled(name, state):
                continue
            source = (root / bug.file).read_text(encoding="utf-8")
            if _is_shader(bug.file):
                choice = tests.of_shader(bug.file, told.budget)
            else:
                choice = tests.of_line(bug.file, bug.line, told.budget)
            yield judge.Case(bug, bug.file, source, _kind(bug.file).planted(bug, source), choice)

    def heard(case: Case, verdict: Verdict) -> None:
        results.add(case.what.name(case.before), case, verdict, state)
        what = f"{case.file}:{case.what.line} {case.what.kind}"
        say(f"{len(sample):3d} {verdict.word:11s} {verdict.seconds:5.0f} s  {what}  {verdict.test}")

    try:
        judge.judge(cases(), copies, heard)
        for name in results.blamed_wrongly(sample, copies[0], tests):
            say(f"{name} fails without any bug: what it noticed is judged again without it")
        while any(not results.settled(case.what.name(case.before), state) for case in cases()):
            judge.judge(cases(), copies, heard)
    finally:
        for copy in copies:
            shutil.rmtree(copy.folder, ignore_errors=True)
    rows = [results.of[name] for name in sample if results.word(name) != "invalid"]
    told.o.mkdir(parents=True, exist_ok=True)
    report = table(rows)
    (told.o / "mutants.json").write_text(
        json.dumps({"seed": told.seed, "bugs": rows}, indent=1) + "\n", encoding="utf-8"
    )
    (told.o / "mutants.txt").write_text(report, encoding="utf-8")
    say(report)
    return 0 if noticed(rows) >= told.least * len(rows) else 1


def tests_now(root: Path, kept: Path) -> str:
    """A short name of the tests as they are and of what is recorded: a bug that survived others is judged again."""
    whole = hashlib.sha256(repr(sorted(p.parent.name for p in kept.glob("record/*/tests.json"))).encode())
    for path in sorted((root / "tests").rglob("*.py")):
        whole.update(path.read_bytes())
    return whole.hexdigest()[:12]


def say(text: str) -> None:
    """Print with the time."""
    sys.stdout.write(f"{time.strftime('%H:%M:%S')} {text}\n")
    sys.stdout.flush()


WORDS = ("killed", "timeout", "survived", "not covered")
NOTICED = {"killed", "timeout"}


def noticed(rows: Sequence[Mapping[str, Any]]) -> int:
    """How many a test failed on, or never ended with."""
    return sum(row["word"] in NOTICED for row in rows)


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table, then the diff of each that nothing noticed."""
    out = [f"{'':20s}" + "".join(f"{word:>13s}" for word in WORDS) + f"{'noticed':>10s}"]
    for folder in (*PYTHON, SHADERS, "in all"):
        own = [row for row in rows if folder in {"in all", folder_of(row["file"])}]
        if own:
            counts = "".join(f"{sum(r['word'] == word for r in own):13d}" for word in WORDS)
            out.append(f"{folder:20s}{counts}{noticed(own) / len(own):10.0%}")
    for row in sorted(rows, key=lambda r: (r["file"], r["line"])):
        if row["word"] not in NOTICED:
            out += [
                "",
                f"{row['file']}:{row['line']}  {row['kind']}: {row['word']} by {row['asked']} tests",
                row["diff"],
            ]
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    sys.exit(main())
