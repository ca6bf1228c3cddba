"""Programs run from a checkout, not in the wheel. They may import everything; only tests import them."""
