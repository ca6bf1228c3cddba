"""Campaign file: cases with seeds, and requirements on their runs. Every error is reported in one sentence."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.method_names import HYBRID, name_in_file
from flyaround.hil.board.methods import check_method_name
from flyaround.hil.campaign.quantities import QUANTITIES
from flyaround.hil.host.link_process.ipc import Compression, PixelFormatName
from flyaround.hil.host.pose_link import PoseLink
from flyaround.simulator.errors import UserError, near_names
from flyaround.simulator.runtime.toml_file import MAX_TOML_BYTES, parse_toml
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.runtime.validation_errors import explain
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults, check_times, read_faults
from flyaround.simulator.scenario.load import load_scenario, scenario_source

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.scenario.scenario import Scenario

# Maximum number of runs of a campaign, against typing errors.
MAX_RUNS = 20_000
Name = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9._-]*$", min_length=1, max_length=60)]
Seed = Annotated[int, msgspec.Meta(ge=0, le=2**31 - 1)]
Seconds = Annotated[float, msgspec.Meta(gt=0, le=3600)]
Comparison = Literal["<=", "<", ">=", ">", "==", "!="]


class SeedRange(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Consecutive seeds."""

    first: Seed = 1
    count: Annotated[int, msgspec.Meta(ge=1, le=MAX_RUNS)]


class LinkSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Connection of a case's board; the fields are options of ``hil host``.

    Attributes
    ----------
    listen : str, optional
        Address for an external board, started by hand. By default, each run starts a board on this machine.
    key : str, optional
        File with the key for an address that other machines can reach, next to the campaign file.
    encoding : str, optional
        Compression of the images.
    pixel_format : str, optional
        Pixel format of the images.
    timeout_s : float, optional
        Time to wait for the board and for each answer.
    max_misses : int, optional
        Number of successive unanswered frames after which the board counts as lost; 0 for no limit.
    """

    listen: Annotated[str, msgspec.Meta(max_length=200)] | None = None
    key: Annotated[str, msgspec.Meta(max_length=200)] | None = None
    encoding: Compression = "auto"
    pixel_format: PixelFormatName = "auto"
    timeout_s: Seconds = 30.0
    max_misses: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)] = 3


class Case(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Case of a campaign, flown once for each seed.

    Attributes
    ----------
    name : str
        Name of the case, which is also that of its output folder.
    scenario : str
        Name of a built-in scenario, or a TOML file next to the campaign file.
    seeds : tuple of int or SeedRange
        Seeds to fly, as a list or as a range.
    closed_loop : bool, optional
        Fly the approach on pose measurements.
    pose : {'board', 'truth', 'noisy'}, optional
        Source of the poses: a board (every frame is rendered), the truth, or the truth with simulated errors.
    method : str, optional
        Estimator of a board that the campaign starts.
    mode : {'lockstep', 'realtime'}, optional
        Pace of the run: wait for each answer, or send at the flight's pace.
    frames : int, optional
        Number of frames, evenly spaced over the flight.
    every_s : Seconds, optional
        Time between frames, instead of their number.
    latency_s : float, optional
        Real time: delay from the end of the exposure to the hand-over of the image.
    deadline_s : Seconds, optional
        Time after which an answer misses the deadline; in real time the frame interval by default.
    link : LinkSettings, optional
        Connection of the board.
    faults : Faults or str, optional
        Faults, inline or as a file next to the campaign file; by default the scenario's. Each run's seed replaces the
        seed of the faults.
    """

    name: Name
    scenario: Annotated[str, msgspec.Meta(min_length=1, max_length=500)]
    seeds: Annotated[tuple[Seed, ...], msgspec.Meta(min_length=1, max_length=MAX_RUNS)] | SeedRange = (1,)
    closed_loop: bool = False
    pose: Literal["board", "truth", "noisy"] = "board"
    method: str = HYBRID
    mode: Literal["lockstep", "realtime"] = "lockstep"
    frames: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)] | None = None
    every_s: Seconds | None = None
    latency_s: Annotated[float, msgspec.Meta(ge=0, le=60)] = 0.0
    deadline_s: Seconds | None = None
    link: LinkSettings = LinkSettings()
    faults: Faults | str | None = None

    @property
    def all_seeds(self) -> tuple[int, ...]:
        """Seeds of all runs."""
        if isinstance(self.seeds, SeedRange):
            return tuple(range(self.seeds.first, self.seeds.first + self.seeds.count))
        return self.seeds

    @property
    def traits(self) -> frozenset[str]:
        """Traits of the case's runs, which some quantities require."""
        has = {"closed_loop"} if self.closed_loop else set()
        if self.pose == "board":
            has |= {"frames", "times"} if self.mode == "realtime" else {"frames"}
        return frozenset(has)


