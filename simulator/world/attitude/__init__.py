"""Attitude: rigid bodies under torque, the rotating target, camera pointing, reaction wheels. No translation."""
