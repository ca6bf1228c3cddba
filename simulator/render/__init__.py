"""The only folder that imports moderngl: from a SceneState to radiance, by a list of passes.

Nothing here knows detectors, labels or files. A body's passes live in its folder, calls of OpenGL alone in gl/, and
what spares a software driver work in software/.
"""
