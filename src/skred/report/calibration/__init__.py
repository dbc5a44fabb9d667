"""Figures of one calibrated law."""
