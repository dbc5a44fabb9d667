"""Campaigns of the independent simulator, and base laws fitted to them, shared by the tests here."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, Literal

import numpy as np

from skred.campaign import Campaign, Status, find_campaign, read_campaign
from skred.campaign.parts import of_events
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import Effort
from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode
from skred.diagnosis.evidence.coefficient import Base, fit_base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, campaign_rows
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import fit_population, mean_prior, starting_population
from skred.diagnosis.evidence.marginal import Evidence
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.tabulated.between_evidence import Way
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Direction
from skred.simulator.draw import draw_trial

Kind = Literal["sparse", "dense"]


@cache
def trial(seed: int, kind: Kind, hidden: str, base: str, snr: float | None = None) -> Any:
    return draw_trial(seed, kind=kind, hidden=hidden, base=base, snr=snr)


def first_events(campaign: Campaign, n: int) -> Campaign:
    return of_events(campaign, range(n))


def with_sensors(campaign: Campaign, chosen: list[int]) -> Campaign:
    """Some sensors of a campaign, in this order."""
    return replace(
        campaign,
        sensors=tuple(campaign.sensors[k] for k in chosen),
        values=campaign.values[:, chosen],
        status=campaign.status[:, chosen],
        stated_sd=campaign.stated_sd[:, chosen],
    )


def base_of(campaign: Campaign, law_id: str, error_model: str = "robust") -> Base:
    """A base law fitted as the diagnosis does, but without sampling."""
    problem = replace(hierarchical_problem(campaign), error_model=ERROR_MODELS[error_model])
    law = load_law(law_id)
    extension, population = extended(problem, law), starting_population(law)
    points = np.column_stack(
        [np.tile(population.mean[0], (campaign.n_events, 1)), np.zeros(campaign.n_events)]
    )
    rows = campaign_rows(extension)
    found, points = fit_population(
        EventLikelihood(extension, rows, np.zeros(0)), mean_prior(law), (population, points)
    )
    return fit_base(problem, law, found, points)


BIASED_GATE, BIAS = 2, 1.45
"""The gate of `gates_campaign` that may read too high, and how many times."""


def gates_campaign(events: range, *, biased: bool) -> Campaign:
    """Some of 17 avalanches past five gates, a runout each; no physics hidden."""
    campaign = of_events(trial(1003, "dense", "nothing", "constant").campaign, events)
    campaign = with_sensors(campaign, [12, 15, 18, 21, 24, campaign.n_sensors - 1])
    values = np.array(campaign.values)
    values[:, BIASED_GATE] *= BIAS if biased else 1.0
    return replace(campaign, values=values)


@cache
def gates_diagnosis(*, biased: bool) -> Diagnosis:
    """The whole diagnosis of eight avalanches, one mechanism added at most."""
    settings, effort = SamplerSettings("metropolis", 500, 500, 4, 0), Effort(max_mechanisms=1)
    problem = hierarchical_problem(gates_campaign(range(8), biased=biased))
    found = diagnose(problem, load_law("constant"), settings, effort)
    assert isinstance(found, Diagnosis)
    return found


@cache
def ryggfonn_base(law_id: str) -> Base:
    return base_of(read_campaign(find_campaign("ryggfonn")), law_id)


@cache
def sparse_base() -> Base:
    """Clean, three speeds and a runout, dry friction."""
    return base_of(trial(1001, "sparse", "nothing", "coulomb").campaign, "coulomb")


@cache
def dense_base() -> Base:
    """Clean, eight avalanches, dry friction and drag."""
    return base_of(first_events(trial(1003, "dense", "nothing", "pcm").campaign, 8), "pcm")


def few_dense_base() -> Base:
    """Eight clean avalanches past sixteen gates, constant retardation."""
    campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, 8)
    gates = [*range(0, campaign.n_sensors - 1, 2), campaign.n_sensors - 1]
    return base_of(with_sensors(campaign, gates), "constant")


def recorded(base: Base, direction: Direction) -> Base:
    """The same avalanches with another term in, read with the stated errors."""
    extension, problem = extended(base.problem, base.law, [direction]), base.problem
    n, campaign = len(base.rows.event), base.problem.campaign
    fronts = extension.predict(np.arange(n), base.fit.points, np.array([1.0]))[:, :-1]
    readings = problem.readings
    sd = np.hypot(readings.relative_sd * fronts, readings.absolute_sd)
    noisy = fronts + sd * np.random.default_rng(1).standard_normal(fronts.shape)
    stops = fronts[:, [-1]]
    ends = np.array([-np.inf if s.is_runout else s.s_to_m for s in campaign.sensors], dtype=float)
    came = stops > ends
    status = np.where(came, Status.OBSERVED, Status.NOT_REACHED)
    values = np.where(came, np.maximum(noisy, 0.0), np.nan)
    made = replace(campaign, values=values, status=status, stated_sd=np.full(values.shape, np.nan))
    return base_of(made, base.law.id)


def made_way(log_factor: float) -> Way:
    """A way in which avalanches differ that has a log Bayes factor, and nothing behind it."""
    mixture = Mixture.on([Mode(np.zeros(1), np.eye(1))])
    return Way(log_factor, Evidence(0.0, np.zeros(1), np.eye(1)), (1.0, 0.1), mixture, 1.0)
