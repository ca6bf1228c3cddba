"""Shader sources are valid for OpenGL 4.1."""

from importlib import resources

import pytest

from flyaround.simulator.render.gl.programs import read_source

FOLDER = resources.files("flyaround.shaders")
FILES = sorted(
    f"{folder.name}/{file.name}"
    for folder in FOLDER.iterdir()
    if folder.is_dir() and not folder.name.startswith("__")
    for file in folder.iterdir()
)


def test_shaders_are_found():
    assert {"craft/shade.frag", "earth/earth.frag"} <= set(FILES)


@pytest.mark.parametrize("path", FILES)
def test_no_line_is_continued(path):
    # in GLSL from 4.20 on; Mesa's and NVIDIA's drivers take it in 4.10 too, the reference compiler does not
    text = read_source(path)
    assert "\\\n" not in text
    assert "\\" not in text
