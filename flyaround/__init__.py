"""The face: public API and command line. Composes everything, holds no logic."""
