"""A prediction in sentences: its results, and the conditions they depend on."""

from __future__ import annotations

import math
from typing import Any


def prediction_statement(document: dict[str, Any]) -> list[str]:
    """Sentences on runout, speed and uncertainty, and on the assumptions."""
    if not document["valid"]:
        problems = "; ".join(document["gate"]["problems"])
        return [f"The chains did not converge, so nothing is predicted: {problems}."]
    return [*_distances(document), *_at_places(document), _parts(document), *_conditions(document)]


def _distances(document: dict[str, Any]) -> list[str]:
    runout, track = document["runout"], document["track"]
    zero, length = track["reference_s_m"], track["length_m"]
    told = []
    for row in runout["exceeded_by"]:
        which = f"{100 * row['share']:g} %"
        low, high = (_end_or(row[key], length) for key in ("low", "high"))
        if row["at_least"]:
            told.append(
                f"{which} run to the end of the track, s = {length:.0f} m, or beyond ({low} to {high} m)"
            )
            continue
        offset = "" if zero is None else f", {_from_reference(row['value'] - zero)}"
        told.append(f"{which} run beyond s = {row['value']:.0f} m{offset} ({low} to {high} m)")
    sentences = [f"Of avalanches like those recorded, from {track['release']}, {'; '.join(told)}."]
    end = runout["end_of_track"]
    if end["high"] >= 0.001:
        sentences.append(
            f"{_chance(end)} reach the end of the track (s = {length:.0f} m): their runout is at least that."
        )
    if runout["does_not_start"] >= 0.001:
        sentences.append(
            f"{_percent(runout['does_not_start'])} do not start: friction holds them at the release."
        )
    return sentences


def _at_places(document: dict[str, Any]) -> list[str]:
    sentences = []
    for place in document["places"]:
        fast = next((row for row in place["faster"] if row["speed_m_s"] == 10.0), None)
        speed = "" if fast is None else f"; {_chance(fast)} are faster than 10 m/s there"
        name = "the reference" if place["name"] == "reference" else place["name"]
        sentences.append(f"{_chance(place['beyond'])} pass {name} (s = {place['s_m']:.0f} m){speed}.")
    return sentences


def _parts(document: dict[str, Any]) -> str:
    runout, n_events = document["runout"], document["campaign"]["n_events"]
    parts, whose = runout["beyond_shortest_recorded"], " of avalanches that run as far as recorded ones"
    if parts is None:
        parts, whose = runout["all"], ""
    residual = parts["sd_residual_m"]
    named = [
        f"event-to-event variability ({parts['sd_event_m']:.0f} m)",
        f"uncertainty of the population, known from {n_events} avalanches ({parts['sd_parameter_m']:.0f} m)",
    ]
    if not math.isnan(residual):
        named.append(f"reading error ({residual:.0f} m)")
    count = {2: "two", 3: "three"}[len(named)]
    return (
        f"The predictive spread of the runout{whose} has {count} parts, as standard deviations:"
        f" {', '.join(named[:-1])} and {named[-1]}."
    )


def _conditions(document: dict[str, Any]) -> list[str]:
    campaign, track = document["campaign"], document["track"]
    sentences = [
        "Probabilities are per avalanche like those recorded, not per year: the recordings do not say how"
        " often avalanches occur.",
        "Recorded avalanches are a selection: they went far enough to reach the instruments. The prediction"
        f" does not correct for that.{_outside(document)}",
        f"Probabilities below about {_percent(1.0 / campaign['n_events'])} (1 in {campaign['n_events']}) and"
        " values outside the recorded range are extrapolations. They rest on the law and on parameters that"
        " are log-normal across avalanches.",
        f"Intervals are {document['interval']['kind']} and hold"
        f" {100 * document['interval']['probability']:.0f} % of the posterior probability if the law is"
        " right. They do not allow for an error of the law itself.",
    ]
    if not track["is_own"]:
        sentences.append(
            f"The population is that of {campaign['name']}. The prediction assumes that avalanches on"
            f" {track['name']} come from the same one (snow, size, release); no recording tests that."
        )
    return sentences


def _outside(document: dict[str, Any]) -> str:
    """Share of the predicted runouts outside the recorded range."""
    if not document["runout"]["beyond_recorded"]:
        return ""
    shortest, longest = document["runout"]["beyond_recorded"]
    above = {"value": 1 - shortest["value"], "low": 1 - shortest["high"], "high": 1 - shortest["low"]}
    low, high = shortest["s_m"], longest["s_m"]
    return (
        f" Of the predicted ones, {_chance(above)} stop above the shortest recorded runout"
        f" (s = {low:.0f} m) and {_chance(longest)} run beyond the longest (s = {high:.0f} m)."
    )


def _chance(band: dict[str, float]) -> str:
    return f"{_percent(band['value'])} ({_percent(band['low'])} to {_percent(band['high'])})"


def _percent(value: float) -> str:
    """Never rounded to an exact 0 or 100."""
    if 0.0 < value < 0.0005:
        return "<0.1 %"
    if 0.9995 < value < 1.0:
        return ">99.9 %"
    decimals = 1 if value < 0.0995 or value > 0.9005 else 0
    text = f"{100 * value:.{decimals}f} %"
    return text.replace(".0 %", " %")


def _end_or(value: float, length: float) -> str:
    return f"at least {length:.0f}" if value >= length else f"{value:.0f}"


def _from_reference(offset: float) -> str:
    return f"{abs(offset):.0f} m {'beyond' if offset >= 0 else 'above'} the reference"
