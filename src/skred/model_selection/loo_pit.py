"""Leave-one-out probability integral transforms: where each reading lies in its prediction from the others.

Where predictions are as sure as they should be, these places are spread evenly from 0 to 1. Too many near 0
and 1: predictions are too sure; too many in the middle: not sure enough; too many at one end: biased.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr


def loo_pit(tree: xr.DataTree, log_weights: xr.DataArray) -> list[dict[str, Any]]:
    """Places of the recorded readings in what is predicted of them without their avalanche, by sensor.

    Parameters
    ----------
    tree : DataTree
        A calibration: ``observed_data`` and ``posterior_predictive`` by sensor are read.
    log_weights : DataArray
        Of the draws (event, chain, draw) for each avalanche left out as a whole, smoothed; see
        `arviz_stats.loo`.

    Returns
    -------
    list of dict
        For each sensor: ``sensor``; ``events``; ``below`` and ``up_to``, the probability of a reading that
        is smaller, and of one that is not larger, for each. They differ where a front may
        not come, which reads 0.
    """
    observed, predicted = (tree[name].to_dataset() for name in ("observed_data", "posterior_predictive"))
    rows = []
    for name, recorded in observed.data_vars.items():
        if name not in predicted:
            continue
        (dim,) = recorded.dims
        events = [str(event) for event in recorded[dim].values]
        draws = predicted[name].transpose(dim, "chain", "draw")
        # Predictions of large campaigns are thinned: only those draws have a reading.
        chosen = log_weights.sel(event=events, chain=draws["chain"], draw=draws["draw"])
        logs = chosen.transpose("event", "chain", "draw").values
        weights = np.exp(logs - logs.max(axis=(1, 2), keepdims=True))
        weights /= weights.sum(axis=(1, 2), keepdims=True)
        readings, values = draws.values, recorded.values[:, None, None]
        below = np.sum(weights * (readings < values), axis=(1, 2))
        same = np.sum(weights * (readings == values), axis=(1, 2))
        rows.append(
            {
                "sensor": str(recorded.attrs.get("long_name", name)),
                "events": events,
                "below": np.clip(below, 0.0, 1.0).tolist(),
                "up_to": np.clip(below + same, 0.0, 1.0).tolist(),
            }
        )
    return rows
