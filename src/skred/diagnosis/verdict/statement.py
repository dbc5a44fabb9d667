"""The diagnosis in one paragraph of plain words: where, what, how sure, how much better."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from skred.diagnosis.augment.coefficient import augmented_of
from skred.diagnosis.augment.step import Step
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.compare.location import Location
from skred.diagnosis.evidence.prior_odds import NOTHING, SHARES, UNLISTED
from skred.diagnosis.limits import NOTHING_AT_MOST
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.verdict.beside_force import beside_force, by_both
from skred.diagnosis.verdict.between import between_sentence
from skred.diagnosis.verdict.hangs_on import carried, hangs_on
from skred.diagnosis.verdict.improvement import improvement
from skred.diagnosis.verdict.stated_places import moved_as_stated, place_as_stated, strength_with_places
from skred.diagnosis.words import TOLD_FROM, no_room, percent, plus_minus
from skred.inference.influence_words import enumerated, title_of
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.stretches import U_1, U_2

_ASSOCIATED = "Associated with, not necessarily caused by."


def statement(found: Outcome, document: dict[str, Any]) -> str:
    """One paragraph in plain words."""
    if isinstance(found, NotDiagnosed) or found.reason:
        return f"These recordings cannot tell: {_found(found)}{found.reason}."
    parts = {
        "missing_physics": _named,
        "instrument": _named,
        "unexplained": _unexplained,
        "nothing_missing": _nothing,
        "cannot_tell": _cannot,
    }[found.decision.verdict](found, document)
    parts = [_caution(found), *parts, moved_as_stated(found), *hangs_on(found.influence, _errors(found))]
    parts.append(no_room() if found.table.lacks_room else "")
    return " ".join(part for part in parts if part)


def _found(found: Outcome) -> str:
    """What the comparison found and could not be added, before the reason."""
    if isinstance(found, NotDiagnosed) or not found.not_added:
        return ""
    name = found.not_added[0]
    leads = f"{title_of(name)} leads ({percent(found.comparison.probability[name])})"
    return f"there is an alarm ({_rare(found.check)}), and {leads}, but it could not be added; "


def _errors(found: Diagnosis) -> str:
    """The error model that an answer has most evidence under, where several were compared."""
    if found.influence is None or len(found.comparison.under_each) == 1:
        return ""
    return found.comparison.leading(found.influence.answer).error_model


def _caution(found: Diagnosis) -> str:
    """The first thing to know: that few avalanches carry the answer, and what it takes for granted."""
    few = carried(found.influence, _errors(found))
    reasons = few, _not_converged(found.refits_not_converged), place_as_stated(found)
    given = [one for one in reasons if one]
    return f"Take this with care: {'; '.join(given)}." if given else ""


def _not_converged(events: Sequence[str]) -> str:
    """Which refits did not converge."""
    if not events:
        return ""
    refits = f"the refit without avalanche {events[0]}"
    if len(events) > 1:
        refits = f"the refits without avalanches {enumerated(events)}"
    return f"{refits} did not converge, and the held-out scores rest on that"


def _where(location: dict[str, float] | None) -> str:
    if location is None:
        return ""
    return f" between s = {location['s_from_m']:.0f} and {location['s_to_m']:.0f} m"


def _entry(entry: dict[str, Any]) -> str:
    """What was added, the sensor or covariate it refers to, and where it acts."""
    standard = entry["standard"]
    by_logarithm = ", by its logarithm" if standard is not None and standard["logarithm"] else ""
    return f"{title_of(entry['id'])}{_about(entry, by_logarithm)}{_where(entry['location'])}"


def _about(entry: dict[str, Any], how: str = "") -> str:
    """The covariate or sensor that something refers to; empty where it refers to none."""
    subject = entry["covariate"] or entry["sensor"]
    return f" ({subject}{how})" if subject else ""


def _begins(step: Step) -> str:
    """How probably what acts along the track begins at the first recording, if that is most probable."""
    found, begins = step.candidate, step.candidate.best.shape.begins_m
    if begins is None:
        return ""
    later = [one.shape.begins_m is not None for one in found.curves]
    return (
        f"With a probability of {percent(float(found.shape_weights[later].sum()))} it acts only from"
        f" s = {begins:.0f} m on, where recordings begin; else along the whole track. Nothing is recorded"
        " above: what fronts had lost until there is the base law's to say."
    )


def _what(found: Diagnosis) -> str:
    """What is off, before the name that leads."""
    if found.decision.disputed:
        return "Physics is missing, or the recordings are off; in the lead"
    if len({step.candidate.mechanism.group for step in found.steps}) > 1:
        return "Physics is missing, and the recordings are off; first"
    return "The recordings are off" if found.decision.verdict == "instrument" else "Physics is missing"


def _named(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    name, ties = document["mechanism"], document["indistinguishable"]
    strength, probability = document["strength"], document["probability"]
    first, *others = document["mechanisms"]
    force = beside_force(found.comparison)
    more_probable = ", which is more probable" if probability[UNLISTED] > probability[name] else ""
    sentences = [
        f"{_what(found)}: {_entry(first)}, with a probability of"
        f" {percent(probability[name])} (nothing: {percent(probability[NOTHING])}; a force not in the list"
        f"{more_probable}: {percent(probability[UNLISTED])}).",
        by_both(found.comparison, name),
        f"Its {strength['parameter'].replace('_', ' ')} is"
        f" {plus_minus(strength['mean'], strength['sd'], strength['unit'])}"
        f"{_in_words(found, strength['mean'])}.",
        strength_with_places(found),
        _begins(found.steps[0]),
        between_sentence(strength),
        _compensated(first["constants"]),
    ]
    if document["covariate"]:
        sentences.append(_ASSOCIATED)
    if ties:
        sentences += [_tied([name, *ties], probability, force), _split(found.steps[0], document)]
    sentences.append(_not_excluded(document, force))
    for step, second in zip(found.steps[1:], others, strict=True):
        sentences += _second(step, second)
    sentences += [improvement(document), _other_errors(found)]
    sentences.append(_still_fired(found.steps[-1].check))
    return [*sentences, _left(document)]


def _second(step: Step, second: dict[str, Any]) -> list[str]:
    """What was found beside the first mechanism."""
    again, strength = step.comparison.probability, second["strength"]
    return [
        f"Given that, {'a second one was added' if step.check.fired else 'a second one earned its place'}:"
        f" {_entry(second)}, {percent(again[second['id']])}.",
        by_both(step.comparison, second["id"]),
        f"Its {strength['parameter'].replace('_', ' ')} is"
        f" {plus_minus(strength['mean'], strength['sd'], strength['unit'])}.",
        between_sentence(strength),
        _ASSOCIATED if second["covariate"] else "",
        _tied([second["id"], *step.tied], again, beside_force(step.comparison)),
        _begins(step),
        _compensated(second["constants"]),
    ]


def _in_words(found: Diagnosis, mean: float) -> str:
    """What a strength does that is the logarithm of a factor, or a place; empty for all others."""
    direction = found.steps[0].candidate.best.direction
    if direction.places is not None:
        return f": it stands {'further down' if mean > 0.0 else 'further up'} than noted"
    if direction.log_readings is None and direction.log_strengths is None:
        return ""
    size = f"{100.0 * abs(math.expm1(mean)):.0f} %"
    if direction.log_readings is not None:
        return f": it reads {size} too {'high' if mean > 0.0 else 'low'}"
    what = found.law.mechanisms[0].strength.name.replace("_", " ")
    return f": one standard deviation up, {what} is {size} {'more' if mean > 0.0 else 'less'}"


def _tied(names: Sequence[str], probability: Mapping[str, float], force: Collection[str] = ()) -> str:
    """What the recordings cannot tell from the first of these.

    Parameters
    ----------
    force : collection of str
        Those that have their evidence together with a force in no list.
    """
    ties, told = names[1:], set(names)
    how = {other: percent(probability.get(other, 0.0)) + _with_force(other, force) for other in ties}
    for other in ties:
        same = mechanisms()[other].same_term_as if other != UNLISTED else None
        if same is not None and same in told:
            own = f"; in a form of its own {how[other]}" if other in probability else ""
            how[other] = f"the same term{'' if same == names[0] else f' as {title_of(same)}'}{own}"
    listed = ", ".join(f"{title_of(other)} ({sure})" for other, sure in how.items())
    return f"These recordings cannot tell it from: {listed}." if ties else ""


def _with_force(name: str, force: Collection[str]) -> str:
    return ", with a force in no list beside it" if name in force else ""


def _not_excluded(document: dict[str, Any], force: Collection[str]) -> str:
    """The most probable listed candidate that is neither added nor tied, where it is not improbable."""
    added = [one["id"] for one in document["mechanisms"]]
    told = {NOTHING, UNLISTED, *added, *document["indistinguishable"]}
    others = {name: share for name, share in document["probability"].items() if name not in told}
    name = max(others, key=lambda one: others[one], default="")
    if not name or others[name] < TOLD_FROM:
        return ""
    return f"Not excluded: {title_of(name)} ({percent(others[name])}{_with_force(name, force)})."


def _other_errors(found: Diagnosis) -> str:
    """Under which errors the log score changes, where the base law was calibrated under others."""
    own, both = (one.error_model.id for one in (found.problem, augmented_of(found.steps[-1].calibration)))
    if own == both:
        return ""
    return (
        f"Both laws are under {both} errors there, which suit the augmented one; the calibrated base law has"
        f" {own} errors."
    )


def _still_fired(check: BootstrapTest) -> str:
    """That the law fails the check also with what was added, where it does."""
    if not check.fired:
        return ""
    return (
        f"The augmented law still fails the check ({_rare(check)}): something more is missing, or"
        " the same in another form. Do not take this for the whole story: what was added may stand for"
        " something that no listed term describes."
    )


def _compensated(constants: dict[str, float]) -> str:
    """That a mechanism is compensated at the typical speed, where it is."""
    if U_1 not in constants:
        return ""
    return (
        "On the same stretch it is compensated at about the typical speed"
        f" ({constants[U_1]:.0f} to {constants[U_2]:.0f} m/s): the mean front is unaffected, and only slower"
        " and faster fronts show it."
    )


def _left(document: dict[str, Any]) -> str:
    """What led in a last comparison."""
    left = document["left"]
    if left is None or left["nothing"] >= SHARES[NOTHING]:
        return ""
    what = f"{title_of(left['most_probable'])}{_about(left)}"
    why = f" ({left['reason']})" if left["reason"] else ""
    return (
        f"Another comparison, of the augmented law, has {what} as the most probable of what could still be"
        f" missing, {percent(left['probability'])} (nothing more: {percent(left['nothing'])}); it was not"
        f" added{why}."
    )


def _split(step: Step, document: dict[str, Any]) -> str:
    """Which reading would split a tie, or that none would."""
    sensor = document["next_sensor"]
    if sensor is not None and sensor["splits"]:
        first, second = sensor["splits"]
        at = f"A speed at s = {sensor['s_from_m']:.0f} m"
        return f"{at} would split {title_of(first)} and {title_of(second)} best."
    same = ", ".join(title_of(name) for name in step.tied if name != UNLISTED)
    return f"No further speed would split off {same}: the term is the same." if same else ""


def _unexplained(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    probability = document["probability"]
    doubt = 1.0 - probability[NOTHING] - probability[UNLISTED] >= TOLD_FROM
    return [
        f"Something is missing{_where(document['location'])} that {'most probably ' if doubt else ''}no"
        f" listed mechanism accounts for (a force not in the list: {percent(probability[UNLISTED])}; nothing:"
        f" {percent(probability[NOTHING])}; check: {_rare(found.check)}).",
        _tied([UNLISTED, *document["indistinguishable"]], probability, beside_force(found.comparison)),
        _by_speed(found.location),
        _closest(found, document),
        "The force profile is the answer: it says where the force acts and how much work it does.",
        improvement(document),
        _still_fired(found.finding.check) if isinstance(found.finding, ProfileLaw) else "",
    ]


def _by_speed(location: Location) -> str:
    """Which fronts a force decelerates where it stands out, if it is nil at the typical speed."""
    if not location.opposed:
        return ""
    first, last = location.stretch_m
    there = location.mean[(location.s_m >= first) & (location.s_m <= last)]
    slower, faster = ("accelerated", "decelerated") if there.mean() > 0.0 else ("decelerated", "accelerated")
    return f"The mean front is unaffected: slower fronts are {slower} there, faster ones {faster}."


def _closest(found: Diagnosis, document: dict[str, Any]) -> str:
    """The most probable listed candidate, beside the force that is not in the list."""
    factors, probability = found.comparison.log_factors, document["probability"]
    listed = [name for name in factors if name not in (NOTHING, UNLISTED)]
    name = max(listed, key=lambda one: probability[one])
    closest = f"Of the listed mechanisms, {title_of(name)} comes closest ({percent(probability[name])})"
    if together := by_both(found.comparison, name):
        return f"{closest}. {together}"
    return (
        f"{closest}: its log Bayes factor against nothing is {factors[name]:.1f} nats, that of a force not in"
        f" the list {factors[UNLISTED]:.1f}."
    )


def _hint(found: Diagnosis, document: dict[str, Any]) -> str:
    """What the comparison would say, where something is more probable than nothing and none is claimed."""
    probability = document["probability"]
    if probability[NOTHING] >= SHARES[NOTHING]:
        return ""
    first = max((name for name in probability if name != NOTHING), key=lambda name: probability[name])
    why = (
        f"nothing keeps {percent(probability[NOTHING])}, and a claim leaves it less than"
        f" {percent(NOTHING_AT_MOST)}"
        if probability[NOTHING] >= NOTHING_AT_MOST
        else _too_usual(found.check)
    )
    how = percent(probability[first]) + _with_force(first, beside_force(found.comparison))
    return (
        f"Of what could be missing, {title_of(first)} would be the most probable ({how}). None is claimed:"
        f" {why}."
    )


def _too_usual(check: BootstrapTest) -> str:
    """Why the check raises no alarm though nothing is improbable."""
    above, of = int((check.simulated >= check.statistic).sum()), len(check.simulated)
    if above:
        return f"{above} of {of} clean campaigns {'has' if above == 1 else 'have'} such odds"
    return (
        "by one thing alone and with a strength in common to all avalanches the log odds are only"
        f" {check.statistic:.1f} nats"
    )


def _rare(check: BootstrapTest) -> str:
    """How rare such odds are among clean campaigns."""
    return f"p {'at most' if check.is_bound else '='} {check.p_value:.2g}"


def _nothing(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    return [
        f"The recordings give no reason to add anything ({_rare(found.check)}; probability of"
        f" nothing {percent(document['probability'][NOTHING])}).",
        f"A relevant strength of a listed mechanism would have been found in {percent(found.table.power)} of"
        " cases on average; the detection limits say from which strength on each would have been seen.",
    ]


def _cannot(found: Diagnosis, document: dict[str, Any]) -> list[str]:
    alarm = (
        f"No alarm ({_rare(found.check)}; probability of nothing"
        f" {percent(document['probability'][NOTHING])}), but"
    )
    power = f"{percent(found.table.power)} of cases on average"
    only = "" if power.startswith("less") else "only "
    silence = (
        f"{alarm} no silence either: these recordings cannot tell whether anything is missing. A relevant"
        f" strength of a listed mechanism would have been found in {power}."
        if found.table.can_tell
        else f"{alarm} these recordings cannot tell: a relevant strength of a listed mechanism would have"
        f" been found in {only}{power}, so silence means little."
    )
    sentences = [silence, _hint(found, document)]
    sensor = document["next_sensor"]
    if sensor is not None:
        sentences.append(
            f"One more speed at s = {sensor['s_from_m']:.0f} m would raise that to"
            f" {percent(sensor['power_with'])}."
        )
    return sentences
