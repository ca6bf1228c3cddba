"""Trained pose network as an estimator: NumPy and OpenCV only, Python >= 3.9.

``flyaround train`` writes the file and NumPy evaluates it; PyTorch is not needed on the board.
"""
