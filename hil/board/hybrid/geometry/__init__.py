"""Data types and mathematics shared by all stages and the native library: faces, wireframe, patch, camera response.

Nothing here searches, renders or calls compiled code.
"""
