"""What avalanches may have of all that is added, and how many of them have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.augment.added_strength import AddedStrength
from skred.inference.between_events import components, own_multiples

FloatArray = NDArray[np.float64]


def components_of(
    added: Sequence[AddedStrength], samples: Mapping[str, Any]
) -> tuple[FloatArray, FloatArray]:
    """Added strengths that avalanches may have, (n, n_components, n_added), and log shares that have each.

    Where nothing differs between avalanches there is one component; of two that do, each pair is one.

    Parameters
    ----------
    samples : mapping
        Arrays by name of parameter, n values each.
    """
    n = len(np.ravel(samples[added[0].name]))
    own, log_shares = np.empty((n, 1, 0)), np.zeros((n, 1))
    for one in added:
        more, shares = components(one.between, *_given(one, samples))
        first, second = own.shape[1], more.shape[1]
        both = np.empty((n, first, second, own.shape[2] + 1))
        both[..., :-1], both[..., -1] = own[:, :, None], more[:, None]
        own = both.reshape(n, first * second, -1)
        log_shares = (log_shares[:, :, None] + shares[:, None]).reshape(n, -1)
    return own, log_shares


def symbolic_components_of(added: Sequence[AddedStrength], strengths: Sequence[Any]) -> tuple[Any, Any]:
    """As `components_of`, of symbolic strengths in the current PyMC model: a matrix and a vector."""
    import pytensor.tensor as pt

    parts = [one.symbolic(strength) for one, strength in zip(added, strengths, strict=True)]
    own, log_shares = parts[0][0][:, None], parts[0][1]
    for more, shares in parts[1:]:
        first, second = own.shape[0], more.shape[0]
        own = pt.concatenate([pt.repeat(own, second, axis=0), pt.tile(more, first)[:, None]], axis=1)
        log_shares = pt.repeat(log_shares, second) + pt.tile(shares, first)
    return own, log_shares


def new_rows(
    added: Sequence[AddedStrength], samples: Mapping[str, Any], rng: np.random.Generator, n_avalanches: int
) -> FloatArray:
    """Added strengths of avalanches to come, (n, n_avalanches, n_added): each has its own."""
    columns = []
    for one in added:
        strength, parameter = _given(one, samples)
        own = own_multiples(one.between, parameter, (len(strength), n_avalanches), rng)
        columns.append(strength[:, None] * own)
    return np.stack(columns, axis=2)


def _given(one: AddedStrength, samples: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Draws of a strength, and of what says how it differs: of no meaning where it does not."""
    strength = np.asarray(samples[one.name], dtype=float).ravel()
    if not one.between_name:
        return strength, np.zeros_like(strength)
    return strength, np.asarray(samples[one.between_name], dtype=float).ravel()
