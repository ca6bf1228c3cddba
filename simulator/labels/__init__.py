"""Masks, boxes, keypoint states and feasibility, from a scene and its rendered buffers."""
