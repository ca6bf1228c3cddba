"""Frames as the host draws them in its other processes, and as a board process gets them."""

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board_model.write import write_board_model
from flyaround.hil.host.link_process.host_link import choose_pixel_format
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.plan_frames import frames_of_plan
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.hil.link.packets.enums import PixelFormat
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.labels.layers import pixel_hash
from flyaround.simulator.loop import FrameRequest, draw_request
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl

# A board of few lines on the project's own link: the estimator's answer, and what of each frame arrived.
BOARD = """
import hashlib, json, sys
from flyaround.hil.board.agent import estimator_factory
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.packets.images import FrameAssembler, supported_encodings
from flyaround.hil.link.packets.messages import Bye, FrameChunk, FrameHeader, Hello, PoseMessage, TimeSyncRequest
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.url import connect
make, name, digest = estimator_factory(sys.argv[1], "hybrid")
for line in sys.stdin:
    link = Link(connect(line.strip(), 60.0))
    terms = greet_host(link, Hello(supported_encodings(), 1, name, digest), 60.0)
    estimator, assembler = make(terms.camera), FrameAssembler()
    while not isinstance(message := link.recv(60.0), Bye):
        complete = None
        if isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))
        elif isinstance(message, FrameHeader):
            assembler.header(message)
        elif isinstance(message, FrameChunk):
            complete = assembler.chunk(message)
        if complete is not None:
            header, image = complete
            answer = estimator.estimate(image)
            print(json.dumps({
                "terms": terms.bits, "header": header.bits, "bytes": image.dtype.itemsize,
                "sha256": hashlib.sha256(image.tobytes()).hexdigest(),
            }), flush=True)
            q, t = answer.q_camera_from_target_wxyz, answer.t_camera_from_target_m
            link.send(PoseMessage(header.frame_id, bool(answer.accepted), answer.reason, tuple(q), tuple(t)))
    link.close()
"""


def with_sensor(tmp_path, sensor, bands="mono"):
    """A scenario with another sensor."""
    text = (files("flyaround.assets.scenarios") / "tango-space-10m.toml").read_text()
    path = tmp_path / "deep.toml"
    path.write_text(text.replace('preset = "speed"', sensor).replace('bands = "mono"', f'bands = "{bands}"'))
    return load_scenario(str(path))


def test_a_streamed_frame_has_its_image_camera_and_truth(tmp_path):
    plan = plan_flight(with_sensor(tmp_path, 'preset = "imx174"'), n=2)
    frame = next(iter(frames_of_plan(plan)))
    assert frame.image.shape == (plan.camera.height_px, plan.camera.width_px)
    # a detector of 12 bits: its own numbers, not their last eight bits
    assert (frame.image.dtype, frame.scene.sensor.bits, frame.image.max() > 255) == (np.uint16, 12, True)
    assert pixel_hash(frame.image) == frame.truth.image_sha256
    t = frame.truth.t_camera_from_target_m
    assert np.linalg.norm(t) == pytest.approx(10, abs=0.5)
    assert frame.scene.camera.fx_px == plan.camera.fx_px


def test_two_workers_stream_what_one_does_in_order():
    plan = plan_flight(load_scenario("tango-space-10m"), n=3)
    # and what is drawn to warm up is neither in the stream nor seen in it
    one, two = (list(frames_of_plan(plan, workers=n, warm_up=n == 2)) for n in (1, 2))
    assert [frame.number for frame in two] == [0, 1, 2]
    for ours, theirs in zip(one, two, strict=True):
        assert ours.truth == theirs.truth
        assert np.array_equal(ours.image, theirs.image)


def test_colour_is_streamed_as_rgb8_and_only_so():
    assert choose_pixel_format(8, (3,), "auto") is PixelFormat.RGB8
    assert choose_pixel_format(12, (), "auto") is PixelFormat.Mono16
    assert choose_pixel_format(12, (), "Mono12p") is PixelFormat.Mono12p
    with pytest.raises(
        UserError, match="colour pictures of 8 bits do not fit the pixel format Mono8: choose RGB8"
    ):
        choose_pixel_format(8, (3,), "Mono8")
    with pytest.raises(UserError, match="colour pictures of 12 bits cannot be sent to a board"):
        choose_pixel_format(12, (3,), "auto")


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A board process that connects to each URL it is given, in turn."""
    model = tmp_path_factory.mktemp("board") / "tango.board.json"
    write_board_model(plan_flight(load_scenario("tango-space-10m"), n=1).target, model)
    process = subprocess.Popen(
        [sys.executable, "-c", BOARD, str(model)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[3],
    )
    yield process
    process.kill()
    process.communicate()


@pytest.mark.parametrize(
    ("bits", "sensor"),
    [
        (10, 'preset = "cmv4000"'),
        (12, 'preset = "imx174"'),
        (16, 'preset = "speed"\nbits = 16'),
    ],
)
def test_every_depth_arrives_byte_for_byte_and_is_understood(renderer, tmp_path, board, bits, sensor):
    plan = plan_flight(with_sensor(tmp_path, sensor), n=1)
    frame = draw_request(renderer, FrameRequest(scene=plan.scene(0)), Frame.image_and_truth)

    def start(url, _truth_url):
        board.stdin.write(f"{url}\n")
        board.stdin.flush()

    rows = []
    link = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=60.0)
    run_host([frame], RunConfig(link=link), on_row=rows.append, on_listening=start)
    got = json.loads(board.stdout.readline())
    assert (got["terms"], got["header"], got["bytes"]) == (bits, bits, 2)
    assert got["sha256"] == frame.truth.image_sha256
    # accuracy does not depend on the depth: 0.1 to 0.4 deg and a centimetre were measured with all of them
    assert rows[0].E_R_deg < 2.0
    assert rows[0].E_T_m < 0.1
