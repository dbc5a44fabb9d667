"""A track that was made from a terrain model: its figure and its table."""
