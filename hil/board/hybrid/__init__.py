"""Pose estimation method ``hybrid``: a keypoint network proposes poses; rendered views refine and verify them.

It needs NumPy, OpenCV, the compiled library in ``native`` and Python >= 3.9. ``estimator`` defines the stages.

Thresholds whose comment names no source are hand-tuned on the development frames of docs/lab/2026-11-estimator.md.
"""
