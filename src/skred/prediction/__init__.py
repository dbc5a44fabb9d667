"""A calibrated population of avalanches carried to a track: front speed and runout with probabilities."""
