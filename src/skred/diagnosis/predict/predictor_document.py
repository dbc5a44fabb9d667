"""A predictor as plain data and back: checked, because a file may come from a stranger."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from skred.arrays import FloatArray
from skred.campaign.problems import shown
from skred.diagnosis.detect.detectability import NO_LIMIT
from skred.diagnosis.discrepancy.profile import MOST_KNOTS
from skred.diagnosis.predict.unseen import Predictor, ProfileTerm, Term
from skred.documents import FORMAT
from skred.errors import InputError
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.event_draws import FARTHEST
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.strength_prior import SCALES
from skred.physics.mechanisms.stretches import OPPOSED_SCALES

_ADAPTER = TypeAdapter(Predictor)


def as_dict(predictor: Predictor) -> dict[str, Any]:
    """A predictor as JSON can hold it, without loss."""
    return {"format": FORMAT, **_ADAPTER.dump_python(predictor, mode="json")}


def from_dict(document: Any) -> Predictor:
    """A predictor from plain data.

    Raises
    ------
    InputError
        If it is not what `as_dict` gives, or names laws, error models or mechanisms that are not there.
    """
    if not isinstance(document, Mapping) or document.get("format") != FORMAT:
        raise InputError(f"predictor: expected an object with format {FORMAT}")
    try:
        predictor = _ADAPTER.validate_python(dict(document))
    except ValidationError as error:
        raise InputError(_told(error)) from None
    law = load_law(predictor.law)
    if predictor.error_model not in ERROR_MODELS:
        raise InputError(f"predictor: error_model: expected one of {', '.join(ERROR_MODELS)}")
    scales = [(term.mechanism, _scale(term, law)) for term in predictor.terms]
    if predictor.profile is not None:
        _check_profile(predictor.profile)
        scale = max(SCALES) * predictor.profile.kind.amplitude
        scales += [("the force profile", scale)] * len(predictor.profile.knots_m)
    _check_draws(predictor, len(law.mechanisms), scales)
    return predictor


def _told(error: ValidationError) -> str:
    """The first thing that pydantic found, in one line."""
    details = error.errors(include_url=False)[0]
    key = shown(".".join(("predictor", *map(str, details["loc"]))), 200)
    found = details["input"]
    told = "" if isinstance(found, Mapping | list) else f"found {found!r:.40}: "
    message = details["msg"].removeprefix("Value error, ")
    return f"{key}: {told}{message[:1].lower()}{message[1:]}"


def _scale(term: Term, law: Law) -> float:
    """The widest that the prior of a term's strength may be, if it is one."""
    name, shape, by = term.mechanism, term.shape, term.standard
    mechanism = mechanisms().get(name)
    if mechanism is None or mechanism.added is None:
        raise InputError(f"predictor: no mechanism {name!r:.40} that could be added to a law")
    if not mechanism.added.joins(tuple(one.id for one in law.mechanisms)):
        raise InputError(f"predictor: {law.id} has {name} already")
    first, last = shape.s_from_m, shape.s_to_m
    if last is not None and (first is None or first >= last):
        raise InputError(f"predictor: {name}: expected s_from_m below s_to_m, or no s_to_m")
    if any(value <= 0.0 for _, value in shape.constants):
        raise InputError(f"predictor: {name}: constants: expected positive numbers")
    if by is not None and (by.scale <= 1e-12 or len(by.kinds) not in (0, 2)):
        raise InputError(f"predictor: {name}: standard: expected a positive scale, and two kinds or none")
    return max(SCALES) * OPPOSED_SCALES * mechanism.added.scale


def _check_profile(term: ProfileTerm) -> None:
    if term.knots_m.size > MOST_KNOTS:
        raise InputError(f"predictor: profile.knots_m: expected at most {MOST_KNOTS}")
    for name in ("knots_m", "edge_m"):
        places = getattr(term, name)
        if places.ndim != 1 or len(places) < 2 or np.any(np.diff(places) <= 0.0):
            raise InputError(f"predictor: profile.{name}: expected two or more increasing places")
    if term.front_speed.shape != term.edge_m.shape or np.any(term.front_speed < 0.0):
        raise InputError("predictor: profile.front_speed: expected one for each edge_m, 0 or more")


def _check_draws(predictor: Predictor, n_base: int, scales: list[tuple[str, float]]) -> None:
    n = predictor.means.size // n_base
    shapes = {"means": (n, n_base), "factors": (n, n_base, n_base), "strengths": (n, len(scales))}
    for key, shape in shapes.items():
        found: FloatArray = getattr(predictor, key)
        if not n or found.shape != shape:
            raise InputError(f"predictor: {key}: expected {shape[1:]} numbers in each draw, of as many draws")
    means, factors = predictor.means, predictor.factors
    if max(np.abs(means).max(), np.abs(factors).max()) > FARTHEST:
        raise InputError("predictor: means, factors: beyond all that is physical")
    diagonal = np.einsum("nii->ni", factors)
    if np.any(np.triu(factors, 1) != 0.0) or np.any(diagonal < 1e-6):
        raise InputError("predictor: factors: expected lower triangular ones with a positive diagonal")
    for (name, scale), drawn in zip(scales, predictor.strengths.T, strict=True):
        if np.abs(drawn).max() > NO_LIMIT * scale:
            raise InputError(f"predictor: strengths of {name}: beyond all that is physical")
