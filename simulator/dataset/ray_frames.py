"""Frames drawn by a Ray cluster: shards as tasks on any node; the loss of a node is tolerated.

A task is a pure function of its shard, so Ray may run it anywhere, and repeat it. Results are written here, by the same
writer as in every capture: the bytes are those of a single process.
"""

from __future__ import annotations

import os
import socket
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Generic, NoReturn, TypeVar, cast
from urllib.parse import urlsplit

from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameProducer, FrameRequest, OpenRenderer, draw_request
from flyaround.simulator.runtime.memory import keep_freed_memory
from flyaround.simulator.runtime.threads import usable_processors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from flyaround.simulator.render.gl.context import GlInfo
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MAX_IN_SHARD = 8
"""Frames per task: consecutive ones share a varied craft's baked light, and a lost node costs little."""

# Number of times that Ray repeats a lost frame.
MAX_RETRIES = 3

# Time-out for the first connection [s], and interval at which a lost cluster is noticed [s].
_CONNECT_TIMEOUT_S, _POLL_INTERVAL_S = 5.0, 120.0

Result = TypeVar("Result")


@dataclass(frozen=True)
class RayCluster:
    """The cluster to draw on.

    Parameters
    ----------
    address : str
        ``auto`` for the cluster that this machine belongs to, ``HOST:PORT`` of its head, or ``ray://HOST:PORT``.
    gpu_share : float, optional
        Fraction of a GPU per drawing process, so that several share one; 0 for nodes without.
    """

    address: str
    gpu_share: float = 0.0


@dataclass(frozen=True, eq=False)
class _TaskContext(Generic[Result]):
    """Arguments shared by all tasks; they are sent to each node once."""

    stage: Callable[[Frame], Result]
    first: SceneState
    target: Target


@dataclass(frozen=True, eq=False)
class _Shard(Generic[Result]):
    """Result of a task, with the node that drew it."""

    node: str
    info: GlInfo
    results: list[Result]


