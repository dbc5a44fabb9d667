"""Bayesian calibration and comparison of avalanche block models against recordings."""
