"""What is found in an image without a model: area averages, noise, line segments; C, and its calls."""
