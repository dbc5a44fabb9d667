"""The score test of everything that could be missing: efficient scores at the events' modes.

Detection limits come from it, and so do the shapes that stand for each mechanism where odds are computed by
fronts: its odds of anything at all, over every mechanism, place, instrument fault and the force that is not
in the list, are cheap, and too large where tangents overstate what stops fronts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import batched
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.discrepancy.profile import KINDS, Kind, entering, knots, priors_of, spline_basis
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Modes, Population, Rows, look_around
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import MeanPrior, Scores, efficient_scores, mean_prior
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED, prior_odds
from skred.diagnosis.evidence.refit import MOST_NODES
from skred.diagnosis.evidence.stated_places import StatedPlaces, stated_places
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import PlacedMechanism, can_join, placed, shapes_of
from skred.physics.mechanisms.spec import Direction, Setting
from skred.physics.mechanisms.strength_prior import SCALES
from skred.physics.mechanisms.stretches import shares


def placed_mechanisms(setting: Setting) -> list[PlacedMechanism]:
    """All that could be missing from a base law; of two that are the same term in a shape, one."""
    could = [one for one in mechanisms().values() if can_join(one, setting.base)]
    shapes = {one.id: shapes_of(one, setting) for one in could}
    return [
        placed(one, setting, shape)
        for one in could
        for shape in shapes[one.id]
        if shape not in shapes.get(one.same_term_as, ())
    ]


class LinearFactors(NamedTuple):
    """What the linear model says of everything that an id stands for.

    Attributes
    ----------
    candidates : sequence of PlacedMechanism or Kind
        A mechanism's shapes, or the kinds of force not in the list.
    log_factors : (n_groups, n_candidates) array
        Log Bayes factor of each against nothing.
    log_shares : (n_candidates,) array
        Log prior probability of each, given the id.
    log_odds : float
        Of the id against nothing beforehand.
    """

    candidates: Sequence[PlacedMechanism | Kind]
    log_factors: FloatArray
    log_shares: FloatArray
    log_odds: float


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """Everything that could be missing from a law on a campaign.

    Attributes
    ----------
    base : Base
        The law. What is in it already has its share of everything else; so have stated errors of places.
    """

    base: Base

    @cached_property
    def placed_mechanisms(self) -> list[PlacedMechanism]:
        """The candidates, those that enter with U last."""
        return sorted(placed_mechanisms(self.base.setting), key=lambda candidate: candidate.with_speed)

    @cached_property
    def knots_m(self) -> FloatArray:
        """Places of the knots of the force not in the list [m]."""
        return knots(self.base.setting)

    @cached_property
    def _parts(self) -> list[Extension]:
        """Extensions whose directions follow each other: candidates, profiles; then candidates with U."""
        setting = self.base.setting
        basis = spline_basis(setting.terrain, self.knots_m)
        profiles = [entering(setting, kind, row) for kind in KINDS for row in basis]
        plain = [c.direction for c in self.placed_mechanisms if not c.with_speed]
        parts = [[*plain, *profiles]]
        by_scale: dict[float | None, list[Direction]] = {}
        for candidate in self.placed_mechanisms:
            if candidate.with_speed:
                by_scale.setdefault(candidate.direction.weakening_speed, []).append(candidate.direction)
        parts += list(by_scale.values())
        places = self._places.each(setting)
        return [self.base.extended(*places, *part) for part in parts]

    @cached_property
    def _places(self) -> StatedPlaces:
        return stated_places(self.base.problem)

    @property
    def _n_in(self) -> int:
        """Directions, the first of every part, that everything else leaves their share to."""
        return len(self.base.directions) + len(self._places.errors)

    @cached_property
    def order(self) -> IntArray:
        """Where each candidate's direction is, over all parts."""
        position: dict[int, int] = {}
        for part in self._parts:
            for direction in part.directions[self._n_in :]:
                position[id(direction)] = len(position)
        return np.array([position[id(candidate.direction)] for candidate in self.placed_mechanisms])

    @cached_property
    def prior(self) -> MeanPrior:
        """Prior of the population's mean."""
        return mean_prior(self.base.law)

    def scores(self, rows: Rows, points: FloatArray, population: Population) -> Scores:
        """Efficient scores of all directions at the events' modes, some groups at a time."""
        # A row takes as much memory as there are directions.
        together = sum(len(part.directions) for part in self._parts) * np.bincount(rows.group).max()
        found = list[Scores]()
        for batch in batched(range(len(population.mean)), max(int(MOST_NODES // together), 1)):
            groups = np.array(batch)
            own, some = rows.of_groups(groups)
            around = self.around(some, points[own])
            found.append(self.scores_around(around, some, population.take(groups)))
        return Scores(*(np.concatenate(values) for values in zip(*found, strict=True)))

    def scores_around(self, around: Modes, rows: Rows, population: Population) -> Scores:
        """The same from the tangents there."""
        free = np.zeros(len(self.base.directions))
        precision = np.append(free, self._places.sd**-2.0)
        return efficient_scores(around, rows, population, self.prior, precision)

    def around(self, rows: Rows, points: FloatArray) -> Modes:
        """Tangents by all directions at the events' modes."""
        around: list[Modes] = []
        for part in self._parts:
            strengths = np.zeros(len(part.directions))
            strengths[: len(self.base.directions)] = self.base.strengths
            around.append(look_around(EventLikelihood(part, rows, strengths), points))
        changes = [part.by_strengths[:, :, 0 if k == 0 else self._n_in :] for k, part in enumerate(around)]
        by_strengths = np.concatenate(changes, axis=2)
        return around[0]._replace(by_strengths=by_strengths)

    def of_candidates(self, scores: Scores) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Score, information kept and raw information of each candidate, (n_groups, n_candidates)."""
        order = self.order
        return scores.score[:, order], scores.own[:, order], scores.raw[:, order]

    def log_factors(self, scores: Scores) -> FloatArray:
        """Log Bayes factor of each candidate in the linear model, (n_groups, n_candidates)."""
        score, information, _ = self.of_candidates(scores)
        result = np.empty_like(score)
        for k, candidate in enumerate(self.placed_mechanisms):
            scales = candidate.scale * np.array(SCALES)[:, None]
            precision = information[:, k] + scales**-2.0
            of_each = 0.5 * score[:, k] ** 2 / precision - 0.5 * np.log(scales**2 * precision)
            if not candidate.added.either_sign:
                of_each += math.log(2.0) + log_ndtr(score[:, k] / np.sqrt(precision))
            result[:, k] = np.logaddexp.reduce(of_each, axis=0) - math.log(len(scales))
        return result

    def log_factors_of_kinds(self, scores: Scores) -> FloatArray:
        """Log Bayes factor of each kind of force not in the list in the linear model, (n_kinds, n_groups)."""
        first = sum(not candidate.with_speed for candidate in self.placed_mechanisms)
        n = len(self.knots_m)
        factors = []
        for number, kind in enumerate(KINDS):
            part = slice(first + n * number, first + n * (number + 1))
            score, information = scores.score[:, part], scores.information[:, part, part]
            of_kind = [
                log_factor_of_process(score, information, prior.cover(self.knots_m)) + share
                for prior, share in priors_of(kind, self.knots_m).items()
            ]
            factors.append(np.logaddexp.reduce(of_kind, axis=0))
        return np.array(factors)

    def by_id(self, scores: Scores) -> dict[str, LinearFactors]:
        """What the linear model says of each id."""
        factors = self.log_factors(scores)
        odds = prior_odds({candidate.mechanism for candidate in self.placed_mechanisms})
        log_odds = {name: math.log(one / odds[NOTHING]) for name, one in odds.items()}
        kinds = self.log_factors_of_kinds(scores).T
        of_kinds = np.log([kind.share for kind in KINDS])
        found = {UNLISTED: LinearFactors(KINDS, kinds, of_kinds, log_odds[UNLISTED])}
        ids = np.array([candidate.mechanism.id for candidate in self.placed_mechanisms])
        for name in dict.fromkeys(ids.tolist()):
            own = np.flatnonzero(ids == name)
            placed = [self.placed_mechanisms[k] for k in own]
            of_shapes = np.log(shares([one.shape for one in placed]))
            found[name] = LinearFactors(placed, factors[:, own], of_shapes, log_odds[name])
        return found


def log_factor_of_process(score: FloatArray, information: FloatArray, cover: FloatArray) -> FloatArray:
    """Log Bayes factor of a Gaussian process in the linear model, (n_groups,).

    Parameters
    ----------
    score, information : (n_groups, n) and (n_groups, n, n) arrays
        Of the values of the process, at none.
    cover : (n, n) array
        Their prior covariance.
    """
    inside = np.eye(len(cover)) + cover @ information
    _, log_det = np.linalg.slogdet(inside)
    pulled = np.linalg.solve(inside, np.einsum("ij,gj->gi", cover, score)[:, :, None])[:, :, 0]
    result: FloatArray = 0.5 * np.einsum("gi,gi->g", score, pulled) - 0.5 * log_det
    return result
