"""The one type of pose hypothesis, its support by edges, and when two are two answers.

Nothing here makes or moves one.
"""
