"""Parameters and releases of fronts, checked: numbers for what they are, symbolic tensors for their shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.errors import InputError
from skred.physics.law import Law

RELEASE = "release_s_m"


def checked_names(law: Law, parameters: Mapping[str, Any]) -> None:
    """Refuse parameters that a law does not have, and a call that lacks some."""
    own = ", ".join(law.parameter_names)
    for name in parameters:
        if name not in law.parameter_names:
            raise InputError(f"{name}: no parameter of {law.id!r}; there are: {own}")
    for name in law.parameter_names:
        if name not in parameters:
            raise InputError(
                f"{name}: expected a number or several, found none; parameters of {law.id!r}: {own}"
            )


def checked_columns(
    law: Law, parameters: Mapping[str, Any], release_s_m: Any, length_m: float
) -> dict[str, Any]:
    """Parameters in the order of the law, then the releases: arrays where they are numbers.

    Raises
    ------
    InputError
        If one cannot be used; the message names it.
    """
    given = {**{name: parameters[name] for name in law.parameter_names}, RELEASE: release_s_m}
    columns = {name: value if _is_symbolic(value) else _numbers(name, value) for name, value in given.items()}
    _check_lengths(columns)
    for name, column in columns.items():
        if not _is_symbolic(column) and (column < 0.0).any():
            raise InputError(f"{name}: expected numbers of at least 0, found {column.min():g}")
    _check_strengths(law, [columns[name] for name in law.parameter_names])
    releases = columns[RELEASE]
    if not _is_symbolic(releases) and (releases >= length_m).any():
        raise InputError(
            f"{RELEASE}: expected places on the track, from 0 to below {length_m:.1f} m,"
            f" found {releases.max():g}"
        )
    return columns


def _is_symbolic(value: Any) -> bool:
    """Whether a value is known only when the expression is computed."""
    from pytensor.graph.basic import Constant, Variable

    return isinstance(value, Variable) and not isinstance(value, Constant)


def _numbers(name: str, value: Any) -> NDArray[np.float64]:
    """A number or several, all finite."""
    expected = f"{name}: expected a number, or several in one row"
    try:
        found = np.asarray(getattr(value, "data", value) if hasattr(value, "owner") else value)
    except ValueError as error:  # rows of different lengths
        raise InputError(f"{expected}, found rows of different lengths") from error
    if found.dtype.kind not in "iuf" or found.ndim > 1 or not found.size:
        what = f"an array of the shape {found.shape}" if found.ndim > 1 else f"{value!r:.60}"
        raise InputError(f"{expected}, found {what}")
    if not np.isfinite(found).all():
        raise InputError(f"{expected}, all finite, found {value!r:.60}")
    return found.astype(float)


def _check_lengths(columns: Mapping[str, Any]) -> None:
    """Refuse lengths that do not go together; where one is known only later, it is not looked at."""
    first: tuple[str, int] | None = None
    for name, column in columns.items():
        shape = column.type.shape if _is_symbolic(column) else column.shape
        if len(shape) > 1:
            raise InputError(
                f"{name}: expected a number, or several in one row, found {len(shape)} dimensions"
            )
        length = shape[0] if shape else 1
        if length in (None, 1):
            continue
        if first is not None and length != first[1]:
            raise InputError(f"{name}: expected one number or {first[1]}, as {first[0]} has, found {length}")
        first = first or (name, length)


def _check_strengths(law: Law, values: list[Any]) -> None:
    """Refuse numbers that are no coefficients of the law's mechanisms, such as those of a division by 0."""
    known = [np.nan if _is_symbolic(value) else value for value in values]
    with np.errstate(all="ignore"):
        strengths = law.strengths(*(np.asarray(one, dtype=float) for one in known))
    is_open = any(map(_is_symbolic, values))
    for mechanism, strength in zip(law.mechanisms, strengths, strict=True):
        usable = np.isfinite(strength) & (np.asarray(strength) >= 0.0)
        if not (usable | (is_open & np.isnan(strength))).all():
            told = ", ".join(law.parameter_names)
            raise InputError(
                f"{told}: these make the coefficient {mechanism.strength.name} of {law.id!r}"
                f" {np.asarray(strength)!s:.60}; expected finite numbers of at least 0"
            )
