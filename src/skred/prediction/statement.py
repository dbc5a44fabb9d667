"""What a prediction says, in plain sentences, and what it does not say."""

from __future__ import annotations

import math
from typing import Any


def prediction_statement(document: dict[str, Any]) -> list[str]:
    """Sentences: how far, how fast, how sure, and on what all of it rests."""
    if not document["valid"]:
        problems = "; ".join(document["gate"]["problems"])
        return [f"The gate of convergence failed, so nothing is predicted: {problems}."]
    return [*_distances(document), *_at_places(document), _parts(document), *_conditions(document)]


def _distances(document: dict[str, Any]) -> list[str]:
    runout, track = document["runout"], document["track"]
    zero, length = track["reference_s_m"], track["length_m"]
    told = []
    for row in runout["exceeded_by"]:
        which = f"{100 * row['share']:g} %"
        low, high = (_end_or(row[key], length) for key in ("low", "high"))
        if row["at_least"]:
            told.append(f"{which} to the end of the track, s = {length:.0f} m, or beyond ({low} to {high} m)")
            continue
        offset = "" if zero is None else f", {_from_reference(row['value'] - zero)}"
        told.append(f"{which} beyond s = {row['value']:.0f} m{offset} ({low} to {high} m)")
    sentences = [
        "Of avalanches like those recorded, from " + track["release"] + ", run: " + "; ".join(told) + "."
    ]
    end = runout["end_of_track"]
    if end["high"] >= 0.001:
        sentences.append(
            f"The end of the track (s = {length:.0f} m) is reached by {_chance(end)}: their runout"
            " is at least that."
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
        sentences.append(f"{_chance(place['beyond'])} come past {name} (s = {place['s_m']:.0f} m){speed}.")
    return sentences


def _parts(document: dict[str, Any]) -> str:
    runout, n_events = document["runout"], document["campaign"]["n_events"]
    parts, whose = runout["beyond_shortest_recorded"], " that goes as far as recorded ones"
    if parts is None:
        parts, whose = runout["all"], ""
    residual = parts["sd_residual_m"]
    reading = "" if math.isnan(residual) else f", {residual:.0f} m error of a reading"
    return (
        f"Standard deviation of the runout of the next avalanche{whose}: {parts['sd_event_m']:.0f} m from one"
        f" avalanche to another, {parts['sd_parameter_m']:.0f} m because {n_events} avalanches do not tell"
        f" the population better{reading}."
    )


def _conditions(document: dict[str, Any]) -> list[str]:
    campaign, track = document["campaign"], document["track"]
    sentences = [
        "Probabilities are per avalanche like those recorded, not per year: how often avalanches come is not"
        " in the recordings.",
        "Recorded avalanches are a selection, those that went far enough for the instruments; nothing here"
        f" corrects for that.{_outside(document)}",
        f"Every share below about {_percent(1.0 / campaign['n_events'])} (1 in {campaign['n_events']}), and"
        " what lies outside the recorded range, is an extrapolation: by the law, and by strengths that are"
        " log-normal across avalanches.",
        f"Bands hold {100 * document['interval']['probability']:.0f} % of the posterior probability"
        f" ({document['interval']['kind']}) if the law is right; that it may be wrong is not in them.",
    ]
    if not track["is_own"]:
        sentences.append(
            f"The population is that of {campaign['name']}; that avalanches on {track['name']} come from"
            " the same one (snow, size, release) is assumed, and no recording here tests it."
        )
    return sentences


def _outside(document: dict[str, Any]) -> str:
    """How much of what is predicted lies outside of what was recorded."""
    if not document["runout"]["beyond_recorded"]:
        return ""
    shortest, longest = document["runout"]["beyond_recorded"]
    above = {"value": 1 - shortest["value"], "low": 1 - shortest["high"], "high": 1 - shortest["low"]}
    low, high = shortest["s_m"], longest["s_m"]
    return (
        f" Of those predicted, {_chance(above)} stop above the shortest recorded runout (s = {low:.0f} m),"
        f" {_chance(longest)} run beyond the longest (s = {high:.0f} m)."
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
