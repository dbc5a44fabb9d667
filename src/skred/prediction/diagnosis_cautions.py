"""What the diagnosis that a prediction rests on says against itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skred.chances import percent
from skred.inference.influence_words import NOT_LISTED, carried, displaced, title_of, too_little
from skred.physics.mechanisms.spec import Group


def diagnosis_cautions(verdict: Mapping[str, Any]) -> list[str]:
    """Sentences: which avalanches carry the answer, how probable its name is, and what it could be instead.

    Parameters
    ----------
    verdict : mapping
        The content of ``verdict.json`` of a diagnosis that added something.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        If it is not as a diagnosis writes it.
    """
    return [*_carried(verdict), *_probability(verdict), *_ties(verdict), *_fault(verdict)]


def _carried(verdict: Mapping[str, Any]) -> list[str]:
    influence = verdict.get("influence")
    if not influence or not influence["carried_by"]:
        return []
    n, rival = len(influence["events"]), influence.get("rival")
    with_all, needed = float(influence["log_bayes_factor"]), float(influence["needed"])
    told = []
    if rival and rival["carried_by"] == influence["carried_by"]:
        otherwise = displaced(title_of(str(rival["id"])), float(rival["ahead"]), float(rival["without_them"]))
        told.append(carried(list(map(str, rival["carried_by"])), n, otherwise))
    alarm = influence.get("alarm") or influence  # without it in verdicts of older versions
    if alarm["carried_by"]:
        otherwise = too_little(with_all, float(alarm["without_them"]), needed, _errors(verdict))
        what = "the alarm" if told else "this answer"
        told.append(carried(list(map(str, alarm["carried_by"])), n, otherwise, what))
    return [f"Take the diagnosis with care: {'; '.join(told)}."]


def _errors(verdict: Mapping[str, Any]) -> str:
    """The error model that an answer was held against others under, where several were compared."""
    several = len(verdict.get("error_models") or []) > 1
    return str(verdict["influence"].get("error_model") or "") if several else ""


def _probability(verdict: Mapping[str, Any]) -> list[str]:
    probability = verdict.get("probability") or {}
    named = verdict.get("mechanism")
    told = [
        f"{title_of(name)} {percent(float(probability[name]))}"
        for name in (named, NOT_LISTED)
        if name is not None and name in probability
    ]
    return [f"Probability by the diagnosis: {'; '.join(told)}."] if told else []


def _ties(verdict: Mapping[str, Any]) -> list[str]:
    tied, probability = verdict.get("indistinguishable") or [], verdict.get("probability") or {}
    told = [f"{title_of(name)} ({percent(float(probability[name]))})" for name in tied]
    return [f"Its recordings cannot tell that from: {', '.join(told)}."] if told else []


def _fault(verdict: Mapping[str, Any]) -> list[str]:
    """That a fault of the recordings comes closest to a force in no list, where it does: then none acts."""
    if verdict.get("verdict") != "unexplained":
        return []
    group = {one["id"]: one["group"] for one in verdict.get("candidates") or []}
    probability = verdict.get("probability") or {}
    closest = max(group, key=lambda name: float(probability.get(name, 0.0)), default="")
    if group.get(closest) != Group.INSTRUMENT:
        return []
    return [
        f"Of the listed causes {title_of(closest)} comes closest. If that is it, no force acts, and what is"
        " predicted with one is wrong."
    ]
