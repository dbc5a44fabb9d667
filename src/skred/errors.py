"""The error of a person's input, told without a traceback."""


class InputError(ValueError):
    """Something given on the command line, in a file or to a function cannot be used.

    The message says what was expected and what to do.
    """


class UnknownNameError(InputError, KeyError):
    """A name that nothing has; the message tells those that there are. It is what a mapping raises, too."""

    def __str__(self) -> str:
        """The message; a KeyError would show its repr."""
        return Exception.__str__(self)
