"""The packages that draw and serve the dashboard, which not every installation has."""

from __future__ import annotations

import importlib

from skred.errors import InputError

PACKAGES = ("bokeh", "panel")
"""As the extra `dashboard` has them."""


def require_dashboard() -> None:
    """Make sure that the extra `dashboard` is installed.

    Raises
    ------
    InputError
        With the command that installs it.
    """
    missing = []
    for name in PACKAGES:
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name)
    if missing:
        raise InputError(
            f"the dashboard needs packages that are not installed ({', '.join(missing)});"
            " install them with: pip install 'skred[dashboard]'"
        )
