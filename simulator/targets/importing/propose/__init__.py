"""Labels proposed from a shape: keypoints, wireframe, occluders, mass. The mesh is not changed."""
