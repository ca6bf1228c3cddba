"""The learned pose proposal: a small network corrects the crop of a region and rates attitudes on SO(3).

Weights of each target lie in weights/, tools/train makes them. Nothing here decides which proposal is right.
"""
