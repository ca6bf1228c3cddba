"""Plans of recipes: independent samples of scenes for training and evaluation.

A sample depends on (recipe, seed, number) alone, so that workers, resumed and enlarged sets agree.
"""
