"""Creation of the OpenGL context: the requested version."""

import moderngl
import pytest

from flyaround.simulator.render.gl.context import REQUIRED_VERSION, create_context

pytestmark = pytest.mark.gl


def test_required_gl_version_is_requested(monkeypatch):
    # NVIDIA's driver gives 3.3 to who asks for that, and 4.1 to who asks for 4.1; Mesa's gives its newest to both
    asked = []
    create = moderngl.create_context

    def asking(**options):
        asked.append(options.get("require"))
        return create(**options)

    monkeypatch.setattr(moderngl, "create_context", asking)
    context = create_context()
    try:
        assert context.version_code >= REQUIRED_VERSION
        assert asked == [REQUIRED_VERSION]
    finally:
        context.release()
