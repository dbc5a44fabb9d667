"""A force that is in no list beside a listed mechanism, both fitted together.

Beside such a force a mechanism is as strong as it is, and not as strong as it has to be for both.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from skred.diagnosis.discrepancy.climb import start_from
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Free, Kind, Profile, knots, log_evidence_of
from skred.diagnosis.discrepancy.sampled_evidence import sampled
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.tolerance import COUNTS


@dataclass(frozen=True, eq=False)
class Beside:
    """A force beside a mechanism of one shape.

    Attributes
    ----------
    base : Base
        With the mechanism, of strength 0.
    alone : float
        Log Bayes factor of the mechanism by itself, of this shape.
    profiles : tuple of Profile
        The force of each kind, with the mechanism against neither.
    """

    base: Base
    alone: float
    profiles: tuple[Profile, ...]

    @property
    def log_bayes_factor(self) -> float:
        """Of both, against the mechanism by itself."""
        return log_evidence_of(self.profiles) - self.alone

    def sampled(self, pool: Executor, least: float) -> Beside:
        """By importance sampling, the kinds that count; as it is where draws lead to what no front can do.

        Parameters
        ----------
        pool : Executor
            As `sampled_evidence.sampled` needs it.
        least : float
            Log Bayes factor of both against the mechanism below which it need not be known.
        """
        some = max(one.log_bayes_factor for one in self.profiles) - COUNTS
        found = list(self.profiles)
        try:
            for k, one in enumerate(self.profiles):
                if one.log_bayes_factor > some:
                    found[k] = sampled(self.base, one, pool, least + self.alone)
        except np.linalg.LinAlgError:
            return self
        return replace(self, profiles=tuple(found))


def with_strength(base: Base, curve: Curve) -> Base:
    """The base law with a mechanism of a curve's shape, of strength 0."""
    directions = (*base.directions, curve.direction)
    return replace(base, directions=directions, strengths=np.append(base.strengths, 0.0))


def fit_beside(base: Base, curve: Curve, kind: Kind) -> Profile | None:
    """A force of one kind beside a mechanism of a curve's shape, from where that is by itself.

    None where a step leads to what no front can do, as a drag far below nil.
    """
    added = curve.mechanism.added
    assert added is not None
    top = int(np.argmax(curve.log_evidence))
    values = np.append(curve.strengths[top], np.zeros(len(knots(base.setting))))
    near = values, start_from(base, curve.fits[top])
    prior = Free(added.scale_of(curve.shape), added.either_sign)
    try:
        return fit_profile(with_strength(base, curve), kind, near, free=[prior])
    except np.linalg.LinAlgError:
        return None
