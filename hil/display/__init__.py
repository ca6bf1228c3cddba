"""Optical loop: frames on a screen viewed by a real camera, calibrated so that it sees the rendered image.

Patterns, what grabbed images of them tell, and the pre-distortion of frames. The window that shows them is gui/'s.
"""
