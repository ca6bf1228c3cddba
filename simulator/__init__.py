"""The simulator: world, targets, camera, scene, render, labels, data sets. Imports neither gui nor hil."""
