"""The views, one a file: each makes panels of a run, or of all runs."""
