"""The optical loop: frames on a screen that a real camera looks at, calibrated so that it sees what was drawn.

Patterns, what grabbed pictures of them tell, and the pre-distortion of frames. The window that shows them is gui/'s.
"""
