"""Readers of mesh files: glTF (with Draco), OBJ, STL, and others by trimesh. Nothing is repaired or proposed here."""
