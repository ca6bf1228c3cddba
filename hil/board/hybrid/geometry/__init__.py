"""Plain data and mathematics that all rooms and the native part share: rotations, camera, faces, wireframe, patch.

Nothing here searches, draws or calls compiled code.
"""
