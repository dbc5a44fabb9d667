"""Avalanches that a calibration has not seen: how probable they were, and what was predicted of them.

A `Predictor` is what is left of a calibration for that: draws of the population and of what is added. It is
small enough to be written beside an answer. Its annotations say how `predictor_document` reads and writes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator
from scipy.special import logsumexp

from skred.arrays import FloatArray
from skred.campaign import Campaign
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.discrepancy.profile import KINDS, Kind, Profile, entering, spline_basis
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Rows, campaign_rows
from skred.diagnosis.evidence.covariates import Standard, standard_of
from skred.diagnosis.evidence.event_quadrature import Budget
from skred.diagnosis.evidence.extension import Extension, extended, setting_of
from skred.diagnosis.evidence.tolerance import DRAWS
from skred.diagnosis.predict.draws import Draws, LeftOut, draws_of, modes_near
from skred.diagnosis.predict.held_out import HeldOut
from skred.diagnosis.tabulated.tables import exact_log_densities
from skred.errors import InputError
from skred.inference.calibrate import Calibration, posterior_of
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.event_draws import FARTHEST
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.releases import terrain_with_releases
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import Direction, Setting, Shape
from skred.physics.terrain import build_terrain

NODES = Budget(64, 64, 0, 1.5, 1.8)
"""Quadrature points of an event for each draw; errors of random ones average out over the draws. None are
adapted: where those go depends on the others' weights, and few of them are too low in the mean
(``studies.thresholds.unseen_nodes``)."""


def _numbers(values: Any) -> FloatArray:
    array = np.asarray(values)
    if array.dtype.kind not in "fi" or not np.isfinite(array).all():
        raise ValueError("expected finite numbers")
    return array.astype(float)


def _kind(value: Any) -> Kind:
    for kind in KINDS:
        if value in (kind, kind.equation):
            return kind
    raise ValueError(f"expected one of {', '.join(kind.equation for kind in KINDS)}")


_Numbers = Annotated[FloatArray, PlainValidator(_numbers), PlainSerializer(np.ndarray.tolist)]
_Kind = Annotated[Kind, PlainValidator(_kind), PlainSerializer(lambda kind: kind.equation)]


@dataclass(frozen=True)
class Term:
    """A mechanism that is added.

    Attributes
    ----------
    mechanism : str
        Its id.
    shape : Shape
    standard : Standard or None
        What its covariate is standardised by, if it has one.
    """

    mechanism: str
    shape: Shape
    standard: Standard | None = None


@dataclass(frozen=True, eq=False)
class ProfileTerm:
    """A force profile that is added, each knot with a strength of its own.

    Attributes
    ----------
    kind : Kind
    knots_m : (n_knots,) array
        Between which it is linear; 0 outside.
    edge_m, front_speed : (n,) arrays
        Places between the knots, and the typical speed there [m/s] that a force refers to which is nil at it.
    """

    kind: _Kind
    knots_m: _Numbers
    edge_m: _Numbers
    front_speed: _Numbers

    @classmethod
    def of(cls, profile: Profile, setting: Setting) -> ProfileTerm:
        """Of a profile that was fitted in a setting."""
        edge, at = setting.terrain.edge_s_m, profile.knots_m
        step = np.diff(edge).max()
        near = (edge >= at[0] - step) & (edge <= at[-1] + step)
        return cls(profile.kind, at, edge[near], setting.front_speed[near])

    def directions(self, setting: Setting) -> list[Direction]:
        """One for each knot."""
        speed = np.interp(setting.terrain.edge_s_m, self.edge_m, self.front_speed)
        setting = replace(setting, front_speed=speed)
        return [entering(setting, self.kind, row) for row in spline_basis(setting.terrain, self.knots_m)]


@dataclass(frozen=True, eq=False)
class Predictor:
    """What a calibration says of avalanches to come on its path.

    Attributes
    ----------
    law, error_model : str
        Ids of the base law and of the error model.
    place_sd_m, smoothing_m : float
        How well it is known where a front stopped relative to a sensor; smoothing of the terrain.
    means : (n_draws, n_base) array
        Of the logarithms of the base strengths across events.
    factors : (n_draws, n_base, n_base) array
        Lower Cholesky factors of their covariance.
    terms : tuple of Term
        What is added, if anything.
    strengths : (n_draws, n_terms + n_knots) array
        Of what is added, as one avalanche of each draw has it; of a profile its values at the knots.
    profile : ProfileTerm or None
        The force profile that is added, if one is.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(allow_inf_nan=False)

    law: str
    error_model: str
    place_sd_m: Annotated[float, Field(gt=0.0)]
    smoothing_m: Annotated[float, Field(ge=0.0, le=1000.0)]
    means: _Numbers
    factors: _Numbers
    terms: tuple[Term, ...]
    strengths: _Numbers
    profile: ProfileTerm | None = None

    @property
    def draws(self) -> Draws:
        """Of the population, and of what is added."""
        return Draws(self.means, self.factors, self.strengths)


def predictor_of(calibration: Calibration, n_draws: int = DRAWS) -> Predictor:
    """What a hierarchical calibration says of avalanches to come, by draws evenly over its posterior."""
    problem = calibration.problem
    assert isinstance(problem, HierarchicalProblem)
    draws = draws_of(calibration, posterior_of(calibration), np.random.default_rng([37]))
    draws = draws.take(np.linspace(0, len(draws.means) - 1, n_draws).round().astype(int))
    terms = tuple[Term, ...]()
    if isinstance(problem, AugmentedProblem):
        terms = tuple(_term(problem, one.mechanism.id, one.shape) for one in problem.added)
    return Predictor(
        calibration.law.id, problem.error_model.id, problem.place_sd_m, problem.terrain.smoothing_m,
        draws.means, draws.factors, terms, draws.strengths,
    )  # fmt: skip


