"""Step 1: what the recordings could show at all."""
