"""The packages that read terrain models and lines, which not every installation has."""

from __future__ import annotations

import importlib

from skred.errors import InputError

REQUIREMENTS = ("pyogrio>=0.13", "pyproj>=3.8", "rasterio>=1.5", "shapely>=2.2")
"""As the extra `gis` has them."""


def require_gis() -> None:
    """Make sure that the extra `gis` is installed.

    Raises
    ------
    InputError
        With the command that installs it.
    """
    missing = []
    for requirement in REQUIREMENTS:
        name = requirement.partition(">=")[0]
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name)
    if missing:
        command = "python -m pip install " + " ".join(f'"{one}"' for one in REQUIREMENTS)
        raise InputError(
            f"terrain models and lines need packages that are not installed ({', '.join(missing)}); "
            f"install them with\n  {command}\n"
            "or, in a checkout of skred, with\n  python -m uv sync --extra gis"
        )
