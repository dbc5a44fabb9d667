"""What a campaign's recordings can tell, without sampling, as identify.json holds it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from skred.diagnosis.clock import Tell
from skred.diagnosis.detect.detectability import Detectability, Identifiability, identify
from skred.diagnosis.detect.too_little import too_little
from skred.diagnosis.evidence.coefficient import Base, fit_base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, campaign_rows
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import fit_population, mean_prior, starting_population
from skred.diagnosis.words import no_room, percent, prior_note
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.output import write_json
from skred.physics.law import Law

FILE = "identify.json"


def identify_to(
    problem: HierarchicalProblem, law: Law, folder: Path, tell: Tell = lambda line: None
) -> dict[str, Any]:
    """What the recordings can tell of a law, written to identify.json, and the content of that.

    Its ``reason`` says why it tells nothing, where it does not.
    """
    reason = too_little(problem)
    table = None
    if not reason:
        tell(f"{law.id}: fitting the population of avalanches")
        base = base_of(problem, law)
        tell("what these recordings can tell")
        table = identify(base)
    document = identify_document(problem, law, table, reason)
    write_json(folder / FILE, document)
    return document


def base_of(problem: HierarchicalProblem, law: Law) -> Base:
    """A law with its most probable population, from a wide one, without sampling."""
    extension, population = extended(problem, law), starting_population(law)
    rows = campaign_rows(extension)
    points = np.zeros((len(rows.event), len(law.mechanisms) + 1))
    points[:, :-1] = population.mean[0]
    likelihood = EventLikelihood(extension, rows, np.empty(0))
    start = fit_population(likelihood, mean_prior(law), (population, points))
    return fit_base(problem, law, *start)


def identify_document(
    problem: HierarchicalProblem, law: Law, table: Identifiability | None, reason: str = ""
) -> dict[str, Any]:
    """The content of identify.json; every key is there, null where it does not apply."""
    campaign = problem.campaign
    rows = [] if table is None else [_row(told) for told in table.rows]
    document: dict[str, Any] = {
        "campaign": {
            "name": campaign.name,
            "fingerprint": campaign.fingerprint(),
            "n_events": campaign.n_events,
            "n_sensors": campaign.n_sensors,
        },
        "base_model": law.id,
        "equation": law.equation,
        "changed_priors": dict(law.changed_priors),
        "error_model": problem.error_model.id,
        "smoothing_m": problem.terrain.smoothing_m,
        "reason": reason or None,
        "identifiability": rows,
        "power": None if table is None else table.power,
        "can_tell": None if table is None else table.can_tell,
        "next_sensor": _next_sensor(table) if table is not None and table.more_with_sensor else None,
    }
    document["statement"] = [*filter(None, [prior_note(law)]), *_statement(document)]
    if table is not None and table.lacks_room:
        document["statement"].append(no_room())
    return document


def _row(told: Detectability) -> dict[str, Any]:
    mechanism = told.mechanism
    named = {"title": mechanism.title, "group": str(mechanism.group), "parameter": mechanism.strength.name}
    return told.as_dict() | named


def _next_sensor(table: Identifiability) -> dict[str, Any]:
    return {
        "quantity": "front_velocity",
        "s_from_m": table.sensor_m,
        "s_to_m": table.sensor_m,
        "power_with": table.power_with,
    }


def _statement(document: dict[str, Any]) -> list[str]:
    if document["reason"] is not None:
        return [f"These recordings cannot tell: {document['reason']}."]
    silence = "would mean something" if document["can_tell"] else "would mean little"
    sentences = [
        "A relevant strength of the listed physics would be found, on average, in"
        f" {percent(document['power'])} of cases: silence {silence}."
    ]
    unseen = [row["id"] for row in document["identifiability"] if row["best_limit"] is None]
    if unseen:
        sentences.append(f"These recordings say nothing of: {', '.join(unseen)}.")
    alike = [
        f"{row['id']} from {', '.join(row['alike'])}" for row in document["identifiability"] if row["alike"]
    ]
    if alike:
        sentences.append(f"Not to be told apart, where each is seen best: {'; '.join(alike)}.")
    sensor = document["next_sensor"]
    if sensor is not None:
        sentences.append(
            f"One more speed, at s = {sensor['s_from_m']:.0f} m, would raise that to"
            f" {percent(sensor['power_with'])}."
        )
    return sentences
