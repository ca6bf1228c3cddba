"""Keypoint network: image crops, keypoint distributions in them, and poses from the distributions."""
