"""What the tests of the host run against: boards, a man in the middle, a run around them."""

from __future__ import annotations

import socket
import struct
import threading
from dataclasses import fields, replace
from functools import cache

import msgspec
import numpy as np
import pytest
from estimators import PATIENCE_S, Instant

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import Bye, Hello, PoseMessage, TimeSyncRequest
from flyaround.hil.link.packets.packet import PacketType, decode_packet
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.url import connect
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.labels.truth import Software, Truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.scene.state import SceneState

CAMERA = {"width_px": 64, "height_px": 48, "fx_px": 100.0, "fy_px": 100.0, "cx_px": 31.5, "cy_px": 23.5}
MARK = "truth-must-not-leak"

# An oracle: the pose is written into the first pixels of the image, as the host knows it.
BOARD = """
import sys, time
from flyaround.hil.board.agent import run_board
class Result:
    reason = "oracle"; confidence = 0.5; q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    def __init__(self, image):
        self.accepted = bool(image[0, 0] % 3)
        self.t_camera_from_target_m = (0.0, 0.0, float(image[0, 0]))
        self.stages_ms = {"look": 0.5, "think": 1.5}
class Oracle:
    def __init__(self, camera): assert camera["width_px"] == 64
    def estimate(self, image):
        if image[0, 0] == 7: raise RuntimeError("seven")
        return Result(image)
summary = run_board(sys.argv[1], make_estimator=Oracle, method="oracle", model_name="tango", silence_s=60.0)
print(summary.ended); sys.exit(0 if summary.goodbye else 1)
"""


@cache
def scene() -> SceneState:
    """A scene whose camera and detector give the images of the tests."""
    some = plan_recipe("eval-black", 1, seed=0).scene(0)
    camera = msgspec.convert(CAMERA, Camera)
    return replace(some, camera=camera, epoch_utc="2026-01-01T00:00:00Z", exposure_s=0.01)


def made_frame(
    k: int, image: np.ndarray, *, every_s: float, q=(1.0, 0.0, 0.0, 0.0), t_m=(0.0, 0.0, 1.0), mark: str = ""
) -> Frame:
    """A frame that nobody drew."""
    height, width = image.shape
    at = replace(
        scene(),
        frame_index=k,
        t_s=k * every_s,
        camera=replace(scene().camera, width_px=width, height_px=height),
        q_camera_from_target_wxyz=q,
        t_camera_from_target_m=t_m,
    )
    truth = Truth(
        epoch_utc=at.epoch_utc,
        t_s=at.t_s,
        frame_index=k,
        seed=at.seed,
        q_camera_from_target_wxyz=q,
        t_camera_from_target_m=t_m,
        camera=at.camera,
        keypoints=(),
        box_px=None,
        box_amodal_px=None,
        sun_direction_camera=at.sun_direction_camera,
        sun_visible_fraction=1.0,
        feasible=True,
        infeasible_reason="",
        silhouette_inside=1.0,
        wireframe_step_share=1.0,
        image_sha256="",
        mask_sha256="",
        record=SceneRecord.from_scene(at),
        software=Software(flyaround=mark, gl_renderer=""),
    )
    return Frame(at, image, NO_RADIANCE, truth, stage_ms={"render": 1.5, "sensor": 0.5})


def frames(n: int, *, every_s: float = 0.05):
    for k in range(n):
        image = np.full((48, 64), k % 256, np.uint8)
        q = (0.0, 0.0, 0.0, 1.0) if k == 1 else (1.0, 0.0, 0.0, 0.0)
        yield made_frame(k, image, every_s=every_s, q=q, t_m=(0.0, 0.123456789, float(k)), mark=MARK)


