"""Priors that are not a law's own: their scales by name of parameter."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.physics.law import Law

MOST_BYTES = 100_000
"""Of a file: a line a parameter."""


class PriorsError(InputError):
    """Scales of priors that cannot be used."""


def read_priors(file: Path) -> dict[str, float]:
    """Scales from a TOML file, one line each: ``dry_friction = 0.3``.

    Raises
    ------
    PriorsError
        If it cannot be read, or holds anything but positive numbers.
    """
    try:
        with file.open("rb") as stream:
            text = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise PriorsError(f"{file}: cannot be read ({error.strerror or error})") from error
    if len(text) > MOST_BYTES:
        raise PriorsError(f"{file}: longer than {MOST_BYTES} bytes; no file of priors")
    try:
        content = tomllib.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # also of numbers of thousands of digits, of deep nesting
        told = f"{error!s:.100}"
        raise PriorsError(
            f"{file}: not a TOML file ({told}); write lines such as dry_friction = 0.3"
        ) from error
    return {name: _scale(name, value, f"{file}: ") for name, value in content.items()}


def laws_with_priors(laws: Sequence[Law], priors: Mapping[str, float] | None) -> list[Law]:
    """Laws, each with the scales that were given for its parameters.

    Parameters
    ----------
    laws : sequence of Law
    priors : mapping or None
        Scale by name of parameter, in its unit: of a half-normal prior its scale, of a log-normal one its
        median.

    Raises
    ------
    PriorsError
        If none of the laws has a parameter of that name, or a scale is no positive number.
    """
    known = list(dict.fromkeys(name for law in laws for name in law.parameter_names))
    for name, value in (priors or {}).items():
        _scale(name, value)
        if name not in known:
            ids = ", ".join(law.id for law in laws)
            raise PriorsError(
                f"priors: no parameter {name!r:.60} of {ids}; there are: {', '.join(known)}"
                " (priors of spreads and correlations are fixed)"
            )
    return [_with_scales(law, priors or {}) for law in laws]


def _scale(name: str, value: Any, where: str = "priors: ") -> float:
    try:
        number = math.nan if isinstance(value, (bool, str, bytes)) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise PriorsError(f"{where}{name!r:.60}: expected a scale, a number above 0, found {value!r:.60}")
    return number


def _with_scales(law: Law, priors: Mapping[str, float]) -> Law:
    """A law with other scales of priors; itself where they are its own."""
    own = {one.strength.name: one.strength.prior_scale for one in law.mechanisms}
    changed = {
        name: float(scale)
        for name, scale in priors.items()
        if name in law.parameter_names and scale != own.get(name)
    }
    if not changed:
        return law
    mechanisms = tuple(
        replace(one, strength=replace(one.strength, prior_scale=changed[one.strength.name]))
        if one.strength.name in changed
        else one
        for one in law.mechanisms
    )
    rescaled = tuple(changed.items())
    return replace(
        law,
        mechanisms=mechanisms,
        build=partial(_build, law.build, rescaled),
        changed_priors=tuple((dict(law.changed_priors) | changed).items()),
    )


def _build(build: Callable[[Any], Any], scales: Sequence[tuple[str, float]], problem: Any) -> Any:
    return rescaled_model(build(problem), dict(scales))


def rescaled_model(model: Any, scales: Mapping[str, float]) -> Any:
    """Give the priors of a PyMC model other scales, in place; returns the model.

    Parameters
    ----------
    model : pymc.Model
    scales : mapping
        By name of free variable. Half-normal and log-normal priors can be changed.

    Raises
    ------
    PriorsError
        If another prior than these is to be changed.
    """
    import numpy as np
    import pytensor.tensor as pt

    for name, scale in scales.items():
        node = model[name].owner
        kind = type(node.op).__name__
        if kind == "HalfNormalRV":
            place, value = 1, scale
        elif kind == "LogNormalRV":
            place, value = 0, float(np.log(scale))
        else:
            raise PriorsError(
                f"priors: that of {name!r} cannot be given a scale: expected a half-normal or a log-normal"
                f" prior, found {kind.removesuffix('RV')}"
            )
        before = node.op.dist_params(node)[place]
        # In place: a copy of the model would lose variables that a diagnosis adds.
        node.inputs[node.inputs.index(before)] = pt.constant(value, dtype=before.dtype)
    return model
