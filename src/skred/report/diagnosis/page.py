"""The page of a diagnosis: what its template is given."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.diagnosis.augment.coefficient import strength_of
from skred.diagnosis.check.bootstrap_test import LIMIT
from skred.diagnosis.compare.decision import NOTHING_ALONE, TIED_NATS, decide
from skred.diagnosis.discrepancy.profile import AMPLITUDES, KINDS, LENGTHS_M, NEAR_M
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.predict.held_out import K_LIMIT, paired
from skred.inference.gate import ESS_LIMIT, R_HAT_LIMIT
from skred.inference.intervals import PRACTICAL_DIFFERENCE
from skred.physics.mechanisms import mechanisms
from skred.report.comparison.html import environment, picture
from skred.report.diagnosis import rows, unseen
from skred.report.diagnosis.equation import equations, parameter_rows, symbol_rows
from skred.report.diagnosis.words import (
    comparisons,
    leading_name,
    profile_of,
    short_title,
    stretch_of,
    verdict_words,
)
from skred.report.shared import document as doc
from skred.report.shared.labels import unit_text
from skred.report.shared.numbers import fixed

if TYPE_CHECKING:
    from skred.diagnosis.compare.location import Location
    from skred.report.diagnosis.flat import Flat as Diagnosis

_NO_FORCE = 1e-6
"""Retardation that is none [m s-2]."""
_SECTIONS = {
    "recorded": "What was recorded",
    "can-tell": "What these recordings can tell",
    "wrong": "Is anything wrong?",
    "where": "Where?",
    "what": "What?",
    "equation": "The equation with its new term",
    "before-after": "Before and after",
    "unseen": "Avalanches set aside",
    "trust": "How far to trust it",
}


def page(found: Diagnosis, document: doc.Document, figures: Mapping[str, Path]) -> str:
    """Render the report of a diagnosis, see `skred.report.diagnosis.report.render_diagnosis`."""
    campaign = found.problem.campaign
    sections = dict(_SECTIONS)
    if not found.steps and found.profile is None:
        sections["equation"] = "The equation"
        sections["before-after"] = "How well avalanches left out are predicted"
    locked, folds = unseen.locked(document), unseen.outer_folds(document)
    if locked is None and folds is None:
        del sections["unseen"]
    return (
        environment()
        .get_template("diagnosis.html.jinja")
        .render(
            d=document,
            found=found,
            campaign=campaign,
            sections=sections,
            number={name: place for place, name in enumerate(sections, start=1)},
            figures={name: picture(file) for name, file in figures.items()},
            verdict=verdict_words(found),
            facts=rows.recorded_facts(found),
            sensors=rows.sensor_rows(found),
            detectability=rows.detectability_rows(found),
            work=rows.work_rows(found),
            profile=profile_of(found),
            stretch=stretch_of(found),
            comparisons=[_comparison(found, number, one) for number, one in enumerate(comparisons(found))],
            equations=equations(found),
            symbols=symbol_rows(found),
            parameters=parameter_rows(found),
            held=rows.held_out_rows(found),
            difference=_difference(found),
            locked=locked,
            folds=folds,
            trust=rows.trust_rows(found),
            priors=rows.prior_rows(found),
            settings=rows.settings_rows(document),
            profile_scales=[
                f"{kind.amplitude:g} {unit_text(kind.unit)}"
                + (", nil at the typical speed" if kind.opposed else "")
                for kind in KINDS
            ],
            profile_amplitudes=[f"{part:.2g}" for part in AMPLITUDES],
            profile_lengths=[f"{length:.0f}" for length in LENGTHS_M],
            profile_window=f"{2.0 * NEAR_M:.0f}",
            limits={
                "p": LIMIT, "alone": NOTHING_ALONE, "k": K_LIMIT, "tied": f"{math.exp(TIED_NATS):.1f}",
                "r_hat": R_HAT_LIMIT, "ess": ESS_LIMIT, "practical": PRACTICAL_DIFFERENCE,
            },
            too_few=_too_few(found),
            dropped=_dropped(found),
            flat=_flat(profile_of(found)),
            short_title=short_title,
        )
    )  # fmt: skip


def _comparison(found: Diagnosis, number: int, comparison: Any) -> dict[str, Any]:
    """A comparison, with the ending of its figures' names."""
    step = found.steps[number] if number < len(found.steps) else None
    winner = step.candidate.mechanism if step is not None else None
    ties = step.tied if step is not None else ()
    listed = [mechanisms()[name] for name in ties if name != UNLISTED]
    same = [one.id for one in listed if winner is not None and one.is_same_term(winner)]
    return {
        "ending": f"_{number + 1}" if number else "",
        "rows": rows.comparison_rows(comparison, _strength(found, number)),
        "errors": rows.error_rows(comparison),
        "winner": winner,
        "leading": leading_name(comparison),
        "ties": _in_words(ties),
        "same": same,
    }


def _strength(found: Diagnosis, number: int) -> dict[str, tuple[float, float]]:
    """The strength of what was added from a comparison, by its id."""
    if number >= len(found.steps):
        return {}
    return {found.steps[number].candidate.mechanism.id: strength_of(found.steps, number)}


def _flat(profile: Location | None) -> bool:
    """Whether the free force did not move from nothing."""
    return profile is not None and not bool(np.any(np.abs(profile.mean) > _NO_FORCE))


def _too_few(found: Diagnosis) -> bool:
    """Whether the check cannot reach its limit because too few clean campaigns were simulated."""
    check = found.check
    if check is None or check.fired:
        return False
    n = len(check.simulated)
    return 1.0 / (n + 1) > LIMIT and bool(check.statistic > check.simulated.max(initial=-math.inf))


def _dropped(found: Diagnosis) -> tuple[str, ...]:
    """What the comparison would have named, had its own calibration passed the gate."""
    if found.comparison is None or found.check is None or found.table is None or found.steps:
        return ()
    return _in_words(decide(found.comparison.probability, found.check.p_value, found.table.can_tell).names)


def _in_words(names: tuple[str, ...]) -> tuple[str, ...]:
    """Ids as they are, but for the way out of the list."""
    return tuple("a force not in the list" if name == UNLISTED else name for name in names)


def _difference(found: Diagnosis) -> dict[str, Any] | None:
    """The difference of the log scores, its doubled standard error, and whether it counts."""
    if found.before is None or found.after is None:
        return None
    value, se = paired(found.after, found.before)
    better = found.after.pointwise > found.before.pointwise
    return {
        "value": fixed(value, 1, signed=True),
        "doubled": fixed(2.0 * se, 1),
        "practical": abs(value) >= PRACTICAL_DIFFERENCE,
        "clear": abs(value) > 2.0 * se,
        "better": int(better.sum()),
        "of": len(better),
    }
