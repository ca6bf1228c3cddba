"""The ascent vehicle of Chang'e-6."""
