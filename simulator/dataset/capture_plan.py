"""What a capture asks of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from flyaround.simulator.scenario.plan import FramePlan

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.scene.second_camera import SecondCamera
    from flyaround.simulator.scene.state import SceneState


class CapturePlan(FramePlan, Protocol):
    """What a capture needs: frames by number, each from the plan alone, and what the card says of them."""

    @property
    def scenario_name(self) -> str:
        """Name of the scenario or recipe."""

    @property
    def scenario_document(self) -> dict[str, Any]:
        """It in full, as JSON."""

    @property
    def every_s(self) -> float | None:
        """Spacing, if it was given as one."""

    @property
    def seed(self) -> int:
        """Seed of every random choice."""

    @property
    def camera(self) -> Camera:
        """The camera."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Label layers that it asks for."""

    @property
    def second_camera(self) -> SecondCamera | None:
        """A second camera of the same instants, if there is one."""

    def next_scene(self, k: int) -> SceneState | None:
        """What optical flow leads to from frame k, if there is such a thing."""
