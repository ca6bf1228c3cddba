"""Geometry of triangle meshes: rays, projection, hidden lines, clipping, subdivision, decimation, rasterisation.

On the CPU, from arrays to arrays. Nothing here knows targets, cameras, poses, light, files or OpenGL.
"""
