"""Predictions on a track by a calibrated population: probabilities of front speed and runout."""
