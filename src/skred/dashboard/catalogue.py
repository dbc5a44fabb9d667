"""All views, in the order in which the page lists them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from skred.dashboard.reading import Given
from skred.dashboard.view import Asked, ViewKind
from skred.dashboard.views.candidates import candidate_panels
from skred.dashboard.views.comparison import comparison_panels
from skred.dashboard.views.events import event_panels
from skred.dashboard.views.force import force_panels
from skred.dashboard.views.forest import MOST_SHOWN, forest_panels
from skred.dashboard.views.held_out import held_out_panels
from skred.dashboard.views.overview import overview_panels
from skred.dashboard.views.speed import speed_panels
from skred.report.explore.panel import Panel
from skred.report.explore.plots import loo_pit, pair, pareto_k, predictive, prior_posterior, rank, trace
from skred.report.explore.run import Run


def _any(run: Run) -> bool:
    return True


def _posterior(run: Run) -> bool:
    return bool(run.names)


def _calibrated(run: Run) -> bool:
    return run.kind == "calibration" and bool(run.names) and run.recordings is not None


def _left_out(run: Run) -> bool:
    return run.likelihood_name is not None


def _predicted(run: Run) -> bool:
    return bool(run.observed_names)


def _of_run(make: Callable[[Run], list[Panel]]) -> Callable[[Run, Given, Asked], list[Panel]]:
    """A plot of a run as a view of it."""
    return lambda run, given, asked: make(run)


def _of_parameters(
    make: Callable[[Run, Sequence[str]], list[Panel]],
) -> Callable[[Run, Given, Asked], list[Panel]]:
    """A plot of some parameters as a view of those that are asked for."""
    return lambda run, given, asked: make(run, asked.parameters)


_FOUND, _CHECKS, _DRAWS = "Results", "Checks", "Parameters"
VIEWS: tuple[ViewKind, ...] = (
    ViewKind(
        "overview", _FOUND, "Overview",
        "All runs of this page. The list of views and the choice of a run and of an event go for the "
        "whole page.",
        _any, overview_panels, over_all=True,
    ),
    ViewKind(
        "events", _FOUND, "Events",
        "Each row is an avalanche (or observation). Click one: it is highlighted here and in every "
        "other view.",
        _left_out, event_panels, over_all=True,
    ),
    ViewKind(
        "speed", _FOUND, "Speed along the track",
        "How fast each front is at each place. A good law's line passes the event's dots; choose an "
        "event to see its draws, which spread as far as its readings leave open.",
        _calibrated, speed_panels,
    ),
    ViewKind(
        "predictive", _FOUND, "Predictions by sensor",
        predictive.HOW,
        _predicted, _of_run(predictive.predictive_panels),
    ),
    ViewKind(
        "candidates", _FOUND, "Candidates",
        "What could be missing from the law, how probable each candidate is, where it would act, and "
        "which events carry the answer.",
        lambda run: run.kind == "diagnosis", candidate_panels,
    ),
    ViewKind(
        "force", _FOUND, "Force along the track",
        "Above zero the law brakes too little there, below zero too much; fast fronts only, where the "
        "axis says so. Where the band holds zero, nothing is missing that these recordings could show.",
        lambda run: run.kind == "diagnosis" and run.has("force"), force_panels,
    ),
    ViewKind(
        "held_out", _FOUND, "Left-out avalanches",
        "Each avalanche is predicted from all others. Points on the dashed line are predicted "
        "exactly; bars hold 90 %.",
        lambda run: run.kind == "diagnosis" and run.has("held_out"), held_out_panels,
    ),
    ViewKind(
        "comparison", _CHECKS, "Comparison of runs",
        "elpd says how well left-out events are predicted: higher is better. A difference below twice"
        " its error decides nothing.",
        _left_out, comparison_panels, over_all=True,
    ),
    ViewKind(
        "pareto_k", _CHECKS, "Pareto k by event",
        pareto_k.HOW,
        _left_out, _of_run(pareto_k.pareto_panels),
    ),
    ViewKind(
        "loo_pit", _CHECKS, "LOO-PIT by sensor",
        loo_pit.HOW,
        lambda run: _predicted(run) and _left_out(run), _of_run(loo_pit.loo_pit_panels),
    ),
    ViewKind(
        "forest", _DRAWS, "Forest",
        "Median (dot), 50 % (thick) and 90 % (thin) of each parameter, a line for each run; numbers "
        "of runs as in the overview.",
        _posterior, forest_panels, over_all=True, by_parameter=True, most_parameters=MOST_SHOWN,
    ),
    ViewKind(
        "prior", _DRAWS, "Prior and posterior",
        prior_posterior.HOW,
        lambda run: _posterior(run) and run.has("prior"), _of_parameters(prior_posterior.prior_panels),
        by_parameter=True, drawn_from=("posterior", "prior"),
    ),
    ViewKind(
        "pair", _DRAWS, "Pairs",
        pair.HOW,
        _posterior, _of_parameters(pair.pair_panels), by_parameter=True, most_parameters=pair.MOST_PAIRED,
    ),
    ViewKind(
        "trace", _DRAWS, "Trace",
        trace.HOW,
        _posterior, _of_parameters(trace.trace_panels), by_parameter=True,
    ),
    ViewKind(
        "rank", _DRAWS, "Ranks",
        rank.HOW,
        _posterior, _of_parameters(rank.rank_panels), by_parameter=True,
    ),
)  # fmt: skip
