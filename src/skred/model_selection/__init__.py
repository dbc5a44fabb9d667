"""Comparison of laws on one campaign: leave-one-event-out, WAIC, evidence, stacking weights."""
