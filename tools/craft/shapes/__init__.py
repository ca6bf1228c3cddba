"""Shapes: meshes, plates, solids and plates wrapped on bodies of revolution."""
