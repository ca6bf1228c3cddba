"""Relative motion of chaser and target: closed-form solutions and one integrated step. No guidance."""