def _term(problem: HierarchicalProblem, mechanism: str, shape: Shape) -> Term:
    standard = standard_of(problem.campaign.events, shape.covariate) if shape.covariate is not None else None
    return Term(mechanism, shape, standard)


def log_scores(predictor: Predictor, campaign: Campaign, seed: int = 0) -> FloatArray:
    """Log predictive density of each event of a campaign on the predictor's path, (n_events,).

    The mean, over the draws, of how likely all of an event's readings are, its own strengths and release
    integrated over; 0 where an event has no reading.

    Raises
    ------
    InputError
        If the predictor is of another path, or says nothing finite.
    """
    extension = extension_of(predictor, campaign)
    try:
        densities = log_densities(extension, campaign_rows(extension), predictor.draws, seed)
    except np.linalg.LinAlgError as error:
        raise InputError("the predictor's draws are no populations: it is damaged") from error
    scores: FloatArray = logsumexp(densities, axis=0) - np.log(len(densities))
    if not np.isfinite(scores).all():
        names = [name for name, x in zip(campaign.event_ids, scores, strict=True) if not np.isfinite(x)]
        raise InputError(f"the predictor gives no finite score to {', '.join(names)}: is it of another path?")
    return scores


def unseen(predictor: Predictor, campaign: Campaign, seed: int = 0) -> HeldOut:
    """Scores and predictions of a campaign's events, as of events left out; nothing was reweighted.

    Raises
    ------
    InputError
        If the predictor is of another path.
    """
    said = LeftOut(extension_of(predictor, campaign), predictor.draws)
    return HeldOut.of(log_scores(predictor, campaign, seed), [said] * campaign.n_events, seed)


def problem_of(predictor: Predictor, campaign: Campaign) -> HierarchicalProblem:
    """The campaign's recordings as the predictor reads them."""
    x_m, z_m = campaign.track.x_m, campaign.track.z_m
    track = build_terrain(x_m, z_m, smoothing_m=predictor.smoothing_m)
    terrain = terrain_with_releases(track, campaign.events)
    errors = ERROR_MODELS[predictor.error_model]
    return HierarchicalProblem(campaign, terrain, errors, predictor.place_sd_m)


def extension_of(predictor: Predictor, campaign: Campaign) -> Extension:
    """The law with what is added, on other avalanches of the same path.

    Raises
    ------
    InputError
        If what is added does not go with the campaign.
    """
    problem, law = problem_of(predictor, campaign), load_law(predictor.law)
    directions = [_direction(term, problem, law) for term in predictor.terms]
    if predictor.profile is not None:
        _check_on_track(predictor.profile.knots_m[-1], problem)
        directions += predictor.profile.directions(setting_of(problem, law))
    return extended(problem, law, directions)


def _check_on_track(place_m: float, problem: HierarchicalProblem) -> None:
    if place_m > problem.terrain.length_m + 1.0:
        name = problem.campaign.name
        raise InputError(f"{name}: the predictor speaks of a place beyond the end of its track")


def _direction(term: Term, problem: HierarchicalProblem, law: Law) -> Direction:
    """What a unit of the mechanism changes for these avalanches, by the scale that it was fitted on."""
    campaign, shape = problem.campaign, term.shape
    if shape.sensor is not None and shape.sensor not in campaign.sensor_ids:
        raise InputError(f"{campaign.name}: has no sensor {shape.sensor!r}, which the predictor speaks of")
    for place_m in (shape.s_from_m, shape.s_to_m):
        if place_m is not None:
            _check_on_track(place_m, problem)
    covariates: Mapping[str, FloatArray] = {}
    if shape.covariate is not None and term.standard is not None:
        values = term.standard.standardised(campaign.events, shape.covariate)
        if np.abs(values).max(initial=0.0) > FARTHEST:
            raise InputError(f"{campaign.name}: {shape.covariate!r} is far off what the predictor knows")
        covariates = {shape.covariate: values}
    setting = replace(setting_of(problem, law), covariates=covariates)
    try:
        return direction_of(mechanisms()[term.mechanism], setting, shape)
    except (AssertionError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"the predictor's {term.mechanism} has a shape that it cannot have") from error


def log_densities(
    extension: Extension, rows: Rows, draws: Draws, seed: int, budget: Budget = NODES
) -> FloatArray:
    """Log density of each row's event for each draw, its own strengths integrated out, (n_draws, n_rows).

    Parameters
    ----------
    draws : Draws
        Of populations, and of the strengths of what is added.
    budget : Budget
        Quadrature points of an event for each draw.
    """
    typical, rng = draws.typical, np.random.default_rng([seed, 35])
    n = len(draws.means)
    likelihood = EventLikelihood(extension, rows, draws.strengths.mean(axis=0))
    start = modes_near(likelihood, typical, draws.so_many(DRAWS).points(1, rng)).points
    result = np.empty((n, len(start)))
    for event, near in enumerate(start):
        of_event = likelihood.take(np.array([event])).in_groups(draws.strengths)
        shifts = rng.random((n, len(near)))
        begin = np.tile(near, (n, 1, 1))
        found = exact_log_densities(of_event, draws.means, draws.factors, begin, budget, typical, shifts)
        result[:, event] = found[:, 0]
    return result
