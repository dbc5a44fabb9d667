"""The pooled likelihood: one parameter vector for the path, the paper's."""
