"""The pages of the documentation name what the code has: keys, laws, error models, each other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from skred.inference.error_model import DEFAULT_ERRORS, ERROR_MODELS
from skred.laws import load_law

DOCS = Path(__file__).parents[2] / "docs"
LAWS = ("coulomb", "pcm", "constant", "voellmy")


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def rows(text: str) -> dict[str, str]:
    """Rows of all tables that begin with a name in code."""
    return {row[0]: row[1] for row in re.findall(r"^\| `([^`]+)`[^|]*\|(.*)\|$", text, re.M)}


@pytest.mark.parametrize("law_id", LAWS)
def test_every_law_has_its_parameters_and_reference(law_id: str) -> None:
    text, law = page("laws-and-likelihoods"), load_law(law_id)
    row = rows(text)[law_id]
    for parameter in law.parameters:
        unit = {"1": "", "m-1": "[1/m]", "m s-2": "[m/s²]", "m2 s-2": "[m²/s²]"}[parameter.unit]
        assert f"{parameter.symbol} {unit}".strip() in row
    for mechanism in law.mechanisms:
        if mechanism.strength.name in law.parameter_names:
            assert f"half-normal, {mechanism.strength.prior_scale:g}" in row
        assert mechanism.doi in text
    for doi in re.findall(r"doi (\S+)", law.reference):
        assert doi in text


def test_every_error_model_is_explained_in_its_own_words() -> None:
    told = rows(page("laws-and-likelihoods"))
    for name, model in ERROR_MODELS.items():
        assert told[name].strip() == model.title
    assert f"`{DEFAULT_ERRORS}` (default)" in page("laws-and-likelihoods")


def test_the_page_of_laws_is_short() -> None:
    assert len(page("laws-and-likelihoods").splitlines()) <= 120
