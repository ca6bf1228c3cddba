"""Labels proposed from a mesh: keypoints, wireframe, occluders, mass. The mesh is not changed."""
