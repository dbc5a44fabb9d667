"""Screening: the evidence of every candidate at every place, well enough to say where to look closer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from skred.diagnosis.clock import Progress
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import NEAR, Base, Curve, curve_at, curve_near, followed
from skred.diagnosis.evidence.event_quadrature import SCREENING
from skred.diagnosis.evidence.global_start import Start, first_strengths, global_starts
from skred.diagnosis.evidence.tolerance import COUNTS, DECIDES_NOTHING
from skred.physics.mechanisms.placed import PlacedMechanism


def curve(base: Base, candidate: PlacedMechanism) -> Curve:
    """Evidence along the strength of a mechanism: where global climbs begin, and about where they lead."""
    extension, either_sign = base.extended(candidate.direction), candidate.added.either_sign
    given = base.rows, base.strengths, base.fit.start, candidate.scale, either_sign
    return curve_about(base, candidate, global_starts(extension, *given))


def whole_curve(base: Base, candidate: PlacedMechanism) -> Curve:
    """As `curve`, and closer to where there is evidence: it can have its maximum between two strengths."""
    found = curve(base, candidate)
    has_some = found.log_evidence.max() > DECIDES_NOTHING
    return curve_near(base, found, candidate.shape) if has_some else found


def curve_about(base: Base, candidate: PlacedMechanism, starts: Sequence[Start]) -> Curve:
    """Evidence along the strength of a mechanism where climbs begin, and about where some have led.

    Many recordings tell strengths far below the prior's scale, or far beyond what a refit from the base law
    reaches; strengths over the prior alone would miss where the evidence is.
    """
    scale, either_sign = candidate.scale, candidate.added.either_sign
    begin = {0.0: base.fit} | {one.strength: one.fit for one in starts if one.strength != 0.0}
    about = np.array([one.strength + one.sd * by for one in starts for by in NEAR[1::2]])
    strengths = np.append(first_strengths(scale, either_sign), about)
    if not either_sign:
        strengths = strengths[strengths > 0.0]
    return followed(base, curve_at(base, candidate, np.unique(strengths), SCREENING, begin=begin), SCREENING)


def screened(
    base: Base,
    pool: ThreadPoolExecutor,
    progress: Progress = lambda done, of: None,
    before: Sequence[Curve] = (),
) -> list[Curve]:
    """A curve for each candidate.

    Under another error model only places are looked at that may count: each mechanism's best ones, and
    others once these have fallen behind.

    Parameters
    ----------
    progress : callable
        Is told how many candidates are screened, and of how many.
    before : sequence of Curve, optional
        Screened under another error model: the candidates. Those that cannot count are returned as they are.
    """
    todo: Sequence[PlacedMechanism] = before or placed_mechanisms(base.setting)
    curves, looked = dict(enumerate(before)), set[int]()
    base.with_nothing(SCREENING)  # before every worker does it once more
    while jobs := sorted(set(_that_count(curves) if curves else range(len(todo))) - looked):
        looked |= set(jobs)
        found = pool.map(partial(whole_curve, base), [todo[number] for number in jobs])
        for done, (number, one) in enumerate(zip(jobs, found, strict=True), start=1):
            curves[number] = one
            progress(len(todo) - len(jobs) + done, len(todo))
    return [curves[number] for number in range(len(todo))]


def _that_count(curves: Mapping[int, Curve]) -> list[int]:
    """Numbers of the curves that are not far behind their mechanism's best."""
    best: dict[str, float] = {}
    for one in curves.values():
        best[one.mechanism.id] = max(one.log_bayes_factor, best.get(one.mechanism.id, -math.inf))
    return [
        number for number, one in curves.items() if one.log_bayes_factor > best[one.mechanism.id] - COUNTS
    ]
