"""The error of a person's input, told without a traceback."""


class InputError(ValueError):
    """Something given on the command line or in a file cannot be used; the message says what to do."""
