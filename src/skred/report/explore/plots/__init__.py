"""The plots of arviz-plots, one a file: each makes panels of a run, or of plain numbers."""
