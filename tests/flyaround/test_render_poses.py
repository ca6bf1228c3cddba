"""render --poses: a picture for each row of a user's list, its truth the row; mistakes named."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.scenario.poses import COLUMNS, read_poses

pytestmark = pytest.mark.gl

POSES = [(1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 8.0), (0.5, 0.5, -0.5, 0.5, -0.5, 0.3, 12.0)]


def _write(path, rows, header=COLUMNS):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    return path


def test_each_row_becomes_a_picture(tmp_path):
    poses = _write(tmp_path / "poses.csv", POSES)
    result = CliRunner().invoke(
        app,
        [
            *f"render tango-space-10m --quality draft --poses {poses} -o".split(),
            str(tmp_path / "a.png"),
            "--json",
        ],
    )
    assert result.exit_code == 0, result.output
    frames = json.loads(result.output)["frames"]
    assert [f["image"] for f in frames] == [str(tmp_path / f"a-00000{k}.png") for k in range(2)]
    images = [read_png(tmp_path / f"a-00000{k}.png") for k in range(2)]
    assert not np.array_equal(*images)
    for k, pose in enumerate(POSES):
        truth = read_truth(tmp_path / f"a-00000{k}.json")
        assert truth.q_camera_from_target_wxyz == pytest.approx(pose[:4])
        assert truth.t_camera_from_target_m == pytest.approx(pose[4:])
        assert truth.frame_index == k


@pytest.mark.parametrize(
    ("rows", "header", "message"),
    [
        (POSES, COLUMNS[:-1], "lacks the column t_z_m"),
        ([], COLUMNS, "has no poses"),
        ([(*POSES[0][:6], "far")], COLUMNS, "line 2: t_z_m is 'far'"),
        ([POSES[0], (*POSES[0][:6], "nan")], COLUMNS, "line 3: t_z_m is 'nan'"),
        ([(0, 0, 0, 0, 0, 0, 5)], COLUMNS, "must be one"),
        ([(1, 0, 0, 0, 0, 0, 0)], COLUMNS, "allowed"),
        ([POSES[0][:4]], COLUMNS, "t_x_m is None"),
        ([("1", "0", "0", "0", "0", "5", "0", "8", "5")], COLUMNS, "line 2 has more cells"),
        ([(*POSES[0], 1.0)], (*COLUMNS, "q_w"), "column q_w twice"),
    ],
)
def test_mistakes_are_named(tmp_path, rows, header, message):
    with pytest.raises(UserError, match=message):
        read_poses(_write(tmp_path / "poses.csv", rows, header))


def test_an_empty_cell_at_the_end_of_a_line_is_none(tmp_path):
    plain = read_poses(_write(tmp_path / "plain.csv", POSES))
    assert read_poses(_write(tmp_path / "comma.csv", [(*row, "") for row in POSES])) == plain


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UserError, match="cannot read poses"):
        read_poses(tmp_path / "none.csv")