class Requirement(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Requirement on every run of some cases: a quantity of its ledger, compared with a limit.

    Attributes
    ----------
    name : str
        Name of the requirement in reports.
    quantity : str
        Quantity of a run's ledger, one of `QUANTITIES`.
    comparison : str
        Operator between the quantity and the limit.
    limit : float or str
        Limit in the quantity's unit, or one of its words.
    cases : tuple of str, optional
        Names of cases; ``*`` matches any letters.
    """

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=120)]
    quantity: str
    comparison: Comparison
    limit: float | str
    cases: Annotated[tuple[str, ...], msgspec.Meta(min_length=1, max_length=1000)] = ("*",)

    def is_about(self, case: str) -> bool:
        """Return True if the requirement applies to a case."""
        return any(fnmatchcase(case, pattern) for pattern in self.cases)


class Campaign(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Campaign file."""

    name: Name
    title: Annotated[str, msgspec.Meta(max_length=200)] = ""
    case: Annotated[tuple[Case, ...], msgspec.Meta(min_length=1, max_length=5000)]
    requirement: Annotated[tuple[Requirement, ...], msgspec.Meta(min_length=1, max_length=500)]
    schema: Literal["flyaround.campaign"] = "flyaround.campaign"
    version: Literal[1] = 1


@dataclass(frozen=True, eq=False)
class ReadyCase:
    """Case with its files read.

    Parameters
    ----------
    case : Case
        The case.
    scenario : Scenario
        Its scenario.
    source : bytes
        Contents of the scenario file.
    faults : Faults
        Its faults, or those of the scenario.
    key : Path or None
        File of the link's key.
    """

    case: Case
    scenario: Scenario
    source: bytes
    faults: Faults
    key: Path | None


def read_campaign(path: Path) -> tuple[Campaign, tuple[ReadyCase, ...]]:
    """Read a campaign from a TOML file, with the files that its cases name.

    Raises
    ------
    UserError
        If it has an error; the message names file, key, value and allowed values.
    """
    campaign = _parse(path)
    names = [case.name for case in campaign.case]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{path}: two cases are named {name!r}: give each a different name")
    runs = sum(
        case.seeds.count if isinstance(case.seeds, SeedRange) else len(case.seeds) for case in campaign.case
    )
    if runs > MAX_RUNS:
        raise UserError(f"{path} has {runs} runs, at most {MAX_RUNS}: split it into several files")
    for case in campaign.case:
        _check_case(case, f"{path}: case {case.name!r}")
    for requirement in campaign.requirement:
        _check_requirement(requirement, campaign, f"{path}: requirement {requirement.name!r}")
    return campaign, tuple(_ready(case, path) for case in campaign.case)


def _parse(path: Path) -> Campaign:
    try:
        document = parse_toml(read_regular(path, MAX_TOML_BYTES), str(path))
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): name a campaign file") from error
    try:
        campaign = msgspec.convert(document, Campaign)
    except msgspec.ValidationError as error:
        raise UserError(f"{path}: {explain(str(error), document, Campaign)}") from error
    cases = (msgspec.structs.replace(c, method=name_in_file(c.method, path)) for c in campaign.case)
    return msgspec.structs.replace(campaign, case=tuple(cases))


