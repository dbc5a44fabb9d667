"""pysindy's ensemble SINDy: sparse regression of d(U^2/2)/ds on a library of terms, bagged.

Profiles of U^2 are smoothing splines through release, readings and stop (straight lines where there are
few); rows are the middles between readings, so there are about as many as independent readings. Gravity is
known. Each event's own base terms are taken out of rows and columns first (Frisch and Waugh), which is the
same as having them in the library unpenalised. Columns are in standard units, for each mechanism those places
that go best with the rows. Name: the largest product of mean coefficient and inclusion over the ensemble;
probabilities go with that. Alarm: the square root of what the median model explains, in units of the rows'
scatter. A common release offset is no term of the derivative and cannot be seen. Fasel, Kutz, Brunton and
Brunton (2022), doi 10.1098/rspa.2021.0904.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline

from skred.campaign import Campaign
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.evidence.prior_odds import NOTHING, prior_odds
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.kernel.columns import GRAVITY
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.spec import Direction

from .common import Answer, Stretch, decided, is_dense, possible
from .profiles import Balance, cell_of, energy_balance, responses, starting_coefficients
from .quick_fit import stretch_of

FloatArray = NDArray[np.float64]
# Tuned on development trials, seeds 5000-5029 and 5100-5159; see `common`. The threshold, in standard units,
# was chosen from 0.1 and 0.2; differences instead of splines and thresholds of 0.05 to 0.15 did no better.
LIMITS = {"sparse": 9.95, "dense": 16.7}
THRESHOLD = 0.1
_RIDGE = 0.05
"""For each row."""
_LEAST_ERROR = 0.1
"""Of a slope [m s-2]: profiles are not that smooth."""
_MODELS = 50
_PLACES = 2
"""Columns of each mechanism in the library."""
_FEWEST_FOR_A_SPLINE = 6
_LEAST_ROWS_LEFT = 1
_SURE_OF_THE_LIST = 0.9
"""Weight of inclusion probabilities; the rest is the prior's, so that no id is impossible."""


class Rows:
    """Rows of the regression, one event after the other.

    Attributes
    ----------
    event : (n,) integer array
    place : (n,) array, m
    length : (n,) array, m
        Between the readings beside it.
    square : (n,) array
        Smooth U^2.
    slope : (n,) array, m s-2
        Half its derivative less gravity: what the terms are to explain.
    weight : (n,) array
        Inverse errors of the slope.
    before, after : (n,) integer arrays
        Which sensors a row lies between; -1 for the release and for the stop.
    """

    def __init__(self, problem: HierarchicalProblem, balance: Balance) -> None:
        parts = [_rows_of(problem, balance, i) for i in range(len(balance.place))]
        stacked = [np.concatenate(column) for column in zip(*parts, strict=True)]
        self.place, self.length, self.square, slope, error, before, after = stacked
        self.event = np.repeat(np.arange(len(parts)), [len(one[0]) for one in parts])
        self.slope = slope - GRAVITY * problem.terrain.sin_slope[cell_of(problem.terrain, self.place)]
        self.weight = 1.0 / error
        self.before, self.after = before.astype(int), after.astype(int)


def _rows_of(problem: HierarchicalProblem, balance: Balance, i: int) -> tuple[FloatArray, ...]:
    """Columns of `Rows` for one event, gravity still in."""
    known, m = balance.known[i], balance.place.shape[1] - 1
    speeds = [j for j, one in enumerate(problem.campaign.sensors) if not one.is_runout]
    column = np.append(-1, np.where(np.arange(m + 1) < m, np.append(speeds, -1), -1)[known])
    at = np.append(problem.releases.mean[i], balance.place[i, known])
    square = np.append(0.0, np.maximum(balance.square[i, known], 0.0))
    sd = np.append(5.0, balance.sd[i, known])
    order = np.argsort(at, kind="stable")
    at, square, sd, column = at[order], square[order], sd[order], column[order]
    apart = np.append(True, np.diff(at) > 1.0)
    at, square, sd, column = at[apart], square[apart], sd[apart], column[apart]
    middle, length = 0.5 * (at[1:] + at[:-1]), np.diff(at)
    if len(at) >= _FEWEST_FOR_A_SPLINE:
        spline = make_smoothing_spline(at, square, w=(1.0 / sd) ** 2)
        smooth, slope = np.maximum(spline(middle), 0.0), 0.5 * spline.derivative()(middle)
    else:
        smooth, slope = 0.5 * (square[1:] + square[:-1]), 0.5 * np.diff(square) / length
    error = np.hypot(0.5 * np.hypot(sd[1:], sd[:-1]) / length, _LEAST_ERROR)
    return middle, length, smooth, slope, error, column[:-1], column[1:]


