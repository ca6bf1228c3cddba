"""Generators of the pages and images of docs/ that the software itself makes."""
