"""What runs on the board: the agent and the estimator. numpy and OpenCV only, Python >= 3.9."""
