"""Geometry of triangle meshes: ray casting, projection, hidden lines, clipping, subdivision, rasterisation. On the CPU.

Takes and returns arrays. Nothing here knows targets, cameras, poses, light, files or OpenGL.
"""
