"""What a prediction says, in plain sentences, and what it does not say."""

from __future__ import annotations

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
        low, high = (_end_or(row[key], length) for key in ("low", "high"))
        place = _end_or(row["value"], length)
        offset = "" if zero is None or row["at_least"] else f", {_from_reference(row['value'] - zero)}"
        told.append(f"{100 * row['share']:g} % beyond s = {place} m{offset} ({low} to {high} m)")
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
    residual = runout["sd_residual_m"]
    reading = "" if residual != residual else f", {residual:.0f} m error of a reading"
    return (
        f"Standard deviation of the next runout: {runout['sd_event_m']:.0f} m from one avalanche to another,"
        f" {runout['sd_parameter_m']:.0f} m because {n_events} avalanches do not tell the population better"
        f"{reading}."
    )


def _conditions(document: dict[str, Any]) -> list[str]:
    campaign, track = document["campaign"], document["track"]
    longest = campaign["recorded_runout_max_m"]
    beyond = (
        ""
        if longest is None or not track["is_own"]
        else f" (the longest recorded runout is s = {longest:.0f} m)"
    )
    rare = 1.0 / campaign["n_events"]
    sentences = [
        "Probabilities are per avalanche like those recorded, not per year: how often avalanches come is not"
        " in the recordings.",
        "Recorded avalanches are a selection, those that went far enough for the instruments; nothing here"
        " corrects for that.",
        f"What lies beyond the recorded range{beyond}, and every share below about {_percent(rare)} (1 in"
        f" {campaign['n_events']}), is an extrapolation: by the law, and by strengths that are log-normal"
        " across avalanches.",
        f"Bands hold {100 * document['interval']['probability']:.0f} % of the posterior probability"
        f" ({document['interval']['kind']}) if the law is right; that it may be wrong is not in them.",
    ]
    if not track["is_own"]:
        sentences.append(
            f"The population is that of {campaign['name']}; that avalanches on {track['name']} come from"
            " the same one (snow, size, release) is assumed, and no recording here tests it."
        )
    return sentences


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