class RayFrames(FrameProducer[Result]):
    """Frame producer on a cluster. Every node needs the same version of Flyaround and the same GL renderer.

    Parameters
    ----------
    stage : callable
        Function applied to each frame where it is rendered.
    cluster : RayCluster
        Cluster that renders the frames.
    first : SceneState
        First scene to be drawn.
    target : Target
        Target of the scenes, sent to the nodes.
    n_frames : int
        Number of frames to be drawn.

    Raises
    ------
    UserError
        If Ray is not installed, no cluster answers, it lacks such GPUs, or its nodes use different renderers.
    """

    def __init__(
        self,
        stage: Callable[[Frame], Result],
        cluster: RayCluster,
        *,
        first: SceneState,
        target: Target,
        n_frames: int,
    ) -> None:
        self._ray = _import_ray()
        self._cluster = cluster
        self._owns_connection = not self._ray.is_initialized()
        if self._owns_connection:
            _connect(self._ray, cluster.address)
        self._sent: deque[tuple[Any, int]] = deque()
        self._ready: deque[Result] = deque()
        self._info: GlInfo | None = None
        self._node = ""
        try:
            self._require_gpus()
            self._context = self._ray.put(_TaskContext(stage, first, target))
            self._task = self._ray.remote(
                num_cpus=1,
                num_gpus=cluster.gpu_share,
                max_retries=MAX_RETRIES,
                max_calls=0,  # a process keeps its renderer for further tasks, also with GPUs
                scheduling_strategy="SPREAD",
            )(_draw_shard)
            self._shard = max(1, min(MAX_IN_SHARD, n_frames // (4 * self._slots())))
        except BaseException:
            self.close()
            raise

    def _slots(self) -> int:
        """Return the number of tasks that the cluster can run at once now."""
        resources = self._ray.cluster_resources()
        slots = resources.get("CPU", 0.0)
        if self._cluster.gpu_share > 0:
            slots = min(slots, resources.get("GPU", 0.0) / self._cluster.gpu_share)
        return max(int(slots), 1)

    def _require_gpus(self) -> None:
        resources = self._ray.cluster_resources()
        if resources.get("GPU", 0.0) < self._cluster.gpu_share:
            raise UserError(
                f"--gpu-share {self._cluster.gpu_share:g} requests GPUs, but the Ray cluster {self._cluster.address} "
                f"has {resources.get('GPU', 0.0):g}; leave it out, or start its nodes with --num-gpus"
            )

    @property
    def info(self) -> GlInfo:
        """The renderer's driver; waits until the first node is ready."""
        if self._info is None:
            self._sent.appendleft((self._send([]), 0))
            self._collect()
        return cast("GlInfo", self._info)

    @property
    def has_room(self) -> bool:
        """True if `submit` would accept a request."""
        return len(self._sent) < 2 * self._slots()

    @property
    def in_flight(self) -> int:
        """Number of frames requested and not yet collected."""
        return len(self._ready) + sum(n for _, n in self._sent)

    def submit(self, request: FrameRequest) -> bool:
        """Request one frame, as a task of its own."""
        if not self.has_room:
            return False
        self._sent.append((self._send([request]), 1))
        return True

    def ready(self) -> bool:
        """Return True if `result` would return at once."""
        return bool(self._ready) or (
            bool(self._sent) and bool(self._ray.wait([self._sent[0][0]], timeout=0)[0])
        )

    def result(self) -> Result:
        """Return the oldest frame in flight; waits for it.

        Raises
        ------
        RuntimeError
            If no frame is in flight.
        """
        if not self.in_flight:
            raise RuntimeError("no frame is in flight")
        while not self._ready:
            self._collect()
        return self._ready.popleft()

    def frames(self, requests: Iterable[FrameRequest]) -> Iterator[Result]:
        """Yield one frame per request, in order, drawn by shards.

        Raises
        ------
        RuntimeError
            If frames of an interrupted run are in flight.
        """
        if self.in_flight > 0:
            raise RuntimeError("frames of an interrupted run are in flight; open another producer")
        pending = iter(requests)
        while shard := list(islice(pending, self._shard)):
            while not self.has_room:
                yield self.result()
                yield from self._all_ready()
            self._sent.append((self._send(shard), len(shard)))
        while self.in_flight > 0:
            yield self.result()

    def _all_ready(self) -> Iterator[Result]:
        while self._ready:
            yield self._ready.popleft()

    def _send(self, shard: list[FrameRequest]) -> Any:  # noqa: ANN401 - Ray's own reference
        # in a tuple the reference is not resolved: a process that has the kit need not read it again
        return self._task.remote((self._context,), shard)

    def _collect(self) -> None:
        """Wait for the oldest shard."""
        reference, _ = self._sent[0]
        while not self._ray.wait([reference], timeout=_POLL_INTERVAL_S)[0]:
            if self._ray.cluster_resources().get("CPU", 0.0) < 1:
                raise UserError(
                    f"the Ray cluster {self._cluster.address} has no rendering node left; start one, and "
                    "continue with --resume"
                )
        try:
            shard: _Shard[Result] = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            self._raise_ray_error(error)
        self._sent.popleft()
        if self._info is None:
            self._info, self._node = shard.info, shard.node
        elif (shard.info.renderer, shard.info.version) != (self._info.renderer, self._info.version):
            raise UserError(
                f"the nodes of the Ray cluster use different renderers, so their images would differ: "
                f"{self._node} by {self._info.renderer} ({self._info.version}), {shard.node} by {shard.info.renderer} "
                f"({shard.info.version}); use identical nodes"
            )
        self._ready.extend(shard.results)

    def _raise_ray_error(self, error: Exception) -> NoReturn:
        """Raise the error of a failed task or cluster."""
        cause = getattr(error, "cause", None)
        if isinstance(cause, UserError):
            raise cause from error
        if isinstance(cause, ImportError):
            raise UserError(
                f"a node of the Ray cluster cannot import {cause.name or cause}; install the same version of flyaround "
                "on every node"
            ) from error
        if cause is not None:
            raise RuntimeError(f"a task of the Ray cluster failed: {error}") from error
        first = " ".join(str(error).split())[:200]
        raise UserError(
            f"the Ray cluster lost frames in flight, {MAX_RETRIES + 1} times in a row: {first}; look at "
            "its nodes, and go on with --resume"
        ) from error

    def close(self) -> None:
        """Leave the cluster; tasks in flight are discarded."""
        for reference, _ in self._sent:
            self._ray.cancel(reference, force=False)
        self._sent.clear()
        self._ready.clear()
        if self._owns_connection:
            self._ray.shutdown()


def _import_ray() -> Any:  # noqa: ANN401 - a package without types
    # no usage statistics; and a task that requests no GPU still sees the existing ones
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    try:
        import ray  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise missing_extra("--ray", "ray", error) from error
    return ray


def _connect(ray: Any, address: str) -> None:  # noqa: ANN401 - a package without types
    """Join a cluster.

    Raises
    ------
    UserError
        If none answers.
    """
    advice = "start one with `ray start --head`, or check --ray HOST:PORT"
    if address != "auto":
        _require_answer(address, advice)
    try:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR", include_dashboard=None)
    except Exception as error:  # Ray raises many types, some of them from gRPC
        first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        location = "runs on this machine" if address == "auto" else f"answers at {address}"
        raise UserError(f"no Ray cluster {location}: {first}; {advice}") from error


def _require_answer(address: str, advice: str) -> None:
    parts = urlsplit(address if "://" in address else f"//{address}")
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if host is None or port is None or parts.scheme not in {"", "ray"}:
        raise UserError(f"--ray {address} is not an address; give auto, HOST:PORT or ray://HOST:PORT")
    try:
        socket.create_connection((host, port), timeout=_CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise UserError(
            f"no Ray cluster answers at {address}: {error.strerror or error}; {advice}"
        ) from error


def _draw_shard(context: tuple[Any], requests: list[FrameRequest]) -> _Shard[Any]:
    """Draw a shard's frames: the body of a task. Without requests, only open the renderer and report the driver."""
    import ray  # noqa: PLC0415 - in the process that Ray runs

    gpus = ray.get_runtime_context().get_accelerator_ids().get("GPU", [])
    task_context, renderer, _ = _open_renderer(
        context[0], int(gpus[0]) if gpus and str(gpus[0]).isdigit() else None
    )
    results = [
        draw_request(renderer, request, task_context.stage, task_context.target) for request in requests
    ]
    return _Shard(socket.gethostname(), renderer.info, results)


@lru_cache(maxsize=1)
def _open_renderer(context: Any, device_index: int | None) -> tuple[_TaskContext[Any], Any, ExitStack]:  # noqa: ANN401 - Ray's reference
    """Return the kit and a renderer, kept in a worker process between tasks."""
    import ray  # noqa: PLC0415 - in the process that Ray runs

    keep_freed_memory()
    task_context: _TaskContext[Any] = ray.get(context)
    stack = ExitStack()
    # Ray grants a task one processor: a software driver draws in the task's own thread
    opener = OpenRenderer(
        device_index=device_index, first=task_context.first, processes=max(usable_processors(), 2)
    )
    return task_context, stack.enter_context(opener()), stack
