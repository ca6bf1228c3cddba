"""The view as a film: H.264 in an mp4 file, encoded in a thread.

The file gets its name once it is complete; a full disk or a killed console leaves none.
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from flyaround.simulator.errors import UserError, missing_extra, write_error
from flyaround.simulator.runtime.arrays import ByteArray

WAITING = 8
"""Number of pictures queued for the encoder; further ones are dropped and counted."""
CLOCK = Fraction(1, 1000)  # time base of the video: milliseconds
END_S = 30.0
"""Time to wait for the encoder at the end of a film."""


class Film:
    """A film that is being written.

    Parameters
    ----------
    path : Path
        File, whose name ends in .mp4.
    rate_hz : float, optional
        Nominal frame rate; each picture has its own time.

    Raises
    ------
    UserError
        If the encoder is not installed or the file cannot be made.
    """

    def __init__(self, path: Path, rate_hz: float = 30.0) -> None:
        try:
            import av  # noqa: PLC0415 - an optional part
        except ImportError as error:
            raise missing_extra("a film", "gui", error) from error
        if path.suffix != ".mp4":
            raise UserError(f"cannot write '{path.suffix}' films ({path}); end its name in .mp4")
        self.path, self._rate, self._kept = path, Fraction(rate_hz).limit_denominator(1001), True
        self._part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: Any = av.open(str(self._part), "w", format="mp4")
            self._part.touch()  # libav opens the file with its first packet, too late to refuse
        except (OSError, ValueError, av.error.FFmpegError) as error:
            raise UserError(f"cannot write the film {path}: {error}") from error
        self._av: Any = av
        self.pictures = self.left_out = 0
        self.trouble: str | None = None
        self._last_ms = -1
        self._queue: queue.Queue[tuple[int, ByteArray] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._run, name="film", daemon=True)
        self._thread.start()

    def add(self, t_ms: int, image: ByteArray, *, waits: bool = False) -> None:
        """Queue a picture.

        Parameters
        ----------
        t_ms : int
            Presentation time, later than the last.
        image : ByteArray
            (H, W) or (H, W, 3), eight bits.
        waits : bool, optional
            True to wait for the encoder instead of leaving out a picture.
        """
        if self.trouble is not None or t_ms <= self._last_ms:
            return
        try:
            self._queue.put((t_ms, image), waits, END_S)
            self._last_ms = t_ms
        except queue.Full:
            self.left_out += 1

    def close(self, *, keep: bool = True) -> None:
        """Finish the file with the queued pictures, or with ``keep=False`` remove it."""
        self._kept = keep
        with contextlib.suppress(queue.Full):
            self._queue.put(None, timeout=END_S)
        self._thread.join(timeout=END_S)
        if self._thread.is_alive():
            # it continues alone, and names the file if it ends before the console does
            self.trouble = (
                f"the film {self.path} is incomplete: its encoder has not finished after {END_S:g} s"
            )

    def _run(self) -> None:
        stream: Any = None
        first_ms = 0
        try:
            while (item := self._queue.get()) is not None:
                t_ms, image = item
                if stream is None:
                    # even sides, as required by chroma subsampling
                    size = image.shape[1] // 2 * 2, image.shape[0] // 2 * 2
                    stream, first_ms = self._stream(size), t_ms
                rgb = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
                if (rgb.shape[1], rgb.shape[0]) != (stream.width, stream.height):
                    size = (stream.width, stream.height)
                    rgb = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
                frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb), format="rgb24")
                frame.pts, frame.time_base = t_ms - first_ms, CLOCK
                self._file.mux(stream.encode(frame))
                self.pictures += 1
            if stream is not None:
                self._file.mux(stream.encode())
            self._file.close()
            if stream is None or not self._kept:
                self._give_up("no picture came" if stream is None else "it was stopped")
            else:
                self._part.replace(self.path)
        except OSError as error:
            # a full disk ends the film and not the flight
            self._give_up(write_error(self.path, error))
        except (ValueError, MemoryError, self._av.error.FFmpegError) as error:
            # the encoder raises libav's own exceptions
            self._give_up(error)

    def _give_up(self, why: object) -> None:
        """Abandon the film and report why."""
        with contextlib.suppress(OSError, ValueError, self._av.error.FFmpegError):
            self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)
        self.trouble = f"the film {self.path} is not kept: {why}"

    def _stream(self, size: tuple[int, int]) -> Any:  # noqa: ANN401 - libav's own
        stream = self._file.add_stream(
            "libx264", rate=self._rate, options={"preset": "veryfast", "crf": "18"}
        )
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.codec_context.time_base = CLOCK
        return stream
