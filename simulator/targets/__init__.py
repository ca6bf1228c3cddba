"""Targets: geometry, materials, keypoints, wireframe, mass; target files and imported meshes. No GL, no world."""
