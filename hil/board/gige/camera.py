"""GigE Vision camera client: configuration, software trigger, and access to the newest frame."""

from __future__ import annotations

import contextlib
import threading
from dataclasses import dataclass, replace
from typing import Any, Callable, Optional, Tuple

import numpy as np

from flyaround.hil.board.gige.aravis import NO_PACKET_SOCKET, SUCCESS, AravisError, load_aravis
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.enums import PixelFormat
from flyaround.hil.link.packets.pixels import Image, pixels_bytes, unpack_pixels

SCHEME = "gige://"
# Pixel-format codes with the memory layout of Mono16.
MONO16_CODES = (0x01100005, 0x01100025)  # Mono12, Mono14
GREY_CODES = (*(int(f) for f in PixelFormat if f.channels == 1), *MONO16_CODES)

# Number of image buffers of the stream. More bridge a longer pause of the receiver.
N_BUFFERS = 8
# Number of packets ignored without a complete image above which the stream restarts; other programs cause a few.
MAX_IGNORED_PACKETS = 64

# Longest wait for an image before the thread checks whether it must stop [us].
POP_US = 100_000
# Largest 16-bit block identifier; the next one is 1.
MAX_BLOCK_ID = 0xFFFF
# Largest accepted image [bytes], as on the link.
MAX_PAYLOAD_BYTES = 1 << 27


@dataclass(frozen=True)
class CameraSettings:
    """Settings applied to a camera before it streams; None leaves a feature unchanged.

    Parameters
    ----------
    exposure_us : float, optional
        Exposure time.
    gain_db : float, optional
        Gain.
    rate_hz : float, optional
        Frame rate.
    roi_px : tuple of int, optional
        Region of the detector to read: x, y, width, height.
    pixel_format : str, optional
        GenICam name of the pixel format, such as Mono8.
    packet_bytes : int, optional
        Size of the stream's packets, including IP and UDP headers; 0 for the largest possible.
    software_trigger : bool, optional
        True for one image per software trigger, False for free running.
    packet_socket : bool, optional
        True to receive through a packet socket, whose buffer is larger, if permitted (root).
    """

    exposure_us: Optional[float] = None
    gain_db: Optional[float] = None
    rate_hz: Optional[float] = None
    roi_px: Optional[Tuple[int, int, int, int]] = None
    pixel_format: Optional[str] = None
    packet_bytes: Optional[int] = None
    software_trigger: bool = False
    packet_socket: bool = True


@dataclass(frozen=True)
class CameraFrame:
    """Image received from the camera.

    Parameters
    ----------
    number : int
        Frame number since the start of acquisition, from 0, as counted by the camera.
    image : (H, W) array
        Pixels, uint8 or uint16.
    roi_px : tuple of int
        Region of the detector that the image shows: x, y, width, height.
    camera_time_ns : int
        Time stamp of the camera.
    received_ns : int
        Time of reception, monotonic clock of this machine.
    skipped : int, optional
        Number of complete frames discarded since the previously returned one because a newer one arrived.
    """

    number: int
    image: Image
    roi_px: Tuple[int, int, int, int]
    camera_time_ns: int
    received_ns: int
    skipped: int = 0


