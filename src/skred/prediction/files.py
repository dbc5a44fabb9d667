"""A prediction's files: three tables, netCDF and a summary, each whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.recorded_data import recorded_groups
from skred.inference.results import save
from skred.output import write_json, write_text
from skred.prediction.places_table import BYTE_ORDER_MARK, places_table
from skred.prediction.probabilities import PARTS

TABLES = ("exceedance.csv", "runout.csv", "uncertainty.csv")
AT_TABLE = "places.csv"
FILES = (*TABLES, AT_TABLE, "prediction.nc", "prediction.json")
"""What a prediction writes beside the posterior, the last one last; `AT_TABLE` where there are places."""


def write_prediction(
    document: dict[str, Any],
    data: xr.Dataset | None,
    problem: HierarchicalProblem,
    folder: Path,
) -> None:
    """Write the tables, ``prediction.nc`` and, when all is there, ``prediction.json``; figures need no more.

    Without data, because the gate failed, only the last. What an earlier prediction left in the folder
    goes first, so that nothing of it stands beside the new one.
    """
    for name in reversed(FILES):
        (folder / name).unlink(missing_ok=True)
    if data is not None:
        for name, text in zip(TABLES, tables(data), strict=True):
            write_text(folder / name, text)
        if document["at"]:
            write_text(folder / AT_TABLE, BYTE_ORDER_MARK + places_table(document))
        groups = {"/": data, **recorded_groups(problem)}
        save(xr.DataTree.from_dict(groups), folder / "prediction.nc")
    write_json(folder / "prediction.json", document)


def tables(data: xr.Dataset) -> tuple[str, str, str]:
    """The three tables as CSV: exceedance of speeds, exceedance of runouts, and parts of the uncertainty."""
    place = [[f"{value:.2f}" for value in data[name].values] for name in ("s", "x", "z")]
    rows = list(zip(*place, strict=True))
    speeds = data["speed"].values
    faster = _bands(data, "speed_probability")
    exceedance = [
        (*row, f"{speed:g}", *map(_number, faster[k, j]))
        for k, row in enumerate(rows)
        for j, speed in enumerate(speeds)
    ]
    runout = [
        (*row, *map(_number, band))
        for row, band in zip(rows, _bands(data, "runout_probability"), strict=True)
    ]
    names = ("arrival_probability", "mean_speed", *(f"speed_sd_{part}" for part in (*PARTS, "total")))
    columns = np.stack([data[name].values for name in names], axis=-1)
    uncertainty = [(row[0], *map(_number, values)) for row, values in zip(rows, columns, strict=True)]
    band = "probability,low,high"
    return (
        _csv(f"s_m,x_m,z_m,speed_m_s,{band}", exceedance),
        _csv(f"s_m,x_m,z_m,{band}", runout),
        _csv(
            "s_m,arrival_probability,mean_speed_m_s,"
            + ",".join(f"sd_{part}_m_s" for part in (*PARTS, "total")),
            uncertainty,
        ),
    )


def _bands(data: xr.Dataset, name: str) -> FloatArray:
    return np.stack([data[f"{name}{suffix}"].values for suffix in ("", "_low", "_high")], axis=-1)


def _number(value: float) -> str:
    """Five decimals, more than the simulation supports; empty where there is no number."""
    return "" if np.isnan(value) else f"{value:.5f}"


def _csv(header: str, rows: list[tuple[str, ...]]) -> str:
    return "\n".join([header, *(",".join(row) for row in rows)]) + "\n"
