"""The published methods, as published: Sharma et al. (2018), and the thesis's version of it.

What the papers leave open is chosen here and said in docs/svd_methods.md. Nothing else imports this folder.
"""
