"""Inference: likelihoods of recordings, sampling of posteriors, and scores of predictions."""
