"""Readers of mesh files: glTF (with Draco), OBJ, STL. Nothing is repaired or proposed here."""
