"""The keypoint network: crops of an image, distributions of keypoints in them, poses from the distributions."""
