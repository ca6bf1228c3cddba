"""Terms of a run, run.json: scenario and target, software and board, and the run's settings."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal

import cv2
import msgspec
import numpy as np

from flyaround.hil.host.link_process.ipc import Board
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_document
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.runtime.urls import without_secrets
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario

RUN_JSON = "run.json"
# Maximum size of an accepted run.json [bytes], which holds a scenario's text: 16 times the largest (MAX_TOML_BYTES).
MAX_BYTES = 1 << 24


class ScenarioRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Scenario: its name, its text without secrets in URLs, and the SHA-256 of its file.

    The text is that of the TOML file, or a JSON document if the scenario was made by a program.
    """

    name: str
    text: str
    sha256: str

    @staticmethod
    def from_scenario(scenario: Scenario, source: bytes = b"") -> ScenarioRecord:
        """Return the record of a scenario that was read from a file or made by a program.

        Returns
        -------
        ScenarioRecord
            Record of the text in ``source``, or of the scenario as JSON if that is empty. The hash is that of the text
            with its secrets.
        """
        data = source or msgspec.json.encode(scenario, enc_hook=str)
        return ScenarioRecord(
            name=scenario.name,
            text=without_secrets(data.decode(errors="replace")),
            sha256=hashlib.sha256(data).hexdigest(),
        )


class Versions(msgspec.Struct, frozen=True, kw_only=True):
    """Software versions of the host; ``gl_renderer`` is the graphics driver, empty if nothing was rendered."""

    flyaround: str
    python: str
    numpy: str
    opencv: str
    gl_renderer: str = ""

    @staticmethod
    def here(gl_renderer: str = "") -> Versions:
        """Return the versions of this process.

        Returns
        -------
        Versions
            Versions of Flyaround, Python, NumPy and OpenCV, with the given graphics driver.
        """
        return Versions(
            flyaround=version("flyaround"),
            python=platform.python_version(),
            numpy=np.__version__,
            opencv=cv2.__version__,
            gl_renderer=gl_renderer,
        )


class Provenance(msgspec.Struct, frozen=True, kw_only=True):
    """Origin of a run's frames: scenario, seed, target with the hash of its model, and command line."""

    scenario: ScenarioRecord
    seed: int
    target: str
    target_sha256: str
    command: tuple[str, ...] = ()

    @staticmethod
    def from_plan(plan: Plan, source: bytes = b"", command: Sequence[str] = ()) -> Provenance:
        """Return the provenance of a plan's frames.

        Parameters
        ----------
        plan : Plan
            Plan of the flight.
        source : bytes, optional
            Contents of the scenario file.
        command : sequence of str, optional
            Words of the command line.

        Returns
        -------
        Provenance
            Scenario, seed, target and versions.
        """
        return Provenance(
            scenario=ScenarioRecord.from_scenario(plan.scenario, source),
            seed=plan.seed,
            target=plan.target.name,
            target_sha256=plan.target.sha256,
            command=tuple(without_secrets(word) for word in command),
        )


class RunTerms(msgspec.Struct, frozen=True, kw_only=True):
    """Terms of a run, written when its ledger is opened, so that a killed run is documented.

    ``board``, the driver in ``versions`` and ``sun_sent`` are added once the first board is ready. Keys are never
    recorded.
    """

    schema: Literal["flyaround.run"] = "flyaround.run"
    version: Literal[1] = 1
    started_utc: str
    mode: Literal["lockstep", "realtime"]
    truth: Literal["off", "separate", "inline"]
    url: str
    timeout_s: float
    deadline_ms: float | None = None
    latency_ms: float | None = None
    scenario: ScenarioRecord | None = None
    seed: int | None = None
    target: str = ""
    target_sha256: str = ""
    command: tuple[str, ...] = ()
    faults: Faults = NO_FAULTS
    sun_sent: bool = False
    versions: Versions | None = None
    board: Board | None = None


def run_terms(provenance: Provenance | None, **terms: Any) -> RunTerms:  # noqa: ANN401 - fields of RunTerms
    """Return the terms of a run of this process, from the plan and the other fields of ``RunTerms``."""
    record = {} if provenance is None else msgspec.structs.asdict(provenance)
    return RunTerms(versions=Versions.here(), **record, **terms)


def terms_without_board(provenance: Provenance, faults: Faults, started_utc: str) -> RunTerms:
    """Return the terms of a closed loop that sends no frames.

    Returns
    -------
    RunTerms
        Terms with an empty URL, in lockstep, without a time-out.
    """
    terms = {"mode": "lockstep", "truth": "off", "url": "", "timeout_s": 0.0}
    return run_terms(provenance, faults=faults, started_utc=started_utc, **terms)


def write_terms(folder: Path, terms: RunTerms) -> None:
    """Write ``run.json``.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_document(folder / RUN_JSON, terms)


def read_terms(folder: Path) -> RunTerms | None:
    """Read the terms of a ledger folder.

    Returns
    -------
    RunTerms or None
        Terms of the run; None for older ledgers without this file.

    Raises
    ------
    UserError
        If the file is damaged.
    """
    path = folder / RUN_JSON
    if not path.exists():
        return None
    try:
        return msgspec.json.decode(read_regular(path, MAX_BYTES), type=RunTerms)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): make it readable") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{path} is not the terms of a run of this version: {error}") from error
