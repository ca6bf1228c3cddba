"""A recorded flight: sampled states of both craft, and the tracks that replay them."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.runtime.sections import DirectionXyz
from flyaround.simulator.runtime.untrusted_files import decode_text, read_regular
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.frames.rotation import quat_conjugate, quat_from_rotvec, quat_multiply
from flyaround.simulator.world.guidance.chaser import Chaser
from flyaround.simulator.world.guidance.manual_control import ChaserState
from flyaround.simulator.world.orbit.propagation import OrbitTrack

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.orbit.forces import ForceModel
    from flyaround.simulator.world.time.instant import Instant

_FIELDS = {
    "t_s": 1,
    "r_target_eci_m": 3,
    "v_target_eci_m_s": 3,
    "q_eci_from_target_wxyz": 4,
    "omega_target_rad_s": 3,
    "relative_eci_m": 3,
    "relative_eci_m_s": 3,
    "q_camera_from_eci_wxyz": 4,
    "omega_camera_rad_s": 3,
}
"""Arrays of the file and their widths, named as in `WorldState`."""
NUMBERS = sum(_FIELDS.values())
"""Number of values of one state."""
CSV_SUFFIX = ".csv"
"""Suffix of a recording as text lines, which grows during the flight; others are npz files."""
MAX_BYTES = 2**29
"""Largest size of a recording, packed or unpacked: three million samples."""
_DAMAGED = (
    KeyError,
    ValueError,
    TypeError,
    EOFError,
    RuntimeError,
    MemoryError,
    struct.error,
    zlib.error,
    zipfile.BadZipFile,
)
"""Exceptions that NumPy, zipfile and zlib raise for a damaged or unusual file (encrypted, unknown compression)."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of a flight.

    Parameters
    ----------
    arrays : dict
        Times (n,) and the quantities (n, width) of `WorldState`, by name.
    """

    arrays: dict[str, FloatArray]

    @staticmethod
    def from_states(states: Iterable[WorldState]) -> Recording:
        """Build a recording from states in order of time.

        Returns
        -------
        Recording
            One sample a state, in their order. The times are not checked.
        """
        rows = list(states)
        return Recording({name: np.array([getattr(s, name) for s in rows], float) for name in _FIELDS})

    @staticmethod
    def from_rows(numbers: Sequence[float]) -> Recording:
        """Build a recording from the values of `state_row` of successive states, one after another.

        Returns
        -------
        Recording
            One sample for every `NUMBERS` values, in their order. The times are not checked.
        """
        return Recording(_columns(np.array(numbers, float).reshape(-1, NUMBERS)))

    @property
    def duration_s(self) -> float:
        """Time of the last sample [s]."""
        return float(self.arrays["t_s"][-1])

    def to_bytes(self) -> bytes:
        """Encode the recording for a file.

        Returns
        -------
        bytes
            Contents of a compressed npz file of ``arrays``, which `read` accepts.
        """
        file = io.BytesIO()
        np.savez_compressed(file, **self.arrays)  # type: ignore[arg-type]
        return file.getvalue()

    @staticmethod
    def read(path: Path) -> Recording:
        """Read a recording from its file, npz or text.

        Returns
        -------
        Recording
            At least two samples, with finite numbers and times that increase from 0 s. An incomplete last line of a
            text file is left out.

        Raises
        ------
        UserError
            If it cannot be read, is too large, lacks an array, or its times do not start at 0 and increase.
        """
        try:
            data = read_regular(path, MAX_BYTES)
            arrays = (
                _from_lines(decode_text(data, str(path))) if path.suffix == CSV_SUFFIX else _from_npz(data)
            )
        except OSError as error:
            raise UserError(f"recording {path} cannot be read: {error.strerror or error}") from error
        except _DAMAGED as error:
            raise UserError(f"{path} is not a recording of a flight: {error}") from error
        t = arrays["t_s"]
        if t.ndim != 1:
            raise UserError(f"recording {path} has times in {t.ndim} dimensions, not in one; record it again")
        shapes = {name: (len(t),) if width == 1 else (len(t), width) for name, width in _FIELDS.items()}
        if any(arrays[name].shape != shape for name, shape in shapes.items()) or len(t) < 2:
            raise UserError(f"recording {path} has arrays of unequal length, or fewer than two samples")
        if t[0] != 0.0 or np.any(np.diff(t) <= 0) or not all(np.isfinite(a).all() for a in arrays.values()):
            raise UserError(
                f"recording {path} must start at 0 s, increase in time and hold only finite numbers"
            )
        return Recording(arrays)

    def _locate(self, t_s: float) -> tuple[int, float]:
        """Return the sample at or before a time, and the time since it."""
        t = self.arrays["t_s"]
        k = min(max(int(np.searchsorted(t, t_s, side="right")) - 1, 0), len(t) - 1)
        return k, t_s - float(t[k])

    def _interpolate(self, r: str, v: str, t_s: float) -> FloatArray:
        """Return position and velocity (6,): Hermite cubics between samples, a straight line after the last one."""
        k, since_sample = self._locate(t_s)
        p, w = self.arrays[r], self.arrays[v]
        if since_sample == 0.0:
            return np.concatenate([p[k], w[k]])
        if k == len(p) - 1:
            return np.concatenate([p[k] + since_sample * w[k], w[k]])
        h = float(self.arrays["t_s"][k + 1] - self.arrays["t_s"][k])
        x = since_sample / h
        chord = (p[k + 1] - p[k]) / h
        # Hermite cubic as the first sample plus the contributions of the slopes
        a, b = w[k] - chord, w[k + 1] - chord
        position = p[k] + since_sample * chord + since_sample * (1 - x) * ((1 - x) * a - x * b)
        slope = chord + (1 - x) * (1 - 3 * x) * a - x * (2 - 3 * x) * b
        return np.concatenate([position, slope])

    def target(self, t_s: float) -> FloatArray:
        """Interpolate the orbital state of the target.

        Returns
        -------
        (6,) array
            Position [m] and velocity [m s-1] from the Earth's centre, GCRS axes: at a sample bit for bit the
            recorded ones, by Hermite cubics between samples, and along a straight line after the last one.
        """
        return self._interpolate("r_target_eci_m", "v_target_eci_m_s", t_s)

    def target_attitude(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Interpolate the attitude of the target.

        Returns
        -------
        q_eci_from_target_wxyz : (4,) array
            Unit quaternion, scalar first; at a sample a view of the recorded one.
        omega_target_rad_s : (3,) array
            Rate relative to ECI, target axes [rad s-1]: that of the sample at or before ``t_s``, as a view.
        """
        k, d = self._locate(t_s)
        q, w = self.arrays["q_eci_from_target_wxyz"][k], self.arrays["omega_target_rad_s"][k]
        return (q, w) if d == 0.0 else (quat_multiply(q, quat_from_rotvec(w * d)), w)

    def chaser(self, t_s: float) -> ChaserState:
        """Interpolate the state of the chaser and its camera.

        Returns
        -------
        ChaserState
            State at ``t_s`` relative to the target, GCRS axes, interpolated as in `target`. The camera's rate is
            constant between samples.
        """
        y = self._interpolate("relative_eci_m", "relative_eci_m_s", t_s)
        k, d = self._locate(t_s)
        q, w = self.arrays["q_camera_from_eci_wxyz"][k], self.arrays["omega_camera_rad_s"][k]
        if d != 0.0:
            q = quat_multiply(quat_conjugate(quat_from_rotvec(w * d)), q)
        return ChaserState(
            t_s=t_s,
            position_eci_m=vec3(y[:3]),
            velocity_eci_m_s=vec3(y[3:]),
            q_camera_from_eci_wxyz=quat(q),
            omega_camera_rad_s=vec3(w),
        )