class GigeCamera:
    """GigE Vision camera under exclusive control of this program until `close`.

    Parameters
    ----------
    address : str
        IPv4 address, host name, or device name in Aravis's list.
    settings : CameraSettings
        Settings applied before streaming.

    Raises
    ------
    LinkError
        If Aravis is not installed, no camera answers, another program controls it, or a setting is refused.
    """

    def __init__(self, address: str, settings: CameraSettings) -> None:
        self._aravis = load_aravis()
        self._address, self._settings = address, settings
        self._stream: Optional[int] = None
        self._reader: Optional[threading.Thread] = None
        self._stop = threading.Event()
        self._frame_available = threading.Condition()
        self._newest: Optional[CameraFrame] = None
        self._arrived = 0
        self._restarts = 0
        self._has_image = False  # True once a complete image has arrived
        self._count = _BlockCount()
        self.damaged = 0
        """Number of frames discarded because of missing packets."""
        try:
            self._camera = self._aravis("arv_camera_new", address.encode() or None)
        except AravisError as error:
            raise LinkError(
                f"no camera at {SCHEME}{address} ({error}): check its address, and that it accepts this machine"
            ) from error
        try:
            self._check_controls()
            self._set()
            self._check_format()
            self.sensor_px: Tuple[int, int] = self._aravis.sensor_size(self._camera)
        except AravisError as error:
            self._unref()
            raise LinkError(f"camera {address}: {error}") from error
        except LinkError:
            self._unref()
            raise

    @property
    def name(self) -> str:
        """Manufacturer and model of the camera."""
        parts = (self._aravis(f"arv_camera_get_{what}_name", self._camera) for what in ("vendor", "model"))
        return " ".join((text or b"").decode("utf-8", "replace") for text in parts).strip()

    @property
    def roi_px(self) -> Tuple[int, int, int, int]:
        """Region of the detector that is read: x, y, width, height.

        Raises
        ------
        LinkError
            If the camera does not answer.
        """
        try:
            return self._aravis.region(self._camera)
        except AravisError as error:
            raise LinkError(f"camera {self._address} does not report its region: {error}") from error

    @property
    def packet_bytes(self) -> int:
        """Size of the stream's packets, including IP and UDP headers."""
        return int(self._do("gv_get_packet_size"))

    def start(self) -> None:
        """Start the stream, or restart it.

        Raises
        ------
        LinkError
            If the camera refuses, or announces images larger than `MAX_PAYLOAD_BYTES`.
        """
        self.stop()
        arv = self._aravis
        try:
            if not self._settings.packet_socket or self._restarts > 1:
                arv("arv_camera_gv_set_stream_options", self._camera, NO_PACKET_SOCKET)
            payload = arv("arv_camera_get_payload", self._camera)
            if not 0 < payload <= MAX_PAYLOAD_BYTES:
                raise LinkError(
                    f"camera {self._address} announces pictures of {payload} bytes; at most"
                    f" {MAX_PAYLOAD_BYTES >> 20} MiB are accepted: choose a smaller --roi"
                )
            self._stream = arv("arv_camera_create_stream", self._camera, None, None)
            for _ in range(N_BUFFERS):
                arv("arv_stream_push_buffer", self._stream, arv("arv_buffer_new_allocate", payload))
            self._stop.clear()
            self._newest, self._arrived, self._has_image, self._count = None, 0, False, _BlockCount()
            self._reader = threading.Thread(target=self._read, args=(self._stream,), daemon=True)
            self._reader.start()
            arv("arv_camera_start_acquisition", self._camera)
        except AravisError as error:
            self.stop()
            raise LinkError(f"camera {self._address} does not stream: {error}") from error

    @property
    def is_discarding(self) -> bool:
        """True if the stream discards the camera's packets and must be restarted.

        Until its filter is set, a packet socket also receives packets of other programs, which Aravis parses as image
        packets. If such a packet appears to carry one of the next hundred block numbers, Aravis considers all real
        blocks up to that number as late and drops them.
        """
        return (
            self._stream is not None
            and not self._has_image
            and self._statistic("n_ignored_packets") > MAX_IGNORED_PACKETS
        )

    def restart_if_discarding(self) -> bool:
        """Restart the stream if `is_discarding`, the second time without a packet socket. Return True if restarted."""
        if not self.is_discarding:
            return False
        self._restarts += 1
        self.start()
        return True

    def trigger(self) -> None:
        """Send a software trigger, which requests one image.

        Raises
        ------
        LinkError
            If the camera refuses the trigger.
        """
        try:
            self._aravis("arv_camera_software_trigger", self._camera)
        except AravisError as error:
            raise LinkError(f"camera {self._address} refuses the trigger: {error}") from error

    def frame(self, timeout_s: float) -> Optional[CameraFrame]:
        """Return the newest complete frame not returned before, or None after ``timeout_s``."""
        with self._frame_available:
            self._frame_available.wait_for(lambda: self._newest is not None, timeout_s)
            buffer, self._newest = self._newest, None
            skipped, self._arrived = self._arrived - 1, 0
            return None if buffer is None else replace(buffer, skipped=skipped)

    def stop(self) -> None:
        """Stop the stream, if any."""
        self._stop.set()
        if self._reader is not None:
            self._reader.join()
            self._reader = None
        if self._stream is not None:
            with contextlib.suppress(AravisError):  # the camera may be disconnected
                self._aravis("arv_camera_stop_acquisition", self._camera)
            self._aravis("g_object_unref", self._stream)
            self._stream = None

    def close(self) -> None:
        """Stop the stream and release the camera."""
        self.stop()
        self._unref()

    def _unref(self) -> None:
        if self._camera:
            self._aravis("g_object_unref", self._camera)
            self._camera = None

    def _check_controls(self) -> None:
        if not self._aravis("arv_camera_is_gv_device", self._camera):
            raise LinkError(f"the camera {self._address} is not a GigE Vision camera")
        if not self._aravis(
            "arv_gv_device_is_controller", self._aravis("arv_camera_get_device", self._camera)
        ):
            raise LinkError(f"another program controls the camera {self._address}: stop it first")

    def _set(self) -> None:
        settings = self._settings
        setters: Tuple[Tuple[str, Any, Callable[[Any], Any]], ...] = (
            (
                "pixel_format",
                settings.pixel_format,
                lambda v: self._do("set_pixel_format_from_string", v.encode()),
            ),
            ("roi", settings.roi_px, self._set_region),
            ("rate", settings.rate_hz, lambda v: self._do("set_frame_rate", v)),
            ("exposure", settings.exposure_us, lambda v: self._do("set_exposure_time", v)),
            ("gain", settings.gain_db, lambda v: self._do("set_gain", v)),
            ("packet_size", settings.packet_bytes, self._set_packet_bytes),
        )
        for name, value, set_it in setters:
            if value is not None:
                try:
                    set_it(value)
                except AravisError as error:
                    option = f"--{name.replace('_', '-')} {value}"
                    raise LinkError(f"camera {self._address} refuses {option}: {error}") from error
        if settings.software_trigger:
            self._do("set_trigger", b"Software")
        else:
            self._do("clear_triggers")

    def _check_format(self) -> None:
        code = self._do("get_pixel_format")
        if code not in GREY_CODES:
            name = (self._do("get_pixel_format_as_string") or b"").decode("utf-8", "replace")
            raise LinkError(
                f"camera {self._address} sends {name or hex(code)}, and the estimator takes grey pixels: choose"
                " --pixel-format Mono8, Mono10, Mono12, Mono12p, Mono14 or Mono16, whichever the camera supports"
            )

    def _do(self, call: str, *arguments: Any) -> Any:  # noqa: ANN401 - the call's result
        return self._aravis(f"arv_camera_{call}", self._camera, *arguments)

    def _set_region(self, roi_px: Tuple[int, int, int, int]) -> None:
        x, y, width, height = roi_px
        self._do("set_region", x, y, width, height)
        read = self._aravis.region(self._camera)
        if read != roi_px:
            raise LinkError(
                f"camera {self._address} reads {read} instead of --roi {roi_px} (x, y, width, height): choose one"
                " that fits its detector and its steps"
            )

    def _set_packet_bytes(self, packet_bytes: int) -> None:
        if packet_bytes:
            self._do("gv_set_packet_size", packet_bytes)
        else:
            self._do("gv_auto_packet_size")

    # --- the reader's thread -----------------------------------------------------------------

    def _read(self, stream: int) -> None:
        """Receive frames continuously and keep only the newest, so that a request never returns an old one."""
        arv = self._aravis
        while not self._stop.is_set():
            buffer = arv("arv_stream_timeout_pop_buffer", stream, POP_US)
            if not buffer:
                continue
            frame = self._frame_of(buffer) if arv("arv_buffer_get_status", buffer) == SUCCESS else None
            arv("arv_stream_push_buffer", stream, buffer)
            with self._frame_available:
                if frame is None:
                    self.damaged += 1
                    continue
                self._has_image = True
                self._newest = frame
                self._arrived += 1
                self._frame_available.notify()

    def _frame_of(self, buffer: int) -> Optional[CameraFrame]:
        arv, at_ns = self._aravis, now_ns()
        x, y, width, height = (
            arv(f"arv_buffer_get_image_{what}", buffer) for what in ("x", "y", "width", "height")
        )
        image = grey_image(
            arv.buffer_bytes(buffer), width, height, arv("arv_buffer_get_image_pixel_format", buffer)
        )
        if image is None:
            return None
        number = self._count.number(arv("arv_buffer_get_frame_id", buffer))
        stamp = arv("arv_buffer_get_timestamp", buffer)
        return CameraFrame(number, image, (x, y, width, height), stamp, at_ns)

    def _statistic(self, name: str) -> int:
        """Return a statistics counter of the stream by its name in Aravis."""
        return int(self._aravis("arv_stream_get_info_uint64_by_name", self._stream, name.encode()))


