"""Tango, the target of PRISMA and of the SPEED benchmarks, built from numbers. No other craft."""
