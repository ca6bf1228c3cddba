"""A format: one text file with a line for each frame: number, quaternion, position."""

from flyaround.plugins import DatasetFormat


class PoseListWriter:
    """Collects a line for each frame, and writes them at the end."""

    def __init__(self, output, card) -> None:
        self._output, self._lines = output, [f"# {card.scenario_name}: frame, q wxyz, t [m]"]

    def write(self, frame) -> None:
        """Take one frame."""
        pose = (*frame.truth.q_camera_from_target_wxyz, *frame.truth.t_camera_from_target_m)
        self._lines.append(" ".join([str(frame.number), *(repr(x) for x in pose)]))

    def finish(self) -> None:
        """Write the list."""
        self._output.write("poses.txt", "\n".join([*self._lines, ""]).encode())


FORMAT = DatasetFormat(
    name="pose-list",
    title="A line for each frame",
    carries="poses",
    lacks="images and every other label",
    writer=PoseListWriter,
)
