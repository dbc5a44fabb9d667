"""The work of the commands as functions that return results: what ``import skred`` offers."""
