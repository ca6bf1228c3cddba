"""The ledger held against the time codes in the pictures, by whoever has both."""

import io
import json
import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hil_loop import Loop, adds_up, board, made_frame
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.hil.host.audit import IMAGES_TOPIC, audit_pictures, pictures_of
from flyaround.hil.host.flight_run import with_time_code
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.recording.ros_log import RosLog
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.mcap_messages import mcap_messages
from flyaround.simulator.scenario.faults import Faults, RepeatedNumber

N = 6


class Keep:
    """A recorder that keeps every picture as a third party would."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()

    def frame(self, frame):
        assert cv2.imwrite(str(self.folder / f"{1000 - frame.number}.png"), frame.image)

    def row(self, frame, row):
        pass

    def close(self):
        pass


def flight(faults=None):
    rng = np.random.default_rng(6)

    def drawn():
        for k in range(N):
            frame = made_frame(k, rng.integers(0, 255, (160, 160), np.uint8), every_s=0.05)
            scene = replace(frame.scene, epoch_utc=f"2026-08-20T09:30:00.{k}00001Z")
            yield replace(frame, scene=scene)

    return with_time_code(drawn()) if faults is None else with_time_code(drawn(), faults=faults)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    recorders = (Keep(folder / "kept"), RosLog(folder / "run.mcap"))
    summary = Loop(board()).run(flight(), recorders=recorders, log_dir=folder / "log")
    assert adds_up(summary)
    return folder


@pytest.mark.parametrize("kept", ["kept", "run.mcap"])
def test_all_pictures_agree(run, kept):
    done = CliRunner().invoke(app, ["hil", "audit", str(run / "log"), str(run / kept), "--json"])
    told = json.loads(done.stdout)
    assert (done.exit_code, told["passed"], told["agree"], told["pictures"]) == (0, True, N, N)


def test_a_row_that_is_changed_is_found(run):
    rows = read_ledger(run / "log")
    later = replace(rows[2], epoch_utc=rows[2].epoch_utc.replace(".200001", ".200002"))
    found = audit_pictures([*rows[:2], later, *rows[3:]], pictures_of(run / "kept"))
    assert not found.passed
    assert found.agree == N - 1
    assert found.wrong == ["998.png has the code of frame 2, -0.001 ms from its time in the ledger"]
    # a frame that the ledger does not know, and one that nobody has a picture of
    pictures = {name: image for name, image in pictures_of(run / "kept") if name != "997.png"}
    found = audit_pictures(rows[1:], [*pictures.items(), ("again", pictures["999.png"])])
    assert (found.missing, found.twice) == ([3], ["again"])
    assert found.wrong == ["1000.png has the code of frame 0, which has no time in the ledger"]
    assert not found.passed


def test_a_row_whose_time_is_none_is_wrong(run):
    rows = read_ledger(run / "log")
    found = audit_pictures([replace(rows[0], epoch_utc="noon"), *rows[1:]], pictures_of(run / "kept"))
    assert found.wrong == ["1000.png has the code of frame 0, which has no time in the ledger"]
    assert found.agree == N - 1


def test_a_picture_without_a_code_is_told(run):
    rows = read_ledger(run / "log")
    found = audit_pictures(rows, [*pictures_of(run / "kept"), ("blank", np.zeros((160, 160), np.uint8))])
    assert found.unreadable == ["blank"]
    assert not found.passed


def test_a_camera_that_repeats_its_number_is_found(tmp_path):
    faults = Faults(camera=(RepeatedNumber(start_s=0.15),))
    kept = Keep(tmp_path / "kept")
    Loop(board()).run(flight(faults), recorders=(kept,), log_dir=tmp_path / "log")
    done = CliRunner().invoke(app, ["hil", "audit", str(tmp_path / "log"), str(tmp_path / "kept")])
    assert done.exit_code == 1
    assert "3 agree" in done.output
    assert "from its time in the ledger" in done.output


def test_what_is_no_recording_is_one_sentence(run, tmp_path):
    (tmp_path / "broken.mcap").write_bytes((run / "run.mcap").read_bytes()[:500])
    (tmp_path / "short.mcap").write_bytes(b"\xff\xfe\xfa")
    for path in (tmp_path / "broken.mcap", tmp_path / "none.mcap", tmp_path / "short.mcap"):
        with pytest.raises(UserError, match="cannot be read"):
            list(pictures_of(path))


def test_a_flipped_byte_in_a_recording_is_one_sentence(run, tmp_path):
    data = (run / "run.mcap").read_bytes()
    with (run / "run.mcap").open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    for chunk in chunks:
        start, end = chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length
        # the last byte is an image's; the first ones are lengths, of which not all are read
        for at in range(end - 1, start + 50, -(chunk.chunk_length // 10)):
            damaged = tmp_path / "damaged.mcap"
            damaged.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
            with pytest.raises(UserError, match=r"damaged\.mcap cannot be read"):
                list(pictures_of(damaged))


def test_a_recording_without_images_is_refused(tmp_path):
    RosLog(tmp_path / "empty.mcap").close()
    with pytest.raises(UserError, match="holds no images"):
        list(pictures_of(tmp_path / "empty.mcap"))


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("declared", [True, False])
def test_a_recording_that_unpacks_to_gigabytes_is_refused_before_that(tmp_path, compression, declared):
    path = tmp_path / "large.mcap"
    writer = Writer(str(path), compression=compression, chunk_size=1 << 20)
    writer.start()
    channel = writer.register_channel(IMAGES_TOPIC, "cdr", writer.register_schema("x", "ros2msg", b"uint8 x"))
    writer.add_message(channel, 0, bytes(64 << 20), 0)
    writer.finish()
    if compression is CompressionType.NONE:
        assert [m.data for _, _, m in mcap_messages(io.BytesIO(path.read_bytes()))] == [bytes(64 << 20)]
        return
    assert path.stat().st_size < 1 << 20
    data = path.read_bytes()
    start = make_reader(io.BytesIO(data)).get_summary().chunk_indexes[-1].chunk_start_offset + 9 + 16
    size = 2 << 30 if declared else 1000
    path.write_bytes(data[:start] + size.to_bytes(8, "little") + data[start + 8 :])
    tracemalloc.start()
    with pytest.raises(UserError, match="cannot be read"):
        list(pictures_of(path))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 16 << 20
