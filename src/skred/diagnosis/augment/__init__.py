"""Step 4: the named mechanism added to the law, and the law calibrated again."""
