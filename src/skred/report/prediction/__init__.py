"""Figures and table of a prediction."""
