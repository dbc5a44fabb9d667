"""Scores of answers to trials of which the truth is known."""
