"""Time, frames, ephemeris, orbits, attitude, guidance. No GL, no target, no camera."""
