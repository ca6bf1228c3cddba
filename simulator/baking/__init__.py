"""Baked data, computed once and cached: charts, edges, hulls, visibility and radiance transfer of a mesh; foil creases.

Only arrays: no OpenGL, no scene, no camera. `render` uploads them.
"""
