"""Mesh files of others, read as they are: glTF (with Draco), OBJ, STL. Nothing is repaired or proposed here."""
