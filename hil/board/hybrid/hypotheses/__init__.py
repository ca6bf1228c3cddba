"""Pose hypotheses, their support by edges, and the criterion by which two of them are distinct.

Nothing here generates or refines hypotheses.
"""
