"""Image formation from a scene: exposure in time, motion blur, metering, lens and detector.

No labels.
"""
