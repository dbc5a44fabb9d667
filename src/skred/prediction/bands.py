"""Numbers of a prediction with their bands, as plain data."""

from __future__ import annotations

from typing import Any

import xarray as xr

from skred.prediction.track import PredictionTrack


def banded(data: xr.Dataset, name: str, **place: int) -> dict[str, float]:
    """A quantity at one place: ``value``, ``low`` and ``high``."""
    keys = (("value", ""), ("low", "_low"), ("high", "_high"))
    return {key: float(data[f"{name}{suffix}"].isel(place)) for key, suffix in keys}


def runouts_exceeded_by(data: xr.Dataset, track: PredictionTrack) -> list[dict[str, Any]]:
    """The runout that each share of avalanches exceeds; ``at_least`` where it is the end of the track."""
    rows = []
    for k, share in enumerate(data["share"].values):
        band = banded(data, "runout_quantile", share=k)
        at_least = bool(band["value"] >= track.length_m)
        rows.append({"share": float(share), "unit": "m", **band, "at_least": at_least})
    return rows
