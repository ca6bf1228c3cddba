"""From a scene to one picture: exposure in time, motion blur, metering, and image formation by lens and detector.

No labels.
"""
