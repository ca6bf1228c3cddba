"""Makes the pages and images of docs/ that are made with the software itself."""
