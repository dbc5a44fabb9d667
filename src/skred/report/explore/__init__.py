"""Figures to explore: those of arviz-plots, drawn by bokeh, of what a file of draws holds."""
