"""Each shader is told the defines that it speaks of, and no others: drivers know a text that they have compiled."""

import re

from flyaround.simulator.render.gl.programs import ProgramLibrary, _head
from flyaround.simulator.render.globe.frame_air import TABLE_DEFINES


class Recorder:
    """Takes a context's place, and keeps the texts."""

    def __init__(self):
        self.info, self.texts = {}, []

    def program(self, *, vertex_shader, fragment_shader, **_):
        self.texts.append((vertex_shader, fragment_shader))
        return Linked()


class Linked:
    """A program without uniforms."""

    def get(self, _name, default):
        return default


def test_a_head_has_what_the_text_or_another_define_speaks_of():
    defines = {"ONE": 1, "TWO": "ONE + 1", "EACH(F)": "F(0) F(1)", "OTHER": 3}
    head = _head("float x = TWO;\nEACH(DO)\n", defines)
    assert re.findall(r"^#define (\w+)", head, re.MULTILINE) == ["ONE", "TWO", "EACH"]
    assert head.startswith("#version")


def test_programs_that_differ_in_their_fragments_share_their_vertex_shader():
    context = Recorder()
    library = ProgramLibrary(context, ())
    for covered, ocean_colour in ((0, 0), (1, 0), (0, 1)):
        defines = {"SMOOTH": 1, "COVERED": covered, "OCEAN_COLOUR": ocean_colour, **TABLE_DEFINES}
        library.get("earth/earth.vert", "earth/earth.frag", defines)
    assert len({vertex for vertex, _ in context.texts}) == 1
    assert len({fragment for _, fragment in context.texts}) == 3
