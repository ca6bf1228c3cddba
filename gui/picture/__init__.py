"""Requests for pictures, and marks drawn over them; no window."""
