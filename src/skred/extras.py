"""The packages of the extras, which not every installation has."""

from __future__ import annotations

import importlib
from typing import Literal

from skred.errors import InputError

REQUIREMENTS = {
    "gis": ("pyogrio>=0.13", "pyproj>=3.8", "rasterio>=1.5", "shapely>=2.2"),
    "dashboard": ("panel>=1.10",),
}
"""As ``pyproject.toml`` has them."""
_USE = {"gis": "terrain models and lines need", "dashboard": "the dashboard needs"}


def require(extra: Literal["gis", "dashboard"]) -> None:
    """Make sure that an extra is installed.

    Raises
    ------
    InputError
        With the commands that install it.
    """
    missing = []
    for requirement in REQUIREMENTS[extra]:
        name = requirement.partition(">=")[0]
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name)
    if missing:
        command = "python -m pip install " + " ".join(f'"{one}"' for one in REQUIREMENTS[extra])
        raise InputError(
            f"{_USE[extra]} packages that are not installed ({', '.join(missing)}); "
            f"install them with\n  {command}\n"
            f"or, in a checkout of skred, with\n  python -m uv sync --extra {extra}"
        )
