"""A synthetic view against the image: radiometric gains, image Jacobian, normal equations, cost; C, and its calls."""
