"""What is known of the target before an image comes, and how it looks from a pose: edges, faces, shadows.

Nothing here searches.
"""