def _check_case(case: Case, source: str) -> None:
    """Raise UserError for contradictory settings.

    Raises
    ------
    UserError
        If settings contradict; the message names the remedy.
    """
    if len(set(case.all_seeds)) < len(case.all_seeds):
        raise UserError(f"{source} has a seed twice: remove one")
    if case.all_seeds[-1] >= 2**31:  # the limit of `Seed`, which the end of a range may exceed
        raise UserError(f"{source} has a seed of 2^31 or more: start lower")
    try:
        check_method_name(case.method)
    except BoardModelError as error:
        raise UserError(f"{source}: {error}") from error
    if case.pose != "board" and not case.closed_loop:
        raise UserError(f'{source} has pose = "{case.pose}", which needs closed_loop = true')
    if case.pose != "board" and (case.mode != "lockstep" or case.link != LinkSettings()):
        raise UserError(f'{source} has pose = "{case.pose}", which uses no board: leave out mode and link')
    if case.closed_loop and case.frames is not None:
        raise UserError(
            f"{source}: a closed loop ends when the chaser arrives: give every_s instead of frames"
        )
    if case.frames is not None and case.every_s is not None:
        raise UserError(f"{source} has frames and every_s: leave one out")
    if case.latency_s and case.mode != "realtime":
        raise UserError(f'{source}: latency_s needs a free-running camera: add mode = "realtime"')
    if case.deadline_s is not None and (case.mode != "realtime" or case.pose != "board"):
        raise UserError(
            f'{source}: deadline_s needs a board that answers in real time: add mode = "realtime"'
        )
    if case.link.key is not None and case.link.listen is None:
        raise UserError(f"{source}: a key is for an external board: add link.listen")


def _check_requirement(requirement: Requirement, campaign: Campaign, source: str) -> None:
    """Raise UserError for a requirement that applies to no case, or on a quantity that its cases do not have.

    Raises
    ------
    UserError
        If so; the message names the remedy.
    """
    quantity = QUANTITIES.get(requirement.quantity)
    if quantity is None:
        near = near_names(requirement.quantity, tuple(QUANTITIES))
        hint = f"did you mean {near[0]}? " if near else ""
        raise UserError(
            f"{source}: unknown quantity {requirement.quantity!r}: {hint}allowed: {', '.join(QUANTITIES)}"
        )
    if quantity.is_text != isinstance(requirement.limit, str):
        kind = f"one of {', '.join(quantity.words)}" if quantity.is_text else "a number"
        raise UserError(f"{source}: limit is {requirement.limit!r}, but {requirement.quantity} is {kind}")
    if quantity.is_text and requirement.comparison not in {"==", "!="}:
        raise UserError(f"{source}: {requirement.quantity} is text: compare it with == or !=")
    if quantity.is_text and requirement.limit not in quantity.words:
        raise UserError(f"{source}: limit is {requirement.limit!r}, allowed: {', '.join(quantity.words)}")
    cases = [case for case in campaign.case if requirement.is_about(case.name)]
    if not cases:
        raise UserError(f"{source} applies to no case: {', '.join(requirement.cases)} matches none")
    for case in cases:
        if not quantity.needs <= case.traits:
            raise UserError(
                f"{source}: case {case.name!r} has no {requirement.quantity}, which needs {quantity.needs_in_words}: "
                "restrict it to other cases with cases = [...]"
            )


def _ready(case: Case, path: Path) -> ReadyCase:
    source, folder = f"{path}: case {case.name!r}", path.parent
    scenario_path = folder / case.scenario
    named = scenario_path if case.scenario.endswith(".toml") else case.scenario
    scenario = load_scenario(named)
    faults = case.faults
    if isinstance(faults, str):
        faults = read_faults(folder / faults)
    elif faults is None:
        faults = scenario.faults or NO_FAULTS
    check_times(faults, source)
    if case.pose != "board":
        try:
            PoseLink.without_pictures(faults)
        except UserError as error:
            raise UserError(f"{source}: {error}") from error
    return ReadyCase(
        case,
        scenario,
        scenario_source(named),
        faults,
        None if case.link.key is None else folder / case.link.key,
    )
