"""What a program ends with: one number that a script can ask for."""

DONE = 0
"""An answer."""
NOT_CONVERGED = 1
"""The chains did not converge."""
BAD_INPUT = 2
"""Something given cannot be used."""
INTERRUPTED = 130
"""Ctrl-C."""
