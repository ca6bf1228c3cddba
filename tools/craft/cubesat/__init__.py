"""CubeSats of one, three and six units on the rails of the CubeSat Design Specification."""
