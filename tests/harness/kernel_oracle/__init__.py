"""What the compiled library computes, in numpy: the reference of its tests."""
