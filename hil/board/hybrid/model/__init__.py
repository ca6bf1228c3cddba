"""Prepared target and its synthetic views: edges, faces, shadows.

Nothing here searches for a pose.
"""
