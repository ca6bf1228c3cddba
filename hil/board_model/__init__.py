"""Records of a board model: keypoints, wireframe, occluders, outer faces, contours.

Made at the host from a target. Nothing is drawn here, and nothing of it runs on a board.
"""
