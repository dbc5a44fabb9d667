"""What other packages offer and cannot be used, told on stderr: one line each, and the command goes on."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from skred.physics.plugins import Refused


def tell_refused(*refused: "Refused") -> None:
    """Tell of some."""
    for one in refused:
        print(f"warning: {one}", file=sys.stderr)


def tell_refused_mechanisms() -> None:
    """Tell of the mechanisms that a command leaves out."""
    from skred.physics.mechanisms import library

    tell_refused(*library().refused)
