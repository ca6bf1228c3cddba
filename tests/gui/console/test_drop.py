"""Files dropped on the console's window by an X client, as a file manager drops them."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from tests.harness.screen import xdotool
from tests.harness.sitting import Sitting
from tests.harness.x_drop import DragSource

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(1800)]


def test_a_mesh_and_a_scenario_that_are_dropped_are_flown(
    display: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(tmp_path / "data"))
    cube = tmp_path / "my cube.glb"
    trimesh.creation.box((1.0, 0.6, 0.4)).export(cube)
    mine = tmp_path / "mine.toml"
    mine.write_text("name = 1")
    script = "0.1 picture.detail quarter"
    with Sitting(tmp_path, "tango-space-10m", script=script, display=display) as sitting:
        sitting.wait_for("first picture")
        window = int(xdotool(display, "search", "--name", "Flyaround").split()[0])
        source = DragSource(display, window)
        assert source.drop([cube], (400, 300))
        sitting.wait_for("importing my cube.glb as target my-cube")
        sitting.wait_for("now: ")
        # two at once: each is told what is wrong with it, and the flight goes on
        (tmp_path / "notes.txt").touch()
        assert source.drop([mine, tmp_path / "notes.txt"], (400, 300))
        # they are read side by side
        wanted = {"key name is 1", "notes.txt is neither"}
        while wanted:
            line = sitting.wait_for(*wanted)
            wanted = {word for word in wanted if word not in line}
        source.close()
        state, _ = sitting.quit()
    assert state["pictures"] > 0
    assert (tmp_path / "data").is_dir()
