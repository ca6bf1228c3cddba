"""A pytest plugin that writes down which lines and which shaders each test runs, and how long it takes."""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import coverage
from coverage.exceptions import CoverageWarning

if TYPE_CHECKING:
    import pytest

from tools.mutants.scope import PYTHON

FOLDER = "FLYAROUND_MUTANTS_RECORD"
"""Environment variable: where the record goes, as ``lines`` (coverage's own file) and ``tests.json``."""


class CoverageRecorder:
    """One coverage context a test; a test's fixtures count as its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._coverage = coverage.Coverage(
            data_file=str(folder / "lines"), source=list(PYTHON), config_file=False, messages=False
        )
        self._tests: dict[str, dict[str, Any]] = {}
        self._shaders: set[str] = set()

    def start(self) -> None:
        """Trace from here on, and hear which programs are asked for."""
        self._coverage.start()
        from flyaround.simulator.render.gl.programs import ProgramLibrary  # noqa: PLC0415 (traced from its first line)

        get = ProgramLibrary.get

        def heard(library: ProgramLibrary, vertex: str, fragment: str | None, *rest: Any, **more: Any) -> Any:  # noqa: ANN401
            self._shaders.update(name for name in (vertex, fragment) if name is not None)
            return get(library, vertex, fragment, *rest, **more)

        ProgramLibrary.get = heard  # type: ignore[method-assign, assignment]

    def pytest_runtest_protocol(self, item: pytest.Item) -> None:
        """From here on lines are this test's."""
        self._coverage.switch_context(item.nodeid)
        self._shaders.clear()
        self._tests[item.nodeid] = {"seconds": 0.0, "passed": True, "shaders": []}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """How long it took, and whether it can judge at all."""
        told = self._tests[report.nodeid]
        told["seconds"] += report.duration
        told["passed"] = told["passed"] and report.outcome == "passed"
        told["shaders"] = sorted(self._shaders)

    def pytest_sessionfinish(self) -> None:
        """Write both files."""
        self._coverage.stop()
        with warnings.catch_warnings():  # what ran nothing of this is no error here
            warnings.simplefilter("ignore", CoverageWarning)
            self._coverage.save()
        (self._folder / "tests.json").write_text(json.dumps(self._tests), encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """Record where a folder is named."""
    if folder := os.environ.get(FOLDER):
        recorder = CoverageRecorder(Path(folder))
        config.pluginmanager.register(recorder, "flyaround-mutants")
        recorder.start()
