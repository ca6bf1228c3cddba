"""Recipes: independent samples of scenes for training and evaluation, as typed TOML files.

A sample depends on (recipe, seed, number) alone, so that workers, resumed and enlarged sets agree.
"""
