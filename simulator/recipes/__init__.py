"""Plans of recipes: independent samples of scenes for training and evaluation.

A sample depends on (recipe, seed, number) only, so that parallel, resumed and enlarged captures agree.
"""
