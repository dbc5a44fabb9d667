"""A prediction's numbers as plain data, for files and tables."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

from skred.inference.calibrate import Calibration
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY
from skred.prediction.bands import banded, runouts_exceeded_by
from skred.prediction.own_places import own_places, places_left_out
from skred.prediction.probabilities import PARTS
from skred.prediction.source import Source
from skred.prediction.statement import prediction_statement, warnings_of
from skred.prediction.terms import added_rows
from skred.prediction.track import PredictionTrack
from skred.prediction.wanted import Wanted
from skred.prediction.without_added import without_added


def prediction_document(
    calibration: Calibration,
    track: PredictionTrack,
    data: xr.Dataset | None,
    wanted: Wanted | None = None,
    source: Source | None = None,
    base: xr.Dataset | None = None,
    command: str | None = None,
) -> dict[str, Any]:
    """Summary of a prediction as plain data; without `data` it is marked as failed and has no numbers.

    `base` is the same by the base law, where something was added to that; `command` is what was typed. The
    document's ``statement`` says in sentences what it means.
    """
    problem, law, campaign = calibration.problem, calibration.law, calibration.problem.campaign
    assert isinstance(problem, HierarchicalProblem)
    document: dict[str, Any] = {
        "format": 1,
        "valid": data is not None,
        "campaign": {
            "name": campaign.name,
            "fingerprint": calibration.tree.attrs["campaign_fingerprint"],
            "n_events": campaign.n_events,
            **_described(calibration, source),
        },
        "law": {"id": law.id, "title": law.title, "equation": law.equation},
        "changed_priors": dict(law.changed_priors),
        "prior_note": law.prior_note,
        "track": {
            "name": track.name,
            "is_own": track.is_own,
            "length_m": track.length_m,
            "fingerprint": track.fingerprint(),
            "reference_s_m": track.reference_s_m,
            "release": track.release_text,
            "horizontal_length_m": float(np.ptp(track.track.x_m)),
            "origin": track.origin,
            "releases_s_m": sorted(set(track.releases.mean.tolist())),
        },
        "error_model": {"id": problem.error_model.id, "title": problem.error_model.title},
        "smoothing_m": problem.terrain.smoothing_m,
        "settings": calibration.settings.as_dict(),
        "versions": json.loads(calibration.tree.attrs["versions"]),
        "gate": calibration.gate.as_dict(),
        "interval": {"kind": INTERVAL_KIND, "probability": INTERVAL_PROBABILITY},
    }
    wanted = wanted or Wanted()
    document |= {"from": None if source is None else source.as_dict(), **wanted.as_dict()}
    added = () if source is None else source.stored.added
    document["added"] = added_rows(added, track)
    used = dict.fromkeys(row["title"].partition(":")[0] for row in document["added"] if row["used"])
    if used:
        document["law"]["title"] += f", with {' and '.join(used)}"
    left_out = places_left_out(problem, track, wanted)
    document["places_left_out"] = [{"name": name, "s_m": s} for name, s in left_out]
    empty = ("simulation", "reading_errors", "runout", "places", "at")
    document |= dict.fromkeys(empty) if data is None else _numbers(problem, track, data)
    document["without_added"] = None if source is None else without_added(source, track, base)
    document["made"] = {
        "command": command,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": int(calibration.tree.attrs["seed"]),
    }
    document["warnings"] = warnings_of(document)
    document["statement"] = prediction_statement(document)
    return document


def _described(calibration: Calibration, source: Source | None) -> dict[str, str]:
    """What the campaign says of itself; a calibration that was read again does not know."""
    if source is not None:
        return source.recorded or {"description": "", "source": ""}
    campaign = calibration.problem.campaign
    return {"description": campaign.description, "source": campaign.source}


def recorded_runouts(problem: HierarchicalProblem, track: PredictionTrack) -> tuple[float, float] | tuple[()]:
    """Shortest and longest recorded runout [m], on the campaign's own track only."""
    of_runout = [sensor.is_runout for sensor in problem.campaign.sensors]
    values = problem.values[:, of_runout]
    if not track.is_own or not np.isfinite(values).any():
        return ()
    return float(np.nanmin(values)), float(np.nanmax(values))


def _numbers(problem: HierarchicalProblem, track: PredictionTrack, data: xr.Dataset) -> dict[str, Any]:
    last = data.sizes["s"] - 1
    return {
        "simulation": json.loads(data.attrs["simulation"]),
        "reading_errors": {
            "velocity": json.loads(data.attrs["reading_error_velocity"]),
            "runout": json.loads(data.attrs["reading_error_runout"]),
        },
        "runout": {
            "exceeded_by": runouts_exceeded_by(data, track),
            "end_of_track": {"s_m": track.length_m, **banded(data, "runout_probability", s=last)},
            "once_in": json.loads(data.attrs["runout_once_in"]),
            "does_not_start": float(data.attrs["share_that_does_not_start"]),
            "beyond_recorded": [
                {"s_m": s, **banded(data, "runout_probability", s=_nearest(data, s))}
                for s in recorded_runouts(problem, track)
            ],
            "all": _runout_parts(data, "runout"),
            "beyond_shortest_recorded": _runout_parts(data, "long_runout"),
        },
        "at": json.loads(data.attrs["at"]),
        "places": [_place(data, name, s) for name, s in own_places(problem, track).shown],
    }


def _place(data: xr.Dataset, name: str, s_m: float) -> dict[str, Any]:
    """What is predicted at one place."""
    k = _nearest(data, s_m)
    return {
        "name": name,
        "s_m": s_m,
        "beyond": banded(data, "runout_probability", s=k),
        "faster": [
            {"speed_m_s": float(speed), **banded(data, "speed_probability", s=k, speed=j)}
            for j, speed in enumerate(data["speed"].values)
        ],
        "speed_exceeded_by": [
            {"share": float(q), **banded(data, "speed_quantile", s=k, share=j)}
            for j, q in enumerate(data["share"].values)
        ],
        "mean_speed_m_s": float(data["mean_speed"][k]),
        **{f"speed_sd_{part}_m_s": float(data[f"speed_sd_{part}"][k]) for part in (*PARTS, "total")},
    }


def _nearest(data: xr.Dataset, s_m: float) -> int:
    return int(np.abs(data["s"].values - s_m).argmin())


def _runout_parts(data: xr.Dataset, name: str) -> dict[str, float] | None:
    """Mean and standard deviations [m] of runouts."""
    if f"{name}_mean" not in data:
        return None
    parts = {f"sd_{part}_m": float(data[f"{name}_sd_{part}"]) for part in (*PARTS, "total")}
    return {"mean_m": float(data[f"{name}_mean"]), **parts}
