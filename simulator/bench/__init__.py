"""Times this package."""
