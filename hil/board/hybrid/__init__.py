"""The method ``hybrid``: a network proposes poses, comparison with drawn views refines and decides.

numpy, OpenCV and the compiled library in ``native``; Python >= 3.9. ``estimator`` lists the stages.
"""
