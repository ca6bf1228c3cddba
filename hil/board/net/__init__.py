"""A network that was trained on pictures of the target, as an estimator: numpy and OpenCV only, Python >= 3.9.

`flyaround train` writes its file, NumPy runs it; PyTorch is not needed here.
"""
