"""The diagnosis in one paragraph of plain words: where, what, how sure, how much better."""

from __future__ import annotations

from typing import Any

from skred.diagnosis.augment.step import Step
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.compare.decision import NOTHING_AT_MOST, Decision
from skred.diagnosis.compare.location import Location
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome, ProfileAdded
from skred.diagnosis.words import percent
from skred.inference.intervals import PRACTICAL_DIFFERENCE
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.stretches import U_1, U_2

_RIVAL = 0.05
"""Probability from which another candidate than those named is told of."""


def statement(found: Outcome, document: dict[str, Any]) -> str:
    """One paragraph in plain words."""
    if isinstance(found, NotDiagnosed) or found.reason:
        return f"These recordings cannot tell: {found.reason}."
    parts = {
        "missing_physics": _named,
        "instrument": _named,
        "unexplained": _unexplained,
        "nothing_missing": _nothing,
        "cannot_tell": _cannot,
    }[found.decision.verdict](found, document)
    return " ".join(part for part in parts if part)


def _title(name: str) -> str:
    return "a force not in the list" if name == UNLISTED else mechanisms()[name].title


def _short(name: str) -> str:
    """Its title without examples, which have commas of their own."""
    return _title(name).partition(":")[0]


def _where(location: dict[str, float] | None) -> str:
    if location is None:
        return ""
    return f" between s = {location['s_from_m']:.0f} m and {location['s_to_m']:.0f} m"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _what(decision: Decision) -> str:
    """What is off, before the name that leads."""
    if decision.disputed:
        return "Physics is missing, or the recordings are off; in the lead"
    return "The recordings are off" if decision.verdict == "instrument" else "Physics is missing"


