"""OpenGL rendering, from a SceneState to radiance by a list of passes. Only this folder imports moderngl.

Nothing here knows detectors, labels or files. Spacecraft, Earth, Moon and sky have a folder each; gl/ wraps OpenGL, and
software/ holds optimisations for software drivers. Code that neither calls OpenGL nor prepares an upload belongs
elsewhere: meshes and rays in geometry, precomputed data of a craft in baking, light in scene.
"""
