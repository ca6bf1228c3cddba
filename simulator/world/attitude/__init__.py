"""Attitude: rigid bodies under torque, the turning target, camera pointing, reaction wheels. No translation."""