class Replay(Chaser, tag_field="mode", tag="replay", frozen=True, kw_only=True):
    """A recorded flight of both craft (path relative to the scenario's folder), with orbit and attitude."""

    file: str
    # of the scenario that was recorded; by default from the target to the end of the recording
    approach_axis_lvlh: DirectionXyz | None = None

    def read(self) -> Recording:
        """Read the recording from ``file``.

        Returns
        -------
        Recording
            The recording, read anew at every call.

        Raises
        ------
        UserError
            If the file is not a recording, as in `Recording.read`.
        """
        return Recording.read(Path(self.file))


@dataclass(frozen=True, eq=False)
class RecordedAttitude:
    """The target's recorded attitude. At a sample it is bit for bit the recorded one."""

    recording: Recording

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` and the body rate [rad s-1]."""
        return self.recording.target_attitude(t_s)


def csv_header() -> str:
    """Return the header line of a CSV recording.

    Returns
    -------
    str
        Names separated by commas, those of vectors and quaternions with their component's number
        (``relative_eci_m_0``), and a line feed.
    """
    names = [f"{name}_{k}" if width > 1 else name for name, width in _FIELDS.items() for k in range(width)]
    return ",".join(names) + "\n"


def state_row(state: WorldState) -> list[float]:
    """Return the recorded values of a state.

    Returns
    -------
    list of float
        `NUMBERS` values in the order of `csv_header`, in the units of `WorldState`.
    """
    return [float(v) for name in _FIELDS for v in np.atleast_1d(getattr(state, name)).tolist()]


def csv_line(row: Sequence[float]) -> str:
    """Format the values of a state as a line of a CSV recording.

    Returns
    -------
    str
        Values separated by commas in the order of ``row``, and a line feed. They read back bit for bit.
    """
    return ",".join(map(repr, row)) + "\n"


def _from_npz(data: bytes) -> dict[str, FloatArray]:
    """Return the arrays of an npz file; raise one of ``_DAMAGED`` if it is not one, or too large unpacked."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > MAX_BYTES:
        raise ValueError(f"unpacked it has {size:,} bytes, and at most {MAX_BYTES:,} are read")
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        return {name: np.asarray(file[name], float) for name in _FIELDS}


def _from_lines(text: str) -> dict[str, FloatArray]:
    """Return the arrays of `csv_header` and the complete lines after it; raise ValueError if they are malformed."""
    first, *rows = text.replace("\r\n", "\n").split("\n")[:-1]  # text after the last line end is incomplete
    if first + "\n" != csv_header():
        raise ValueError("its first line does not name the numbers of a flight")
    return _columns(np.array([row.split(",") for row in rows], float).reshape(-1, NUMBERS))


def _columns(table: FloatArray) -> dict[str, FloatArray]:
    """Return the arrays by name of a table of states."""
    arrays, column = {}, 0
    for name, width in _FIELDS.items():
        arrays[name] = table[:, column] if width == 1 else table[:, column : column + width]
        column += width
    return arrays


@dataclass(frozen=True, eq=False)
class RecordedOrbit:
    """The target's recorded orbit relative to the centre of its central body."""

    recording: Recording
    forces: ForceModel
    epoch: Instant
    body: Body

    def __call__(self, t_s: float) -> FloatArray:
        """Return the position [m] and velocity [m s-1], GCRS axes (6,)."""
        geocentric = self.recording.target(t_s)
        if self.body is EARTH:
            return geocentric
        return geocentric - np.concatenate(self.body.geocentric_state(self.epoch.plus(t_s)))

    def rate(self, t_s: float) -> FloatArray:
        """Return its derivative, from the forces."""
        y = self(t_s)
        return np.concatenate([y[3:], self.forces.target(t_s, y[:3], y[3:])])


def recorded_tracks(
    recording: Recording, forces: ForceModel, duration_s: float, epoch: Instant, body: Body
) -> tuple[OrbitTrack, AttitudeTrack]:
    """Return a recorded target as tracks of orbit and attitude.

    Returns
    -------
    orbit : OrbitTrack
        Orbit relative to the centre of ``body``, GCRS axes [m], [m s-1]; it has no chaser and no burns.
    attitude : RecordedAttitude
        Attitude of the target and its rate [rad s-1].
    """
    return (
        OrbitTrack(forces, duration_s, RecordedOrbit(recording, forces, epoch, body)),
        RecordedAttitude(recording),
    )
