"""Front speeds along the track by a calibration, and medians of its strengths: what figures show of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtri

from skred.arrays import FloatArray
from skred.inference.hierarchical.population import population_of
from skred.inference.problem import Problem
from skred.inference.results import chain_and_draw, draws_by_name
from skred.physics.law import Law

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Ends of the central 90 and 50 % bands, and the median: what the figures along the track draw."""
_MOST_RESPONSES, _MOST_AVALANCHES = 400, 1000
"""Draws of the mean response, and new avalanches, that bands are made of: enough for their 5 % quantiles."""
_MEDIANS, _AVALANCHES_OF_A_MEDIAN = 120, 100
"""Draws whose median front is drawn, and avalanches of each: the band of medians is then known to a line."""


def with_along_track(tree: xr.DataTree, law: Law, problem: Problem) -> xr.DataTree:
    """A calibration's tree with what only its figures need.

    Parameters
    ----------
    tree : DataTree
        See `skred.inference.results.assemble`.
    law : Law
    problem : Problem
        What it was calibrated on.

    Groups
    ------
    along_track : quantiles of the front ``speed`` (quantile, edge) of the mean response, or of new avalanches
        where every avalanche has its own parameters, then also of their ``median_speed``; releases
    median_strength : the median of each strength across avalanches (chain, draw)
    """
    posterior = tree["posterior"].to_dataset()
    samples = draws_by_name(problem, law, posterior)
    more = tree.copy()
    if problem.likelihood == "hierarchical":
        more["along_track"] = xr.DataTree(_of_new_avalanches(tree, law, problem, samples))
        more["median_strength"] = xr.DataTree(_median_strengths(posterior, law, samples))
    else:
        more["along_track"] = xr.DataTree(_of_mean_response(law, problem, samples))
    return more


def _dataset(problem: Problem, releases: FloatArray, **speeds: FloatArray) -> xr.Dataset:
    """Quantiles of speeds, (n, n_edges) each, and of releases."""
    variables: dict[str, Any] = {
        name: (("quantile", "edge"), np.quantile(values, QUANTILES, axis=0), {"units": "m s-1"})
        for name, values in speeds.items()
    }
    variables["release"] = ("quantile", np.quantile(releases, QUANTILES), {"units": "m"})
    edge = ("edge", problem.terrain.edge_s_m, {"units": "m"})
    return xr.Dataset(variables, coords={"quantile": list(QUANTILES), "s": edge})


def _evenly(samples: dict[str, FloatArray], most: int) -> dict[str, FloatArray]:
    """Evenly chosen draws."""
    n = len(next(iter(samples.values())))
    chosen = np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))
    return {name: values[chosen] for name, values in samples.items()}


def _of_mean_response(law: Law, problem: Problem, samples: dict[str, FloatArray]) -> xr.Dataset:
    """Of the mean response, from the median of the releases."""
    releases = np.array([event.release_s_m for event in problem.campaign.events])
    rows = law.strength_rows(_evenly(samples, _MOST_RESPONSES))
    begin = np.median([event.release_speed_m_s or 0.0 for event in problem.campaign.events])
    speeds = problem.speeds(law.mechanisms, rows, float(np.median(releases)), float(begin))
    return _dataset(problem, releases, speed=speeds)


def _of_new_avalanches(
    tree: xr.DataTree, law: Law, problem: Problem, samples: dict[str, FloatArray]
) -> xr.Dataset:
    """Of randomly chosen new avalanches, and of their median by draws of the population."""
    strengths, releases, begin = _avalanches(tree, law)
    speeds = problem.speeds(law.mechanisms, strengths, releases, begin)
    medians = _median_speeds(law, problem, samples, releases, begin)
    return _dataset(problem, releases, speed=speeds, median_speed=medians)


def _avalanches(tree: xr.DataTree, law: Law) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Strengths (n, n_strengths), releases and speeds there (n,) of randomly chosen new avalanches."""
    predictive = tree["new_avalanches"].to_dataset()
    names = [*(mechanism.strength.name for mechanism in law.mechanisms), "release", "release_speed"]
    rows = [predictive[name].transpose("chain", "draw", "event").values.ravel() for name in names]
    chosen = np.random.default_rng(0).permutation(len(rows[0]))[:_MOST_AVALANCHES]
    table = np.column_stack(rows)[chosen]
    return np.ascontiguousarray(table[:, :-2]), table[:, -2].copy(), table[:, -1].copy()


def _median_speeds(
    law: Law, problem: Problem, samples: dict[str, FloatArray], releases: FloatArray, begin: FloatArray
) -> FloatArray:
    """Median speed across new avalanches for each of some draws of the population, (n_draws, n_edges).

    The avalanches of all draws are the same ones in standard deviations (a Latin hypercube), so that
    the medians differ by the population alone.
    """
    means, factors = population_of(law, _evenly(samples, _MEDIANS))
    rng, size = np.random.default_rng(0), _AVALANCHES_OF_A_MEDIAN
    ranks = np.column_stack([rng.permutation(size) for _ in law.mechanisms])
    deviations = ndtri((ranks + 0.5) / size)
    places, start = np.resize(releases, size), np.resize(begin, size)
    rows = [np.exp(mean + deviations @ factor.T) for mean, factor in zip(means, factors, strict=True)]
    return np.array([np.median(problem.speeds(law.mechanisms, row, places, start), axis=0) for row in rows])


def _median_strengths(posterior: xr.Dataset, law: Law, samples: dict[str, FloatArray]) -> xr.Dataset:
    shape = posterior.sizes["chain"], posterior.sizes["draw"]
    columns = law.strength_rows(samples).T
    strengths = [mechanism.strength for mechanism in law.mechanisms]
    return xr.Dataset(
        {
            strength.name: (("chain", "draw"), values.reshape(shape), {"units": strength.unit})
            for strength, values in zip(strengths, columns, strict=True)
        },
        coords=chain_and_draw(posterior),
    )
