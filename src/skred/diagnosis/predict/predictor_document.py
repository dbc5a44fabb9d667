"""A predictor as plain data and back: checked, because a file may come from a stranger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.campaign.cells import LARGEST_NUMBER
from skred.diagnosis.detect.detectability import NO_LIMIT
from skred.diagnosis.discrepancy.profile import AMPLITUDES, KINDS, MOST_KNOTS
from skred.diagnosis.evidence.covariates import Standard
from skred.diagnosis.predict.unseen import FARTHEST, Predictor, ProfileTerm, Term
from skred.documents import FORMAT
from skred.errors import InputError
from skred.inference.error_model import ERROR_MODELS
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Mechanism, Shape

FloatArray = NDArray[np.float64]
MOST_ROWS, MOST_PARTS = 10_000, 8
"""Of a document: draws or places, and terms or constants of a term. Many times what is ever written."""


def as_dict(predictor: Predictor) -> dict[str, Any]:
    """A predictor as JSON can hold it, without loss."""
    return {
        "format": FORMAT,
        "law": predictor.law,
        "error_model": predictor.error_model,
        "place_sd_m": predictor.place_sd_m,
        "smoothing_m": predictor.smoothing_m,
        "means": predictor.means.tolist(),
        "factors": predictor.factors.tolist(),
        "terms": [_term_dict(term) for term in predictor.terms],
        "strengths": predictor.strengths.tolist(),
        "profile": None if predictor.profile is None else _profile_dict(predictor.profile),
    }


def _profile_dict(term: ProfileTerm) -> dict[str, Any]:
    return {
        "kind": term.kind.equation,
        "knots_m": term.knots_m.tolist(),
        "edge_m": term.edge_m.tolist(),
        "front_speed": term.front_speed.tolist(),
    }


def _term_dict(term: Term) -> dict[str, Any]:
    shape, standard = term.shape, term.standard
    return {
        "mechanism": term.mechanism,
        "s_from_m": shape.s_from_m,
        "s_to_m": shape.s_to_m,
        "covariate": shape.covariate,
        "sensor": shape.sensor,
        "constants": dict(shape.constants),
        "standard": None if standard is None else standard.as_dict(),
    }


def from_dict(document: Any) -> Predictor:
    """A predictor from plain data.

    Raises
    ------
    InputError
        If it is not what `as_dict` gives, or names laws, error models or mechanisms that are not there.
    """
    known = _mapping(document, "predictor")
    if known.get("format") != FORMAT:
        raise InputError(f"predictor: expected format {FORMAT}, found {known.get('format')!r:.40}")
    law = load_law(_text(known, "law"))
    error_model = _text(known, "error_model")
    if error_model not in ERROR_MODELS:
        raise InputError(
            f"predictor: no error model {error_model!r:.40}; there are: {', '.join(ERROR_MODELS)}"
        )
    entries = known.get("terms")
    if not isinstance(entries, list) or len(entries) > MOST_PARTS:
        raise InputError(f"predictor: terms: expected a list of at most {MOST_PARTS}")
    terms = tuple(_term(_mapping(entry, "terms"), law) for entry in entries)
    n = len(law.mechanisms)
    means = _numbers(known, "means", (n,), FARTHEST)
    factors = _numbers(known, "factors", (n, n), FARTHEST)
    profile = None if known.get("profile") is None else _profile(_mapping(known["profile"], "profile"))
    scales = _scales(terms, profile)
    strengths = _numbers(known, "strengths", (len(scales),), LARGEST_NUMBER)
    _check_draws(means, factors, strengths, scales)
    place = _number(known, "place_sd_m")
    smoothing = _number(known, "smoothing_m", 1000.0)
    if not place > 0.0 or smoothing < 0.0:
        raise InputError("predictor: place_sd_m must be positive, smoothing_m not negative")
    return Predictor(law.id, error_model, place, smoothing, means, factors, terms, strengths, profile)


def _profile(entry: Mapping[str, Any]) -> ProfileTerm:
    name = _text(entry, "kind")
    kind = next((one for one in KINDS if one.equation == name), None)
    if kind is None:
        raise InputError(
            f"predictor: no force profile {name!r:.40}; there are: {', '.join(one.equation for one in KINDS)}"
        )
    knots = _places(entry, "knots_m", MOST_KNOTS)
    edge = _places(entry, "edge_m", MOST_ROWS)
    speed = _column(entry, "front_speed", MOST_ROWS)
    if len(speed) != len(edge) or np.any(speed < 0.0):
        raise InputError("predictor: front_speed: expected one for each edge_m, none negative")
    return ProfileTerm(kind, knots, edge, speed)


def _places(document: Mapping[str, Any], key: str, most: int) -> FloatArray:
    """Increasing places [m], two or more; below 0 where terrain goes on above the track's first point."""
    places = _column(document, key, most)
    if len(places) < 2 or np.any(np.diff(places) <= 0.0):
        raise InputError(f"predictor: {key}: expected two or more increasing places")
    return places