class Loop:
    """A run with whatever is started once the ports are open."""

    def __init__(self, *starters) -> None:
        self.starters, self.threads, self.results = starters, [], []

    def on_listening(self, url, truth_url) -> None:
        self.url, self.truth_url = url, truth_url
        for starter in self.starters:
            thread = threading.Thread(target=self._start, args=(starter, url), daemon=True)
            thread.start()
            self.threads.append(thread)

    def _start(self, starter, url) -> None:
        self.results.append(starter(url))

    def run(self, source, *, on_row=None, **options):
        """The summary of a run; options are fields of the link or of the run.

        Nobody is taken for gone, and no frame given up, where a busy machine holds a process up for some seconds: tests
        of that say their own times.
        """
        of_link = {field.name for field in fields(LinkConfig)} & options.keys()
        defaults = {"url": "tcp://127.0.0.1:0", "mode": "lockstep", "truth": "off"}
        defaults |= {"timeout_s": PATIENCE_S / 3, "silence_s": PATIENCE_S}
        link = LinkConfig(**{**defaults, **{name: options.pop(name) for name in of_link}})
        config = RunConfig(link=link, **{"connect_timeout_s": PATIENCE_S, **options})
        summary = run_host(source, config, on_row=on_row, on_listening=self.on_listening)
        for thread in self.threads:
            thread.join(PATIENCE_S)
        return summary


def board(estimator=Instant, **options):
    """A board that waits for a host that a busy machine holds up."""
    return lambda url: run_board(url, make_estimator=estimator, **{"silence_s": PATIENCE_S, **options})


def good_pose(frame_id: int, z_m: float = 1.0) -> PoseMessage:
    """An accepted pose."""
    return PoseMessage(frame_id, True, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, z_m), 0.5)


def greeted(url: str) -> Link:
    """A session of a board that holds one frame."""
    link = Link(connect(url, PATIENCE_S))
    greet_host(link, Hello(window=1), PATIENCE_S)
    return link


def serve_by_hand(link: Link, take) -> str | None:
    """Be a board of another make that answers clocks; ``take(message)`` has the rest, and leaves where it says so.

    Returns the host's goodbye.
    """
    while not isinstance(message := link.recv(PATIENCE_S), Bye):
        if isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))
        elif take(message):
            break
    link.transport.close()
    return message.reason if isinstance(message, Bye) else None


def refused(client):
    """A client that is expected to be turned away; returns the sentence it hears."""

    def start(url):
        with pytest.raises(LinkError) as caught:
            client(url)
        return str(caught.value)

    return start


class Proxy:
    """Man in the middle: keeps what went to the board, and may change it packet by packet."""

    def __init__(self, change=lambda _k, _kind, data: data) -> None:
        self.change, self.to_board, self._n = change, bytearray(), 0

    @staticmethod
    def board(url: str):
        """Whoever stands behind it."""
        return board()(url)

    def __call__(self, host_url: str):
        port = int(host_url.rsplit(":", 1)[1])
        with socket.create_server(("127.0.0.1", 0)) as server:
            upstream = socket.create_connection(("127.0.0.1", port))
            result = []
            thread = threading.Thread(
                target=lambda: result.append(self.board(f"tcp://127.0.0.1:{server.getsockname()[1]}")),
                daemon=True,
            )
            thread.start()
            downstream, _ = server.accept()
        back = threading.Thread(target=self._copy_back, args=(downstream, upstream), daemon=True)
        back.start()
        while (packet := self._packet(upstream)) is not None:
            kind = decode_packet(packet).type
            data = self.change(self._n, kind, struct.pack("<I", len(packet)) + packet)
            self._n += 1
            self.to_board += data
            try:
                downstream.sendall(data)
            except OSError:
                break
        downstream.close()
        thread.join(PATIENCE_S)
        upstream.close()
        back.join(PATIENCE_S)
        return result[0] if result else None

    @staticmethod
    def _copy_back(source, sink) -> None:
        try:
            while data := source.recv(65536):
                sink.sendall(data)
        except OSError:
            pass

    @staticmethod
    def _packet(sock):
        def exactly(n):
            data = b""
            while len(data) < n:
                more = sock.recv(n - len(data))
                if not more:
                    return None
                data += more
            return data

        try:
            prefix = exactly(4)
            return None if prefix is None else exactly(struct.unpack("<I", prefix)[0])
        except OSError:
            return None


def flip_first(kind: PacketType, nth: int):
    """Damage the nth packet of a kind."""
    seen = 0

    def change(_k, this, data):
        nonlocal seen
        if this == kind:
            seen += 1
            if seen == nth:
                return data[:40] + bytes([data[40] ^ 0x04]) + data[41:]
        return data

    return change


def adds_up(summary: LedgerSummary) -> bool:
    return summary.sent == summary.accepted + summary.declined + sum(summary.dropped.values())