def columns(
    rows: Rows, problem: HierarchicalProblem, law: Law, directions: list[Direction]
) -> tuple[FloatArray, FloatArray]:
    """Base terms, (n, n_base), and what one unit of each direction does to the slope, (n, n_directions)."""
    terrain, cell = problem.terrain, cell_of(problem.terrain, rows.place)

    def at_rows(direction_speed: float | None) -> dict[Any, FloatArray]:
        table = np.zeros((len(cell), terrain.n_cells))
        table[np.arange(len(cell)), cell] = rows.square
        found = responses(terrain, table, direction_speed or 8.0)
        return {column: values[np.arange(len(cell)), cell] for column, values in found.items()}

    by_speed = {one.weakening_speed: at_rows(one.weakening_speed) for one in directions}
    plain = at_rows(None)
    terms = [mechanism.term(terrain) for mechanism in law.mechanisms]
    base = np.column_stack([-profile[cell] * plain[column] for column, profile in terms])
    added = np.zeros((len(cell), len(directions)))
    for k, direction in enumerate(directions):
        for column, profile in zip(direction.columns, direction.profiles, strict=True):
            added[:, k] -= profile[cell] * by_speed[direction.weakening_speed][column]
        if direction.log_strengths is not None:
            added[:, k] += direction.log_strengths[rows.event] * base[:, 0]
        if direction.log_readings is not None:
            by = np.append(direction.log_readings, 0.0)  # -1: release and stop
            added[:, k] += rows.square * (by[rows.after] - by[rows.before]) / rows.length
    return base, added


def taken_out(rows: Rows, base: FloatArray, what: FloatArray) -> FloatArray:
    """What is left of columns after each event's own base terms."""
    left = what.copy()
    for i in np.unique(rows.event):
        own = rows.event == i
        if own.sum() - base.shape[1] < _LEAST_ROWS_LEFT:
            left[own] = 0.0
            continue
        left[own] -= base[own] @ np.linalg.lstsq(base[own], what[own], rcond=None)[0]
    return left


def library(
    todo: list[PlacedMechanism], added: FloatArray, target: FloatArray
) -> tuple[list[int], FloatArray]:
    """Which candidates the library has, and their columns in standard units."""
    norm = np.linalg.norm(added, axis=0)
    usual = float(np.median(norm[norm > 0.0])) if (norm > 0.0).any() else 1.0
    along = np.where(norm > 1e-6 * usual, target @ added / np.maximum(norm, 1e-300), 0.0)
    chosen: list[int] = []
    for name in dict.fromkeys(one.mechanism.id for one in todo):
        own = [k for k, one in enumerate(todo) if one.mechanism.id == name]
        sided = [along[k] if not todo[k].added.either_sign else abs(along[k]) for k in own]
        best = np.argsort(-np.array(sided))[:_PLACES]
        chosen += [own[k] for k in best if sided[k] > 0.0]
    return chosen, added[:, chosen] / np.maximum(norm[chosen], 1e-300) * np.sqrt(len(target))


def ensemble(features: FloatArray, target: FloatArray, seed: int) -> FloatArray:
    """Coefficients of every model of the ensemble, (n_models, n_features)."""
    from pysindy import STLSQ, EnsembleOptimizer

    # Refitting without the ridge would let collinear columns cancel each other.
    each = STLSQ(threshold=THRESHOLD, alpha=_RIDGE * len(target), unbias=False)
    made = EnsembleOptimizer(each, bagging=True, n_models=_MODELS)
    np.random.seed(seed)  # noqa: NPY002 (pysindy draws from there)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")  # an empty model is one
        made.fit(features, target[:, None])
    return np.array(made.coef_list)[:, 0]


class EnsembleSindy:
    """Sparse regression of the derivative, bagged."""

    id = "sindy"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Regress and count."""
        problem, law = hierarchical_problem(campaign), load_law(base_law)
        balance = energy_balance(problem, None, law, starting_coefficients(problem, law))
        rows = Rows(problem, balance)
        todo = placed_mechanisms(setting_of(problem, law))
        base, added = columns(rows, problem, law, [one.direction for one in todo])
        weight = rows.weight[:, None]
        left = taken_out(rows, base * weight, np.column_stack([rows.slope[:, None], added]) * weight)
        target = left[:, 0] / max(float(np.sqrt(np.mean(left[:, 0] ** 2))), 1e-12)
        chosen, features = library(todo, left[:, 1:], target)
        found = ensemble(features, target, int(campaign.fingerprint()[:8], 16))
        unexplained = target - features @ np.median(found, axis=0)
        explained = np.sqrt(max(float(target @ target - unexplained @ unexplained), 0.0))
        return self._answer(campaign, base_law, [todo[k] for k in chosen], np.abs(found), explained)

    def _answer(
        self, campaign: Campaign, base_law: str, terms: list[PlacedMechanism], size: FloatArray, score: float
    ) -> Answer:
        """Name what is largest on average; probabilities from how often each is included."""
        ids = np.array([one.mechanism.id for one in terms])
        mean: dict[str, float] = {}
        share: dict[str, float] = {}
        stretches: dict[str, Stretch | None] = {}
        for name in dict.fromkeys(str(one) for one in ids):
            own = np.flatnonzero(ids == name)
            mean[name] = float(size[:, own].mean(axis=0).max())
            share[name] = float(np.mean((size[:, own] > 0.0).any(axis=1))) * mean[name]
            stretches[name] = stretch_of(terms[own[np.argmax(size[:, own].mean(axis=0))]].shape)
        limit = LIMITS["dense" if is_dense(campaign) else "sparse"]
        listed = {name: value for name, value in share.items() if name in possible(base_law)}
        odds = prior_odds(possible(base_law).values())
        # At the limit, anything is as likely as nothing.
        anything = score**2 / (score**2 + max(limit, 1e-6) ** 2)
        total = max(sum(listed.values()), 1e-12)
        stated = {name: anything * value / total for name, value in listed.items()}
        stated[NOTHING] = 1.0 - sum(stated.values())
        kept = _SURE_OF_THE_LIST
        probability = {name: kept * stated.get(name, 0.0) + (1.0 - kept) * odds[name] for name in odds}
        return decided(probability, score, limit, stretches)
