"""Covariates of events as numbers of mean 0 and standard deviation 1, here and in other campaigns.

What spreads over an order of magnitude, as volumes do, enters by its logarithm if that is the less skewed:
one avalanche four standard deviations off would decide alone what all of them say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import skew

from skred.arrays import FloatArray
from skred.campaign import Event

_LEAST_KNOWN = 4
"""Events whose covariate is known, below which it is left out."""


@dataclass(frozen=True)
class Standard:
    """What a covariate is standardised by.

    Attributes
    ----------
    centre, scale : float
        Mean and standard deviation over the events whose value is known.
    kinds : tuple of str
        The two kinds of text, of which the first counts as 0 and the second as 1; none for numbers.
    logarithm : bool
        Whether mean and standard deviation are those of the logarithm.
    """

    centre: float
    scale: float
    kinds: tuple[str, ...] = ()
    logarithm: bool = False

    def standardised(self, events: Sequence[Event], name: str) -> FloatArray:
        """The covariate of some events; one whose value is not known counts as an average one."""
        values = _numbers([event.covariates.get(name) for event in events], self.kinds)
        if self.logarithm:
            values = np.log(np.where(values > 0.0, values, np.nan))
        return np.where(np.isfinite(values), (values - self.centre) / self.scale, 0.0)

    def as_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "kinds": list(self.kinds)}


def standard_of(events: Sequence[Event], name: str) -> Standard | None:
    """What a covariate is standardised by.

    None where it is constant, or hardly known, or text of one kind or of more than two.
    """
    given = [event.covariates.get(name) for event in events]
    kinds = tuple(sorted({value for value in given if isinstance(value, str)}))
    if len(kinds) not in (0, 2):
        return None
    values = _numbers(given, kinds)
    values = values[np.isfinite(values)]
    spread = float(np.std(values)) if len(values) >= _LEAST_KNOWN else 0.0
    if not spread > 1e-9 * (1.0 + float(np.abs(values).max(initial=0.0))):
        return None
    logarithm = not kinds and _wide(values)
    if logarithm:
        values = np.log(values)
    return Standard(float(values.mean()), float(np.std(values)), kinds, logarithm)


def _wide(values: FloatArray) -> bool:
    """Whether positive numbers spread over an order of magnitude, and less lopsided by their logarithms."""
    if values.min() <= 0.0 or values.max() < 10.0 * values.min():
        return False
    return abs(float(skew(np.log(values)))) < abs(float(skew(values)))


def _numbers(values: Sequence[float | str | None], kinds: Sequence[str]) -> FloatArray:
    """Covariates as numbers, NaN where not known."""
    if kinds:
        return np.array([float(kinds.index(v)) if v in kinds else np.nan for v in values])
    return np.array([np.nan if v is None or isinstance(v, str) else float(v) for v in values])
