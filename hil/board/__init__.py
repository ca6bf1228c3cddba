"""Board software: agent and estimators. Needs numpy and OpenCV only, Python >= 3.9."""
