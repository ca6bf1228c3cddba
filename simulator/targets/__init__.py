"""Parametric spacecraft: geometry, materials, keypoints, wireframe; the target file. No GL, no world."""
