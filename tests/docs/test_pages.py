"""The pages of the documentation name what the code has: keys, laws, error models, each other."""

from __future__ import annotations

import json
import math
import re
from importlib.resources import files
from pathlib import Path

import pytest

from skred.diagnosis.check.decision import TIED_NATS
from skred.diagnosis.compare.candidate import FORM
from skred.diagnosis.evidence.prior_odds import POWER, SHARES
from skred.diagnosis.limits import LIMIT, NOTHING_AT_MOST
from skred.diagnosis.verdict.document import verdict
from skred.inference.error_model import DEFAULT_ERRORS, ERROR_MODELS
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.output import plain
from skred.physics.laws import load_law

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


def in_code(text: str) -> set[str]:
    """Every word that stands in code, dotted paths taken apart."""
    return {word for name in re.findall(r"`([^`\n]+)`", text) for word in re.findall(r"\w+", name)}


BY_ID = ("probability", "prior", "detection_limits", "log_bayes_factors", "seconds", "constants")
"""Keys whose own keys are ids and names, not words of the format."""


def keys_of(document: object, *, of_ids: bool = False) -> set[str]:
    """All keys of a document at any depth."""
    if isinstance(document, list):
        return {key for item in document for key in keys_of(item)}
    if not isinstance(document, dict):
        return set()
    found = set() if of_ids else set(document)
    return found.union(*(keys_of(value, of_ids=key in BY_ID) for key, value in document.items()))


def keys_of_schema(part: object) -> set[str]:
    """Names of all properties that a schema speaks of."""
    if isinstance(part, list):
        return {key for item in part for key in keys_of_schema(item)}
    if not isinstance(part, dict):
        return set()
    own = set(part.get("properties", {}))
    return own.union(*(keys_of_schema(value) for value in part.values()))


SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))


def test_every_key_of_the_schema_is_explained() -> None:
    text = page("reading-a-verdict")
    first_cells = {name for cell in re.findall(r"^\| ([^|]+) \|", text, re.M) for name in in_code(cell)}
    assert set(SCHEMA["properties"]) <= first_cells
    assert keys_of_schema(SCHEMA) <= in_code(text)


def test_every_verdict_is_explained() -> None:
    assert set(SCHEMA["properties"]["verdict"]["enum"]) <= set(rows(page("reading-a-verdict")))


@pytest.mark.parametrize("kind", ["tie", "two", "sensor", "unexplained", "nothing", "gate"])
def test_every_key_that_is_written_is_explained(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "report")
    from diagnosis_report_cases import diagnosis

    written = keys_of(plain(verdict(diagnosis(kind))))
    assert len(written) > len(SCHEMA["required"])
    assert written <= in_code(page("reading-a-verdict"))


def test_rules_on_the_page_are_the_codes() -> None:
    text = page("reading-a-verdict")
    assert f"p is at most {LIMIT:g} and `nothing` is less probable than {NOTHING_AT_MOST:g}" in text
    assert f"holds {INTERVAL_PROBABILITY:.0%}".replace("%", " %") in text
    assert f"at most {math.exp(TIED_NATS):.1f} times less probable" in text
    assert f"to the power {POWER:g}" in text and f"another {100 * FORM:.0f} % of the mean" in text
    assert all(f" {share:g}" in text for share in SHARES.values())


WORDS = """
    model comparison; comparison under one error model; candidate; added; screening; local
    refinement; re-computed evidence; model discrepancy; mode; Laplace approximation; prior penalty;
    Occam factor; tempered; tempering exponent; held-out; worker pool; sandbox; score and information;
    linear mixed model; conditional MAP; quadrature points; B-spline basis; score test; bootstrap test
    (parametric); bootstrap campaign; detectability; confounded with; retained information; compensated;
    credible set; convergence criteria; coefficient; diagnostic signature; contaminated; acceptance
    criteria; selectivity; nats as odds; front; runout; thalweg; retardation; kernel; tie; Pareto k;
    r-hat; ESS
"""
"""The standard words of names, reports and pages, and those of the field."""


def test_the_glossary_is_alphabetical_and_has_the_standard_words() -> None:
    text = page("glossary")
    terms = re.findall(r"^- \*\*(.+?)\*\*: ", text, re.M)
    keys = [re.sub(r"[^a-z0-9]+", " ", term.lower()) for term in terms]
    assert keys == sorted(keys) and len(set(keys)) == len(keys)
    assert len(terms) == len(re.findall(r"^- ", text, re.M))
    bold = set(re.findall(r"\*\*(.+?)\*\*", text))
    assert {" ".join(word.split()) for word in WORDS.split(";")} <= bold


def test_every_reference_within_the_glossary_has_an_entry() -> None:
    text = page("glossary")
    terms = {term.lower() for term in re.findall(r"\*\*(.+?)\*\*", text)}
    terms |= {term.partition(" (")[0] for term in terms} | {"divergences", "priors", "terms"}
    for word in re.findall(r"(?<!\*)\*([^*\n]+)\*(?!\*)", text.partition("entry of its own.")[2]):
        name = word.lower()
        assert any(form in terms for form in (name, name.removesuffix("s"), name.removesuffix("'s"))), word


def test_the_first_page_lists_all_pages() -> None:
    listed = re.findall(r"^\| \[([\w: -]+)\]\((\S+)\) \|", page("index"), re.M)
    there = {f"{file.stem}": f"{file.stem}.md" for file in DOCS.glob("*.md") if file.stem != "index"}
    there |= {f"notebook: {file.stem}": f"notebooks/{file.name}" for file in DOCS.glob("notebooks/*.py")}
    assert dict(listed) == there and len(listed) == len(there)
