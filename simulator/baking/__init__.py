"""What is computed of a mesh once and cached: charts, edges, hulls, visibility, radiance transfer between parts.

Arrays alone: no OpenGL, no scene, no camera. `render` uploads what is baked here.
"""
