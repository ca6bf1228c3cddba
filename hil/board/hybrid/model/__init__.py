"""The prepared target and its synthetic views: edges, faces, shadows.

Nothing here searches.
"""
