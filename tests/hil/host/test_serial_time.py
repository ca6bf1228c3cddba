"""How long a frame takes on a serial line: as long as its bytes do, as the page says, and told with what helps."""

import re
from pathlib import Path

import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.serial_time import line_time_s, serial_advice
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.packets.images import chunk_count, chunks
from flyaround.hil.link.packets.messages import Encoding, FrameHeader, PixelFormat
from flyaround.hil.link.packets.packet import Packet

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize("image_bytes", [1, 2048, 2049, 80_000])
def test_it_is_what_the_packets_of_a_frame_take(image_bytes):
    data = np.random.default_rng(1).integers(1, 256, image_bytes, dtype=np.uint8).tobytes()
    count = chunk_count(image_bytes, 2048)
    header = FrameHeader(1, 8, 8, 8, Encoding.RAW, image_bytes, count, 0.01, 0.0, 1, "2026-01-01T00:00:00Z")
    framing = CobsFraming()
    sent = sum(
        len(framing.encode(Packet(message.TYPE, message.encode(), 1 << 60, k)))
        for k, message in enumerate([header, *chunks(1, data, 2048)])
    )
    assert line_time_s(image_bytes, 115_200) == pytest.approx(sent * 10 / 115_200, rel=0.003)


def test_the_page_s_table_is_computed():
    rows = re.findall(
        r"^\| ([\d,]+) \| ([\d.]+)(?: s)? \| ([\d.]+)(?: s)? \| ([\d.]+)(?: s)? \|$",
        (DOCS / "hil_protocol.md").read_text(),
        re.MULTILINE,
    )
    assert len(rows) == 4
    for baud, *told in rows:
        for pixels, seconds in zip((640 * 480, 1024 * 1024, 1920 * 1200), told, strict=True):
            assert seconds == f"{line_time_s(pixels, int(baud.replace(',', ''))):.3g}"


def advice(url="serial:///dev/ttyUSB0?baud=921600", size=(1920, 1200), bits=8, every_s=None, **link):
    formats = {8: PixelFormat.Mono8, 10: PixelFormat.Mono10, 12: PixelFormat.Mono16}
    config = LinkConfig(url=url, mode="lockstep", truth="off", timeout_s=link.pop("timeout_s", 60.0), **link)
    return serial_advice(config, size, bits, formats[bits], every_s)


def test_it_says_how_long_and_what_helps():
    assert advice("tcp://127.0.0.1:5600") is None
    raw = advice(compression="raw")
    assert raw.startswith(
        "a frame of 1920 x 1200 px as Mono8 takes 25.7 s on a line of 921600 baud. Remedies: --encoding zstd"
    )
    assert "roi_px or binning" in raw
    assert "camera" in raw
    packed = advice()
    assert "takes 25.7 s" in packed
    assert "about 11 s with zstd" in packed
    assert "--encoding" not in packed
    assert "longer than the 5 s time-out of a pose, so that frames are dropped" in advice(timeout_s=5.0)
    assert "longer than the 0.5 s frame interval" in advice(every_s=0.5)
    assert "--pixel-format Mono12p" in advice(bits=12)
    # quick enough: how long, and nothing to do
    assert advice(size=(64, 48)).endswith("about 0.016 s with zstd for a noisy image")


def test_the_host_says_so_before_it_opens_the_line(capsys):
    assert run(["hil", "host", "tango-flyaround", "--listen", "serial:///dev/nobody?baud=921600"]) == 2
    said = capsys.readouterr().err
    assert "takes 25.7 s on a line of 921600 baud" in " ".join(said.split())
    assert "/dev/nobody" in said
