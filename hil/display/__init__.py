"""Optical loop: frames on a screen viewed by a real camera, calibrated so that it sees the rendered image.

Contains the calibration patterns, the calibration from images of them, and the pre-distortion of frames. The window
that shows them is part of ``gui``.
"""
