"""What a program ends with: one number that a script can ask for."""

DONE = 0
"""An answer, ``cannot_tell`` included."""
NOT_CONVERGED = 1
"""The chains did not converge: do not use the numbers."""
BAD_INPUT = 2
"""Something given cannot be used, or a file cannot be read or written."""
FAULT = 3
"""A fault of skred; its traceback is in a file."""
INTERRUPTED, TERMINATED = 130, 143
"""Ctrl-C, and SIGTERM."""
MEANING = (
    "Ends with 0: an answer, cannot_tell included; 1: the chains did not converge; 2: something given cannot "
    "be used; 3: a fault of skred."
)
"""As the help tells it."""
