"""Transmission time of a frame on a serial line, reported before the run with ways to shorten it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.hil.link.packets.enums import PixelFormat
from flyaround.hil.link.packets.messages import FrameChunk, FrameHeader
from flyaround.hil.link.packets.packet import OVERHEAD_BYTES
from flyaround.hil.link.packets.pixels import pixels_bytes
from flyaround.hil.link.transports.serial_port import BITS_PER_BYTE, SerialTransport
from flyaround.hil.link.transports.url import parse_url

if TYPE_CHECKING:
    from flyaround.hil.host.link_process.ipc import LinkConfig

# Compression ratio of zstd on a noisy image, measured on rendered images.
ZSTD_RATIO = 2.3

# Transmission time below which no remedies are listed [s].
MIN_ADVICE_S = 1.0


def line_time_s(image_bytes: int, baud: int) -> float:
    """Return the time of a frame at a baud rate, including start and stop bits, packets and framing [s]."""
    n_full, remainder = divmod(image_bytes, SerialTransport.chunk_bytes)
    line_bytes = _line_bytes(FrameHeader.LAYOUT.size)
    line_bytes += n_full * _line_bytes(FrameChunk.LAYOUT.size + SerialTransport.chunk_bytes)
    line_bytes += _line_bytes(FrameChunk.LAYOUT.size + remainder) if remainder else 0
    return line_bytes * BITS_PER_BYTE / baud


def _line_bytes(payload_bytes: int) -> int:
    """Return the largest size of a packet on the line [bytes].

    COBS adds one byte in 254 and one more, and a zero delimits the packet on either side.
    """
    packet_bytes = OVERHEAD_BYTES + payload_bytes
    return packet_bytes + packet_bytes // 254 + 1 + 2


def serial_advice(
    link: LinkConfig, size_px: tuple[int, int], bits: int, pixel_format: PixelFormat, every_s: float | None
) -> str | None:
    """Return advice about frames on a serial line; None for any other line.

    Parameters
    ----------
    link : LinkConfig
        URL, compression and time-out of the link.
    size_px : tuple of int
        Width and height of the images.
    bits : int
        Bits per pixel.
    pixel_format : PixelFormat
        Pixel format on the line.
    every_s : float or None
        Frame interval in real time; None if the host waits for each pose.

    Returns
    -------
    str or None
        Sentence with the time of a frame on the line.
    """
    scheme, _, baud = parse_url(link.url)
    if scheme != "serial":
        return None
    width_px, height_px = size_px
    frame_s = line_time_s(pixels_bytes(width_px, height_px, pixel_format), baud)
    packed = link.compression in ("auto", "zstd")
    frame = f"a frame of {width_px} x {height_px} px as {pixel_format.name}"
    text = f"{frame} takes {frame_s:.3g} s on a line of {baud} baud"
    if packed:
        text += f", about {frame_s / ZSTD_RATIO:.2g} s with zstd for a noisy image"
    min_s = frame_s / ZSTD_RATIO if packed else frame_s
    if min_s > link.timeout_s:
        text += f": longer than the {link.timeout_s:g} s time-out of a pose, so that frames are dropped (--timeout)"
    elif every_s is not None and min_s > every_s:
        text += f": longer than the {every_s:g} s frame interval, so that some frames are never sent"
    elif min_s < MIN_ADVICE_S:
        return text
    helps = ["a smaller read-out (roi_px or binning under [sensor]) or camera", "a faster line or a network"]
    if not packed:
        helps.insert(0, "--encoding zstd")
    if pixel_format is PixelFormat.Mono16 and bits <= PixelFormat.Mono12p.depth_bits:
        helps.insert(0, "--pixel-format Mono12p")
    return f"{text}. Remedies: {', '.join(helps)}"
