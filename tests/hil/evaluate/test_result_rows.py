"""Rows of an evaluation are read from files of a sensible size only."""

import os

import pytest

from flyaround.hil.evaluate.result_rows import RunHeader, existing_rows, read_rows
from flyaround.simulator.errors import UserError


def test_a_file_without_end_is_refused(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.touch()
    os.truncate(path, 1 << 40)
    header = RunHeader(dataset="a", target_sha256="", methods=(), model_sha256="")
    for read in (existing_rows, lambda p: read_rows(p, header)):
        with pytest.raises(UserError, match="make it smaller"):
            read(path)
