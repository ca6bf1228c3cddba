"""The Sharma-Ventura-D'Amico pose estimator. numpy and OpenCV only, Python >= 3.9."""
