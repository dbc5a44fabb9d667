"""What the diagnosis that a prediction rests on says against itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skred.chances import percent
from skred.inference.influence_words import carried
from skred.physics.mechanisms import mechanisms

_NOT_LISTED = "unlisted"


def diagnosis_cautions(verdict: Mapping[str, Any]) -> list[str]:
    """Sentences: which avalanches carry the answer, how probable its name is, and what it is tied with.

    Parameters
    ----------
    verdict : mapping
        The content of ``verdict.json`` of a diagnosis that added something.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        If it is not as a diagnosis writes it.
    """
    return [*_carried(verdict.get("influence")), *_probability(verdict), *_ties(verdict)]


def _carried(influence: Mapping[str, Any] | None) -> list[str]:
    if not influence or not influence["carried_by"]:
        return []
    told = carried(
        [str(event) for event in influence["carried_by"]],
        len(influence["events"]),
        *(float(influence[key]) for key in ("log_bayes_factor", "without_them", "needed")),
    )
    return [f"Take the diagnosis with care: {told}."]


def _probability(verdict: Mapping[str, Any]) -> list[str]:
    probability = verdict.get("probability") or {}
    named = verdict.get("mechanism")
    told = [
        f"{_title(name)} {percent(float(probability[name]))}"
        for name in (named, _NOT_LISTED)
        if name is not None and name in probability
    ]
    return [f"Probability by the diagnosis: {'; '.join(told)}."] if told else []


def _ties(verdict: Mapping[str, Any]) -> list[str]:
    tied, probability = verdict.get("indistinguishable") or [], verdict.get("probability") or {}
    told = [f"{_title(name)} ({percent(float(probability[name]))})" for name in tied]
    return [f"Its recordings cannot tell that from: {', '.join(told)}."] if told else []


def _title(name: str) -> str:
    """A mechanism without the examples in its title."""
    known = mechanisms()
    if name == _NOT_LISTED:
        return "a force not in the list"
    return known[name].title.partition(":")[0] if name in known else str(name)