def parse_roi(text: str) -> Tuple[int, int, int, int]:
    """Parse x, y, width, height as in 0,0,640,480.

    Raises
    ------
    LinkError
        If the text is not four whole numbers, or not a region of a detector.
    """
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise LinkError(f"--roi {text} is not X,Y,WIDTH,HEIGHT: write four whole numbers of pixels") from None
    if x < 0 or y < 0 or width < 1 or height < 1:
        raise LinkError(
            f"--roi {text} is not a region of a detector: X and Y start at 0, WIDTH and HEIGHT at 1"
        )
    return x, y, width, height


class _BlockCount:
    """Continuous frame numbers across the wrap-around of a camera's block identifiers."""

    def __init__(self) -> None:
        self._last = 0
        self._before = 0

    def number(self, block_id: int) -> int:
        """Return the frame number, from 0, of the next block."""
        if block_id < self._last and block_id <= MAX_BLOCK_ID:
            self._before += MAX_BLOCK_ID
        self._last = block_id
        return self._before + block_id - 1


def grey_image(data: bytes, width_px: int, height_px: int, code: int) -> Optional[Image]:
    """Unpack a buffer to an (H, W) uint8 or uint16 image; return None if it is too short or not grey.

    Parameters
    ----------
    data : bytes
        Contents of the buffer.
    width_px : int
        Image width.
    height_px : int
        Image height.
    code : int
        Pixel-format code of GenICam's Pixel Format Naming Convention.
    """
    if code not in GREY_CODES or width_px < 1 or height_px < 1:
        return None
    layout = PixelFormat.Mono16 if code in MONO16_CODES else PixelFormat(code)
    size = pixels_bytes(width_px, height_px, layout)
    if len(data) < size:
        return None
    return np.ascontiguousarray(unpack_pixels(data[:size], width_px, height_px, layout))
