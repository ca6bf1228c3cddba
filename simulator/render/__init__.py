"""The only folder that imports moderngl: from a SceneState to radiance, by a list of passes.

Nothing here knows detectors, labels or files. The passes of the spacecraft, Earth, Moon and sky live in a folder each,
calls of OpenGL alone in gl/, and what saves a software driver work in software/. What neither calls OpenGL nor prepares
an upload belongs elsewhere: meshes and rays in geometry, what is precomputed of a craft in baking, light in scene.
"""