def _named(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    name, ties = document["mechanism"], document["indistinguishable"]
    strength, probability = document["strength"], document["probability"]
    subject = document["covariate"] or document["sensor"]
    standard = document["mechanisms"][0]["standard"]
    by_logarithm = ", by its logarithm" if standard is not None and standard["logarithm"] else ""
    about = f" ({subject}{by_logarithm})" if subject else ""
    sentences = [
        f"{_what(found.decision)}: {_title(name)}{about}{_where(document['location'])}, with a probability of"
        f" {percent(probability[name])} (nothing: {percent(probability[NOTHING])}; a force not in the list:"
        f" {percent(probability[UNLISTED])}).",
        f"Its {strength['parameter'].replace('_', ' ')} is {strength['mean']:.3g} +- {strength['sd']:.2g}"
        f"{_unit(strength['unit'])}.",
    ]
    sentences.append(_opposed(document["mechanisms"][0]["constants"]))
    if document["covariate"]:
        sentences.append("Associated with, not necessarily caused by.")
    if ties:
        others = ", ".join(f"{_short(other)} ({percent(probability[other])})" for other in ties)
        sentences.append(f"These recordings cannot tell it from: {others}.")
        sentences.append(_split(found.steps[0], document))
    sentences.append(_rival(document))
    if len(document["mechanisms"]) > 1:
        second = document["mechanisms"][1]
        sentences.append(
            f"Given that, a second one earned its place: {_title(second['id'])}{_where(second['location'])}."
        )
        sentences.append(_opposed(second["constants"]))
    sentences.append(_improvement(document))
    sentences.append(_still_fired(found.steps[-1].check))
    return [*sentences, _left(document)]


def _rival(document: dict[str, Any]) -> str:
    """The most probable listed candidate that is neither named nor tied, where it is not improbable."""
    told = {NOTHING, UNLISTED, document["mechanism"], *document["indistinguishable"]}
    others = {name: share for name, share in document["probability"].items() if name not in told}
    name = max(others, key=lambda one: others[one], default="")
    if not name or others[name] < _RIVAL:
        return ""
    return f"Not excluded: {_title(name)} ({percent(others[name])})."


def _still_fired(check: BootstrapTest) -> str:
    """That the law fails the check also with what was let in, where it does."""
    if not check.fired:
        return ""
    return (
        f"The augmented law still fails the check (p = {check.p_value:.2g}): something more, or another"
        " shape of the same, is left; do not take this for the whole story."
    )


def _opposed(constants: dict[str, float]) -> str:
    """That a relief opposes a mechanism, where one does."""
    if U_1 not in constants:
        return ""
    return (
        "On the same stretch a relief equals it at about the typical speed"
        f" ({constants[U_1]:.0f} to {constants[U_2]:.0f} m/s), so that it shows in fronts that are faster or"
        " slower than most, not on average."
    )


def _left(document: dict[str, Any]) -> str:
    """What a last comparison leaned to."""
    left = document["left"]
    if left is None or left["most_probable"] == NOTHING:
        return ""
    name = left["most_probable"]
    why = f" ({left['reason']})" if left["reason"] else ""
    return (
        f"Another comparison, of the augmented law, leans to {_title(name)} ({percent(left['probability'])};"
        f" nothing more: {percent(left['nothing'])}); it was not let in{why}."
    )


def _split(step: Step, document: dict[str, Any]) -> str:
    sensor = document["next_sensor"]
    if sensor is not None:
        first, second = sensor["splits"]
        at = f"A speed at s = {sensor['s_from_m']:.0f} m"
        return f"{at} would split {_short(first)} and {_short(second)} best."
    same = ", ".join(_short(name) for name in step.tied if name != UNLISTED)
    return f"No further speed would split off {same}: the term is the same." if same else ""


def _improvement(document: dict[str, Any]) -> str:
    evidence, held = document["evidence"], document["held_out"]
    difference, se = evidence["elpd_diff"], evidence["elpd_se"]
    if difference is None:
        return ""
    much = "" if abs(difference) >= PRACTICAL_DIFFERENCE else ", no practical difference"
    text = (
        f"For avalanches left out the log score changes by {difference:+.1f} (standard error, doubled,"
        f" {2.0 * se:.1f}){much}"
    )
    if held["rmse_velocity_before"] is not None and held["rmse_velocity_after"] is not None:
        text += (
            f"; the error of speeds from {held['rmse_velocity_before']:.1f} to"
            f" {held['rmse_velocity_after']:.1f} m/s"
        )
    if held["rmse_runout_before"] is not None and held["rmse_runout_after"] is not None:
        text += f", of runout from {held['rmse_runout_before']:.0f} to {held['rmse_runout_after']:.0f} m"
    return text + "."


def _unexplained(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    probability = document["probability"]
    doubt = 1.0 - probability[NOTHING] - probability[UNLISTED] >= _RIVAL
    return [
        f"Something is missing{_where(document['location'])} that {'most probably ' if doubt else ''}no"
        f" listed mechanism accounts for (a force not in the list: {percent(probability[UNLISTED])}; nothing:"
        f" {percent(probability[NOTHING])}; check: p = {found.check.p_value:.2g}).",
        _unlisted_way(found.location),
        _closest(found, document),
        "The force profile is the answer: see where it stands out and how much work it does.",
        _improvement(document),
        _still_fired(found.finding.law.check) if isinstance(found.finding, ProfileAdded) else "",
    ]


def _unlisted_way(location: Location) -> str:
    """Whom an unlisted force brakes where it stands out, if it is nil at the typical speed."""
    if not location.opposed:
        return ""
    first, last = location.stretch_m
    there = location.mean[(location.s_m >= first) & (location.s_m <= last)]
    faster, slower = ("brakes", "relieves") if there.mean() > 0.0 else ("relieves", "brakes")
    return (
        f"On average there is nothing to see: it {slower} fronts that are slower there than the typical one,"
        f" and {faster} faster ones."
    )


def _closest(found: Diagnosis, document: dict[str, Any]) -> str:
    """The listed candidate of the highest evidence, beside the unlisted force."""
    factors = found.comparison.log_factors
    listed = {name: value for name, value in factors.items() if name not in (NOTHING, UNLISTED)}
    name = max(listed, key=lambda one: listed[one])
    return (
        f"Of what is listed, {_title(name)} comes closest ({percent(document['probability'][name])}): log"
        f" Bayes factor {listed[name]:.1f} against nothing, where a force not in the list has"
        f" {factors[UNLISTED]:.1f}."
    )


def _hint(found: Diagnosis, document: dict[str, Any]) -> str:
    """What the comparison would say alone, where it says something and the check does not."""
    probability = document["probability"]
    if probability[NOTHING] >= NOTHING_AT_MOST:
        return ""
    first = max((name for name in probability if name != NOTHING), key=lambda name: probability[name])
    return (
        f"Of what could be missing, {_title(first)} would be the most probable"
        f" ({percent(probability[first])}); but to the check"
        f" {100.0 * found.check.p_value:.0f} % of clean campaigns look as odd, so none is claimed."
    )


def _odd(found: Diagnosis) -> str:
    """What the check would say alone, where it says something and the comparison does not."""
    if not found.check.fired:
        return ""
    return (
        "But to the check they are odder than clean campaigns are, all but 1 % of them: by chance, or by"
        " something that no candidate and no force along the track describes."
    )


def _nothing(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    return [
        f"The recordings do not bear out that anything is missing (p = {found.check.p_value:.2g}; probability"
        f" of nothing {percent(document['probability'][NOTHING])}).",
        f"A relevant strength of what is listed would have been found in {100.0 * found.table.power:.0f} % of"
        " cases on average; the table of detection limits says from where on each would have been seen.",
    ]


def _cannot(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    alarm = (
        f"No alarm (p = {found.check.p_value:.2g}; probability of nothing"
        f" {percent(document['probability'][NOTHING])}), but"
    )
    power = f"{100.0 * found.table.power:.0f} % of cases on average"
    silence = (
        f"{alarm} no silence either: these recordings cannot tell whether anything is missing. A relevant"
        f" strength of what is listed would have been found in {power}."
        if found.table.can_tell
        else f"{alarm} these recordings cannot tell: a relevant strength of what is listed would have been"
        f" found in only {power}, so silence means little."
    )
    sentences = [
        silence,
        _odd(found),
        _hint(found, document),
    ]
    sensor = document["next_sensor"]
    if sensor is not None:
        sentences.append(
            f"One more speed at s = {sensor['s_from_m']:.0f} m would raise that to"
            f" {100.0 * found.table.power_with:.0f} %."
        )
    return sentences