def _scales(terms: Sequence[Term], profile: ProfileTerm | None) -> list[tuple[str, float]]:
    """Name and prior scale of each term, then of each knot of a profile."""
    found = []
    for term in terms:
        added = mechanisms()[term.mechanism].added
        assert added is not None
        found.append((term.mechanism, added.scale))
    if profile is not None:
        scale = max(AMPLITUDES) * profile.kind.amplitude
        found += [("the force profile", scale)] * len(profile.knots_m)
    return found


def _check_draws(
    means: FloatArray, factors: FloatArray, strengths: FloatArray, scales: Sequence[tuple[str, float]]
) -> None:
    if not len(means) == len(factors) == len(strengths):
        raise InputError("predictor: means, factors and strengths must be as many")
    diagonal = np.einsum("nii->ni", factors)
    if np.any(np.triu(factors, 1) != 0.0) or np.any(diagonal < 1e-6):
        raise InputError("predictor: factors: expected lower triangular ones with a positive diagonal")
    for (name, scale), drawn in zip(scales, strengths.T, strict=True):
        if np.abs(drawn).max() > NO_LIMIT * scale:
            raise InputError(f"predictor: strengths of {name}: beyond all that is physical")


def _term(entry: Mapping[str, Any], law: Law) -> Term:
    name = _text(entry, "mechanism")
    mechanism = mechanisms().get(name)
    if mechanism is None or mechanism.added is None:
        raise InputError(f"predictor: no mechanism {name!r:.40} that could be added to a law")
    if not mechanism.added.joins(tuple(one.id for one in law.mechanisms)):
        raise InputError(f"predictor: {law.id} has {name} already")
    return Term(name, _shape(entry, mechanism), _standard(entry))


def _shape(entry: Mapping[str, Any], mechanism: Mechanism) -> Shape:
    ends = [None if entry.get(key) is None else _number(entry, key) for key in ("s_from_m", "s_to_m")]
    first, last = ends
    if (first is None) != (last is None) or (first is not None and last is not None and not first < last):
        raise InputError(f"predictor: {mechanism.id}: expected s_from_m below s_to_m, or neither")
    constants = _mapping(entry.get("constants", {}), "constants")
    if len(constants) > MOST_PARTS:
        raise InputError(f"predictor: {mechanism.id}: more than {MOST_PARTS} constants")
    pairs = tuple((name, _number(constants, name)) for name in constants)
    if any(not value > 0.0 for _, value in pairs):
        raise InputError(f"predictor: {mechanism.id}: constants must be positive")
    covariate, sensor = (
        None if entry.get(key) is None else _text(entry, key) for key in ("covariate", "sensor")
    )
    return Shape(first, last, covariate, sensor, pairs)


def _standard(entry: Mapping[str, Any]) -> Standard | None:
    if entry.get("standard") is None:
        return None
    standard = _mapping(entry["standard"], "standard")
    kinds = standard.get("kinds")
    if not isinstance(kinds, list) or len(kinds) not in (0, 2) or not all(isinstance(k, str) for k in kinds):
        raise InputError("predictor: standard: kinds: expected two texts or none")
    centre = _number(standard, "centre")
    scale = _number(standard, "scale")
    if not scale > 1e-12:
        raise InputError("predictor: standard: scale must be positive")
    logarithm = standard.get("logarithm", False)  # not there in those of before
    if not isinstance(logarithm, bool) or (logarithm and kinds):
        raise InputError("predictor: standard: logarithm: expected true or false, and false for a text")
    return Standard(centre, scale, tuple(kinds), logarithm)


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise InputError(f"{where}: expected an object, found {type(value).__name__}")
    return value


def _text(document: Mapping[str, Any], key: str) -> str:
    value = document.get(key)
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"predictor: {key}: expected text, found {value!r:.40}")
    return value


def _number(document: Mapping[str, Any], key: str, largest: float = LARGEST_NUMBER) -> float:
    value = document.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"predictor: {key}: expected a number, found {value!r:.40}")
    if not abs(value) <= largest:  # also where it is not a number
        raise InputError(f"predictor: {key}: expected at most {largest:g} in size, found {value!r:.40}")
    return float(value)


def _column(document: Mapping[str, Any], key: str, most: int) -> FloatArray:
    """A list of numbers."""
    value = document.get(key)
    if not isinstance(value, list) or len(value) > most:
        raise InputError(f"predictor: {key}: expected a list of at most {most} numbers")
    return np.array([_number({key: one}, key) for one in value], dtype=float)


def _numbers(document: Mapping[str, Any], key: str, shape: tuple[int, ...], largest: float) -> FloatArray:
    """Draws as an array, (n_draws, *shape)."""
    expected = f"predictor: {key}: expected 1 to {MOST_ROWS} draws of {shape} finite numbers"
    value = document.get(key)
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_ROWS or not _plain(value, 1 + len(shape)):
        raise InputError(expected)
    try:
        array = np.array(value, dtype=float).reshape(len(value), *shape)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(expected) from error
    if not (np.isfinite(array).all() and np.abs(array).max(initial=0.0) <= largest):
        raise InputError(expected)
    return array


def _plain(value: Any, depth: int) -> bool:
    """Whether these are lists of numbers, so deep and no deeper."""
    if depth == 0:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    return isinstance(value, list) and all(_plain(item, depth - 1) for item in value)
