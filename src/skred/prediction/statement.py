"""A prediction in sentences: its results, and the conditions they depend on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from skred.chances import percent
from skred.inference.between_events import BetweenEvents
from skred.inference.influence_words import NOT_LISTED
from skred.prediction.without_added import comparison_sentences
from skred.prediction.words import chance, ranged

MOST = 0.5
"""Share of avalanches from which on it is said first that they do not start."""


def prediction_statement(document: dict[str, Any]) -> list[str]:
    """Sentences on runout, speed and uncertainty, and on the assumptions."""
    if not document["valid"]:
        problems = "; ".join(document["gate"]["problems"])
        return [f"The chains did not converge, so nothing is predicted: {problems}."]
    return [
        *document["warnings"],
        *source_sentences(document),
        *cautions(document),
        *_distances(document),
        *_once_in(document),
        *_at_places(document),
        *comparison_sentences(document),
        _parts(document),
        *_conditions(document),
    ]


def warnings_of(document: dict[str, Any]) -> list[str]:
    """What makes numbers read as something that they are not: before everything else."""
    if not document["valid"] or document["runout"]["does_not_start"] < MOST:
        return []
    return [
        f"{percent(document['runout']['does_not_start'])} do not start: friction holds most fronts at the"
        f" release, {document['track']['release']}. So low chances at the places below are no all-clear."
        " Choose a release (--release) where the track is steep enough for an avalanche to start."
    ]


def cautions(document: dict[str, Any]) -> list[str]:
    """What the diagnosis that this is made from says against itself."""
    return [] if document["from"] is None else list(document["from"]["cautions"])


def source_sentences(document: dict[str, Any]) -> list[str]:
    """Which calibration this is, and what of it is left out here: before everything else."""
    told = [] if document["from"] is None else [document["from"]["told"]]
    told += [document["prior_note"]] if document.get("prior_note") else []
    told += not_used(document)
    for title, rows in _added(document, used=True).items():
        where, begins = _stretch(rows), rows[0].get("begins_m")
        if begins is not None:
            told.append(f"Used: {title}, {_from_where(begins, document['track']['is_own'])}.")
        elif where and rows[0]["mechanism"] == NOT_LISTED:
            told.append(f"Used: {title}{where}. (The verdict gives only where it stands out most.)")
        elif where:
            told.append(
                f"Used: {title}{where}, at the most probable place; how uncertain the place is does not widen"
                " the intervals. (The verdict gives the median of each end, which can differ from that.)"
            )
        if rows[0]["between_events"] != BetweenEvents.COMMON:
            told.append("Each new avalanche has its own strength of it, as those recorded differ.")
    return told


def not_used(document: dict[str, Any]) -> list[str]:
    """What was added to the law and is left out here, and why."""
    added = _added(document, used=False).items()
    return [f"Left out: {title}{_stretch(rows)}: {rows[0]['why']}." for title, rows in added]


def _added(document: dict[str, Any], *, used: bool) -> dict[str, list[dict[str, Any]]]:
    """What was added, by title: that is used here, or not."""
    apart: dict[str, list[dict[str, Any]]] = {}
    for row in document["added"]:
        apart.setdefault(row["title"], []).append(row)
    return {title: rows for title, rows in apart.items() if bool(rows[0]["used"]) == used}


def _stretch(rows: Sequence[dict[str, Any]]) -> str:
    """Where terms of one title act, from the first to the last."""
    ends = [end for row in rows for end in row["place_m"] or ()]
    return f" (s = {min(ends):.0f} to {max(ends):.0f} m)" if ends else ""


def _from_where(begins_m: float, own_track: bool) -> str:
    """Where a term acts that begins at the first recording of the calibration."""
    if own_track:
        return f"from s = {begins_m:.0f} m on, where the recordings of the calibration begin"
    return (
        "along the whole track. On that of the calibration it acts from the first recording on; where that is"
        " on another track is not known"
    )


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
            f"{chance(end)} reach the end of the track (s = {length:.0f} m): their runout is at least that."
        )
    if 0.001 <= runout["does_not_start"] < MOST:
        sentences.append(
            f"{percent(runout['does_not_start'])} do not start: friction holds them at the release."
        )
    return sentences


def _once_in(document: dict[str, Any]) -> list[str]:
    """Runouts for the return periods that were asked for."""
    length = document["track"]["length_m"]
    told = []
    for row in document["runout"]["once_in"]:
        ends = [row[key] for key in ("value", "low", "high")]
        value, low, high = ("no avalanche" if end is None else _end_or(end, length) for end in ends)
        if row["value"] is None:
            told.append(f"in {row['years']:g} years fewer than one avalanche starts")
        else:
            told.append(f"once in {row['years']:g} years an avalanche passes s = {value} m ({low} to {high})")
    if not told:
        return []
    rare = any(row["low"] is None and row["value"] is not None for row in document["runout"]["once_in"])
    more = " No avalanche: the interval allows that fewer than one starts in that time."
    return [f"On average, with the frequency that you gave: {'; '.join(told)}.{more if rare else ''}"]


def _at_places(document: dict[str, Any]) -> list[str]:
    lowest = max(document["track"]["releases_s_m"])
    told = [f"{_at(place)}{_above_some(place['s_m'], lowest)}" for place in document["at"]]
    return [*told, *_left_out(document.get("places_left_out", ()))]


def _above_some(s_m: float, lowest_release_m: float) -> str:
    """That a place lies above some of the releases: fewer come there than to places further down."""
    if s_m >= lowest_release_m:
        return ""
    return " It lies above some of the releases, whose avalanches start below it and count as not coming."


def _left_out(places: Sequence[dict[str, Any]]) -> list[str]:
    """Sensors of speed that no table shows; nothing where all are shown."""
    if not places:
        return []
    first, last = (f"{place['name']}, s = {place['s_m']:.0f} m" for place in (places[0], places[-1]))
    if len(places) == 1:
        return [f"Probabilities at the sensor farthest up ({first}) are not shown; --at asks for it."]
    which = f"{len(places)} sensors farther up ({first}, to {last})"
    return [f"Probabilities at {which} are not shown; --at asks for them."]


def _at(place: dict[str, Any]) -> str:
    """A named place in a sentence."""
    name = "the reference" if place["name"] == "reference" else place["name"]
    told = f"{chance(place['reached'])} reach {name} (s = {place['s_m']:.0f} m)"
    if "annual" in place["reached"]:
        told += f", a year {chance(place['reached']['annual'])}"
    for quantity, words in (("speed", "faster than"), ("pressure", "with an impact pressure above")):
        unit, above = place[quantity]["unit"], place[quantity]["above"]
        told += "".join(f"; {chance(row)} {words} {row['threshold']:g} {unit}" for row in above)
    return f"{told}."


def _frequency(document: dict[str, Any]) -> str:
    """What makes probabilities for an avalanche into those for a year."""
    rate = document["rate"]
    if rate is None:
        return (
            "Probabilities are per avalanche like those recorded, not per year: the recordings do not say how"
            " often avalanches occur."
        )
    sd = ", taken as exact because no standard deviation was given"
    if rate["sd_per_year"]:
        sd = f" with a standard deviation of {rate['sd_per_year']:g}"
    return (
        f"Probabilities in a year take your frequency of {rate['per_year']:g} avalanches a year{sd}; the"
        " recordings do not know it. It must be that of avalanches like those recorded, which are a"
        " selection: with a frequency of all avalanches, the small ones included, return periods come out"
        " too short."
    )


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
        _frequency(document),
        "Recorded avalanches are a selection: they went far enough to reach the instruments. The prediction"
        f" does not correct for that.{_outside(document)}",
        f"Probabilities below about {percent(1.0 / campaign['n_events'])} (1 in {campaign['n_events']}) and"
        " values outside the recorded range are extrapolations. They rest on the law and on parameters that"
        " are log-normal across avalanches.",
        f"Intervals are {document['interval']['kind']} and hold"
        f" {100 * document['interval']['probability']:.0f} % of the posterior probability if the law is"
        " right. They do not allow for an error of the law itself.",
    ]
    if document["at"]:
        (light, heavy), (low, high) = (document["pressure"][k] for k in ("density_kg_m3", "drag_coefficient"))
        sentences.append(
            f"Impact pressure is {document['pressure']['formula']}, with a density of"
            f" {ranged(light, heavy, 'kg/m3')}, and a drag coefficient of {ranged(low, high)}. The recordings"
            " hold no pressure: these are assumptions, and an engineer chooses them for the obstacle."
        )
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
        f" Of the predicted ones, {chance(above)} stop above the shortest recorded runout"
        f" (s = {low:.0f} m) and {chance(longest)} run beyond the longest (s = {high:.0f} m)."
    )


def _end_or(value: float, length: float) -> str:
    return f"at least {length:.0f}" if value >= length else f"{value:.0f}"


def _from_reference(offset: float) -> str:
    return f"{abs(offset):.0f} m {'beyond' if offset >= 0 else 'above'} the reference"
