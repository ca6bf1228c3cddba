"""Verification of the labels of a data set.

Projected keypoints and their visibility, boxes, the pose, the silhouette and the visible edges are recomputed with
OpenCV or by ray casting, as are depth, normals and parts at sampled pixels, not with the code that made them. Shared
with that code are the target's mesh (`joined_mesh`), rotations, the row times of a rolling shutter (`pose_at_rows`),
the edges on which brightness steps are measured (`view_edges`), the noise model, eclipses, the rule for feasible frames
(`infeasible_reason`), hashes and, beyond OpenCV's domain, the lens; images are redrawn by the renderer itself. The
check does not find errors in shared code.
"""
