"""Our pictures beside pictures of others: figures, the choice of the like view, the page."""
