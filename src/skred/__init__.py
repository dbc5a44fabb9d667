"""Bayesian calibration and comparison of avalanche block models against recordings.

`calibrate`, `compare`, `identify`, `diagnose` and `predict` do what the commands of these names do, and
return a `Result`. What cannot be used raises `InputError`. See ``docs/python.md``. Nothing heavy is imported
before it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from skred.errors import InputError
from skred.parallel.folders import let_pytensor_write

if TYPE_CHECKING:
    from skred.api.calibration import calibrate, compare
    from skred.api.diagnosis import diagnose, identify
    from skred.api.fronts import front_readings
    from skred.api.model import model
    from skred.api.prediction import predict
    from skred.api.problems import laws, mechanisms, read_campaign
    from skred.api.results import Result

let_pytensor_write()  # before anything imports it

__all__ = [
    "InputError",
    "Result",
    "calibrate",
    "compare",
    "diagnose",
    "front_readings",
    "identify",
    "laws",
    "mechanisms",
    "model",
    "predict",
    "read_campaign",
]
_ROOMS = {
    "calibration": ("calibrate", "compare"),
    "diagnosis": ("diagnose", "identify"),
    "fronts": ("front_readings",),
    "model": ("model",),
    "prediction": ("predict",),
    "problems": ("laws", "mechanisms", "read_campaign"),
    "results": ("Result",),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for the first time."""
    for room, names in _ROOMS.items():
        if name in names:
            found = getattr(import_module(f"skred.api.{room}"), name)
            globals()[name] = found
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """With what is imported when it is asked for."""
    return sorted({*globals(), *__all__})
