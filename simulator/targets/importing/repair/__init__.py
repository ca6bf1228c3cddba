"""Repair of a mesh: placement, welding, orientation, holes, normals. No file formats, no labels."""
