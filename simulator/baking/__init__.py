"""Computed once and cached: charts, edges, hulls, visibility, radiance transfer of a mesh; creases of foil.

Arrays alone: no OpenGL, no scene, no camera. `render` uploads what is baked here.
"""
