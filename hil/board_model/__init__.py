"""Records of a board model: keypoints, wireframe, occluders, outer faces, contours.

Built on the host from a target; nothing here is imported on a board.
"""
