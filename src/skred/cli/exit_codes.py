"""What a program ends with: one number that a script can ask for."""

DONE = 0
"""An answer, ``cannot_tell`` included."""
NOT_CONVERGED = 1
"""The chains did not converge: do not use the numbers."""
BAD_INPUT = 2
"""Something given cannot be used, or a file cannot be read or written."""
FAULT = 3
"""A fault of skred; its traceback is in a file."""
INTERRUPTED = 130
"""Ctrl-C."""
