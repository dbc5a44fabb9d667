"""A predictor as plain data and back: checked, because a file may come from a stranger."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from skred.arrays import FloatArray
from skred.campaign.cells import LARGEST_NUMBER
from skred.campaign.problems import shown
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
from skred.physics.mechanisms.spec import Shape

MOST_ROWS, MOST_PARTS = 10_000, 8
"""Of a document: draws or places, and terms or constants of a term. Many times what is ever written."""
_KINDS = {kind.equation: kind for kind in KINDS}


def _not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError("expected text that is not blank")
    return text


def _increasing(places: list[float]) -> list[float]:
    if len(places) < 2 or any(last <= first for first, last in pairwise(places)):
        raise ValueError("expected two or more increasing places")
    return places


_Text = Annotated[str, AfterValidator(_not_blank)]
_Finite = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Positive = Annotated[_Finite, Field(gt=0.0)]
_NotNegative = Annotated[_Finite, Field(ge=0.0)]
_Exponent = Annotated[float, Field(allow_inf_nan=False, ge=-FARTHEST, le=FARTHEST)]
_Several = Field(max_length=MOST_PARTS + MOST_KNOTS, fail_fast=True)
"""Of one draw: more than any law, and all that is added to it, have."""
_Many = Field(min_length=1, max_length=MOST_ROWS, fail_fast=True)
_Exponents = Annotated[list[_Exponent], _Several]


class _Part(BaseModel):
    """Numbers are numbers here, and text is text; keys that are not known are left alone."""

    model_config = ConfigDict(strict=True, frozen=True)


class _Standard(_Part):
    centre: _Finite
    scale: Annotated[_Finite, Field(gt=1e-12)]
    kinds: list[str]
    logarithm: bool = False  # not there in those of before

    @model_validator(mode="after")
    def _of_numbers_or_of_two_kinds(self) -> Self:
        if len(self.kinds) not in (0, 2):
            raise ValueError("kinds: expected two texts or none")
        if self.logarithm and self.kinds:
            raise ValueError("logarithm: expected false for a text")
        return self


class _Term(_Part):
    mechanism: _Text
    s_from_m: _Finite | None = None
    s_to_m: _Finite | None = None
    covariate: _Text | None = None
    sensor: _Text | None = None
    constants: Annotated[dict[str, _Positive], Field(max_length=MOST_PARTS)] = Field(default_factory=dict)
    standard: _Standard | None = None

    @model_validator(mode="after")
    def _one_stretch(self) -> Self:
        first, last = self.s_from_m, self.s_to_m
        if last is not None and (first is None or first >= last):
            raise ValueError("expected s_from_m below s_to_m, or no s_to_m")
        return self


class _Profile(_Part):
    kind: Literal[tuple(_KINDS)]  # type: ignore[valid-type]
    # Below 0 where terrain goes on above the track's first point.
    knots_m: Annotated[list[_Finite], Field(max_length=MOST_KNOTS), AfterValidator(_increasing)]
    edge_m: Annotated[list[_Finite], _Many, AfterValidator(_increasing)]
    front_speed: Annotated[list[_NotNegative], _Many]

    @model_validator(mode="after")
    def _speed_everywhere(self) -> Self:
        if len(self.front_speed) != len(self.edge_m):
            raise ValueError("front_speed: expected one for each edge_m")
        return self


class _Document(_Part):
    format: Literal[FORMAT]  # type: ignore[valid-type]
    law: _Text
    error_model: Literal[tuple(ERROR_MODELS)]  # type: ignore[valid-type]
    place_sd_m: _Positive
    smoothing_m: Annotated[_NotNegative, Field(le=1000.0)]
    means: Annotated[list[_Exponents], _Many]
    factors: Annotated[list[Annotated[list[_Exponents], _Several]], _Many]
    terms: Annotated[list[_Term], Field(max_length=MOST_PARTS)]
    strengths: Annotated[list[Annotated[list[_Finite], _Several]], _Many]
    profile: _Profile | None = None


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
    try:
        known = _Document.model_validate(document)
    except ValidationError as error:
        raise InputError(_told(error)) from None
    law, entry = load_law(known.law), known.profile
    terms = tuple(_term(one, law) for one in known.terms)
    profile = None
    if entry is not None:
        places = np.array(entry.knots_m), np.array(entry.edge_m)
        profile = ProfileTerm(_KINDS[entry.kind], *places, np.array(entry.front_speed))
    n, scales = len(law.mechanisms), _scales(terms, profile)
    means = _draws(known.means, "means", n)
    factors = _draws(known.factors, "factors", n, n)
    strengths = _draws(known.strengths, "strengths", len(scales))
    _check_draws(means, factors, strengths, scales)
    place, smoothing = known.place_sd_m, known.smoothing_m
    return Predictor(law.id, known.error_model, place, smoothing, means, factors, terms, strengths, profile)


def _told(error: ValidationError) -> str:
    """The first thing that pydantic found, in one line."""
    details = error.errors(include_url=False)[0]
    key = shown(".".join(("predictor", *map(str, details["loc"]))), 200)
    found = details["input"]
    told = "" if isinstance(found, dict | list) else f"found {found!r:.40}: "
    # Which class of this file it could be an instance of is nothing to a reader.
    message = details["msg"].removeprefix("Value error, ").split(" or instance of ")[0]
    return f"{key}: {told}{message[:1].lower()}{message[1:]}"


def _term(entry: _Term, law: Law) -> Term:
    name = entry.mechanism
    mechanism = mechanisms().get(name)
    if mechanism is None or mechanism.added is None:
        raise InputError(f"predictor: no mechanism {name!r:.40} that could be added to a law")
    if not mechanism.added.joins(tuple(one.id for one in law.mechanisms)):
        raise InputError(f"predictor: {law.id} has {name} already")
    constants = tuple(entry.constants.items())
    shape = Shape(entry.s_from_m, entry.s_to_m, entry.covariate, entry.sensor, constants)
    by = entry.standard
    standard = None if by is None else Standard(by.centre, by.scale, tuple(by.kinds), by.logarithm)
    return Term(name, shape, standard)


def _draws(rows: Sequence[Any], key: str, *shape: int) -> FloatArray:
    """Draws as an array, (n_draws, *shape)."""
    try:
        return np.array(rows, dtype=float).reshape(len(rows), *shape)
    except ValueError as error:
        raise InputError(f"predictor: {key}: expected {shape} numbers in each draw") from error


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
