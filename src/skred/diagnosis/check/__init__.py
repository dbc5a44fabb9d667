"""Step 2: whether anything is wrong, by a parametric bootstrap test."""
