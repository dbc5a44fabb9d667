"""Events' likelihoods on a grid of added strengths, and between its strengths."""
