"""Slow, independent log Bayes factors, to compare those of the diagnosis with."""
