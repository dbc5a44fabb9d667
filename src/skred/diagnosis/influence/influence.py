"""How far an answer hangs on few recordings: its evidence again without each avalanche, each kind of reading.

Of a single avalanche no refit is needed: evidence is what all others have, times the density of this one
given them. So the Bayes factor without it is that of all, less what it is predicted better with the answer
(nearly, where many are left out in parts). Without several, or without a kind of reading, population and
every avalanche are refitted to what is left, with the named mechanism's leading shapes, or with the whole
profile. Nothing is looked for again: the question is whether what was answered would still
stand. It does not where the odds would not suffice for it, or where its rival, the id that is most
probable of those it is not tied with, would be more probable. Where a mechanism has much of its evidence
together with a force in no list, so it is held against its rival. Of a speed that is left out it stays known
that the front came there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.compare.between import or_none, searched
from skred.diagnosis.compare.candidate import Candidate, all_but_place, with_or_without
from skred.diagnosis.compare.comparison import Comparison, ComparisonUnderErrors
from skred.diagnosis.compare.residue import fit_beside
from skred.diagnosis.compare.ways import gains_of, over_ways
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Profile, most_probable
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import USUAL, event_nodes
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.prior_odds import NOTHING, POWER, UNLISTED
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.influence.margin import Change, Margin
from skred.diagnosis.influence.part import Part, kinds_of
from skred.parallel.processes import worker_pool


@dataclass(frozen=True)
class ReadingsLeftOut:
    """The evidence without some of the readings.

    Attributes
    ----------
    kind : str
        ``zeros``, ``near a stop``, or ``sensor``.
    sensor : str or None
        Which one, where it is a sensor's.
    n : int
        How many readings were left out.
    log_bayes_factor : float
    """

    kind: str
    sensor: str | None
    n: int
    log_bayes_factor: float


@dataclass(frozen=True)
class Few:
    """The fewest avalanches, at most a third of them, without which something does not hold.

    They are looked for in the order of what each one takes by itself.

    Attributes
    ----------
    events : tuple of str
    left : float
        Without them: the log Bayes factor of the answer, or nats as `Rival.ahead`.
    """

    events: tuple[str, ...]
    left: float


@dataclass(frozen=True)
class Rival:
    """The most probable id that an answer is not tied with.

    Attributes
    ----------
    id : str
    ahead : float
        Nats of its log Bayes factor that the answer can lose against this one before both are as probable.
    few : Few or None
        Avalanches without which this one is more probable.
    """

    id: str
    ahead: float
    few: Few | None


@dataclass(frozen=True, eq=False)
class Influence:
    """What the leading answer hangs on.

    Attributes
    ----------
    answer : str
        Id of a mechanism, or ``unlisted``.
    log_bayes_factor : float
        Against nothing, by all recordings.
    needed : float
        Log Bayes factor that it needs for an alarm, if whatever else may be missing falls with it.
    events : tuple of str
    without_each : (n_events,) array
        Log Bayes factor without each avalanche.
    few : Few or None
        Avalanches without which it has less than it needs.
    without_them : float or None
        Log Bayes factor without those that carry the answer.
    without_a_third : float
        Log Bayes factor without the third of the avalanches that take most of it.
    readings : tuple of ReadingsLeftOut
    rival : Rival or None
        None where there is no such id under the same error model, or it could not be refitted.
    """

    answer: str
    log_bayes_factor: float
    needed: float
    events: tuple[str, ...]
    without_each: FloatArray
    few: Few | None
    without_them: float | None
    without_a_third: float
    readings: tuple[ReadingsLeftOut, ...]
    rival: Rival | None = None

    @property
    def carried_by(self) -> tuple[str, ...]:
        """The fewest avalanches without which the answer would not be given; none where they are many."""
        return _fewest(self.few, self.rival)


def influence(
    comparison: Comparison, answer: str, gained: FloatArray, enough: float, tied: Collection[str] = ()
) -> Influence:
    """What an answer of a comparison hangs on, under the error model that it has most evidence under.

    Parameters
    ----------
    answer : str
        Id of a mechanism that was compared, or ``unlisted``.
    gained : (n_events,) array
        Log predictive density of each avalanche given the others with the answer, less that without it.
    enough : float
        Log odds of anything against nothing that raise an alarm.
    tied : collection of str
        Ids that recordings cannot tell from the answer.
    """
    under_errors = comparison.leading(answer)
    base, stated = under_errors.base, under_errors.factors(lambda one: one.by_itself)[answer]
    # What is tied with the answer explains the same recordings: without some of them it falls as much.
    needed = max(stated - (comparison.log_odds - enough), 0.0)
    kinds, ids = kinds_of(base), base.problem.campaign.event_ids
    parts = [Part(np.ones(len(gained), dtype=bool), chosen) for _, _, chosen in kinds]
    with worker_pool() as pool, ThreadPoolExecutor(1) as waiting:
        own = Change(_again(under_errors, answer, beside=False), pool)
        # Without the rival, if refits beside a force lead to what no front can do.
        against = waiting.submit(or_none, _rival, comparison, answer, tied, gained, own)
        margin = Margin(stated - needed, gained, own)
        third, *without = (needed + margin.left_by([margin.without_third, *parts])).tolist()
        few = _few(ids, margin.fewest(), needed)
        rival = against.result()
        carriers = _fewest(few, rival)
        left = margin.left_by([Part(~np.isin(ids, carriers))]) if carriers else None
    return Influence(
        answer,
        stated,
        needed,
        tuple(ids),
        stated - gained,
        few,
        None if left is None else needed + float(left[0]),
        third,
        tuple(
            ReadingsLeftOut(kind, sensor, int(chosen.sum()), factor)
            for (kind, sensor, chosen), factor in zip(kinds, without, strict=True)
        ),
        rival,
    )


def _fewest(few: Few | None, rival: Rival | None) -> tuple[str, ...]:
    """The avalanches of the smaller one of two sets; none where there is neither."""
    found = [few, None if rival is None else rival.few]
    return min((one.events for one in found if one is not None), key=len, default=())


def _few(ids: Sequence[str], found: tuple[BoolArray, float] | None, needed: float) -> Few | None:
    """Avalanches by name, with what is left without them."""
    if found is None:
        return None
    chosen, margin = found
    return Few(tuple(one for one, carries in zip(ids, chosen, strict=True) if carries), needed + margin)


def _rival(
    comparison: Comparison, answer: str, tied: Collection[str], gained: FloatArray, own: Change
) -> Rival | None:
    """The most probable id that an answer is not tied with, and how far that is."""
    under_errors, shares = comparison.leading(answer), comparison.probability
    others = [name for name in under_errors.log_factors if name not in {answer, NOTHING, *tied}]
    if not others:
        return None
    name = max(others, key=lambda one: shares[one])
    first = under_errors.candidates.get(answer)
    with_force = first is not None and first.residue is not None
    margin = Margin(
        _ahead(comparison, answer, name),
        gained - _gained(under_errors, name),
        Change(_again(under_errors, answer, beside=True), own.pool) if with_force else own,
        Change(_again(under_errors, name, beside=True), own.pool),
    )
    ids = under_errors.base.problem.campaign.event_ids
    return Rival(name, margin.whole, _few(ids, margin.fewest(), 0.0))


def _ahead(comparison: Comparison, answer: str, rival: str) -> float:
    """Nats of its log Bayes factor that an answer can lose before another id is as probable."""
    factors, odds = comparison.log_factors, comparison.odds
    return factors[answer] - factors[rival] + math.log(odds[answer] / odds[rival]) / POWER


def _again(under_errors: ComparisonUnderErrors, name: str, *, beside: bool) -> Callable[[Part], float]:
    """What computes an id's log Bayes factor by a part of the recordings.

    Parameters
    ----------
    beside : bool
        Whether a mechanism has a force in no list beside it, as far as that is probable.
    """
    if name == UNLISTED:
        return partial(_by_profile, most_probable(under_errors.profiles), under_errors.base)
    candidate = under_errors.candidates[name]
    chosen = candidate if beside else replace(candidate, residue=None)
    return partial(_by_mechanism, chosen, under_errors.base)


def _gained(under_errors: ComparisonUnderErrors, name: str) -> FloatArray:
    """What each avalanche's log integral gains by an id at its best, where all is fitted."""
    base = under_errors.base
    if name == UNLISTED:
        profile = most_probable(under_errors.profiles)
        extension, strengths, fit = base.extended(*profile.kind.each(base.setting)), profile.mean, profile.fit
    else:
        best = under_errors.candidates[name].best
        strength, fit = best.top
        extension, strengths = base.extended(best.direction), np.array([strength])
    with_it = _log_integrals(extension, base, np.append(base.strengths, strengths), fit)
    return with_it - _log_integrals(base.extended(), base, base.strengths, base.fit)


def _log_integrals(extension: Extension, base: Base, strengths: FloatArray, fit: Fit) -> FloatArray:
    """Of each avalanche over the most probable population."""
    likelihood = EventLikelihood(extension, base.rows, strengths)
    modes = event_modes(likelihood, fit.points, fit.population)
    return event_nodes(likelihood, fit.population, modes).log_integrals(fit.population, base.rows)


def _by_mechanism(candidate: Candidate, base: Base, part: Part) -> float:
    """The log Bayes factor of a mechanism by a part of the recordings.

    With a force in no list beside it, as far as it is probable then, if it has one.
    """
    (in_common, by_itself), beside = _by_shapes(candidate, base, part), candidate.beside
    if candidate.residue is None or beside is None:
        return by_itself
    rest, force = part.base(base), most_probable(beside.profiles)
    curve = _without(rest, beside.curve, beside.curve.strengths, part)
    both = fit_beside(rest, curve, -math.inf, force.kind, force.prior).log_bayes_factor
    return with_or_without(by_itself, in_common + both - curve.log_bayes_factor)


def _by_shapes(candidate: Candidate, base: Base, part: Part) -> tuple[float, float]:
    """The log Bayes factor of a mechanism by itself, with a strength in common and over all ways to differ.

    By a part of the recordings, over its shapes that may count.
    All strengths are refitted at the best shape. The others follow the evidence at their best strength, and
    by as much more as the best one does over all of its own.
    """
    factors, best = candidate.log_factors, candidate.best
    rest, of_kind, others = part.base(base), list[float](), list[float]()
    at_best = _without(rest, best, best.strengths, part)
    over_strengths = at_best.log_bayes_factor - best.log_bayes_factor - _change(best, at_best)
    for k, curve in enumerate(candidate.curves):
        if factors[k] <= factors.max() - COUNTS and curve is not best:
            continue
        one = at_best if curve is best else _without(rest, curve, np.array([curve.top[0]]), part)
        own = of_kind if all_but_place(curve) == all_but_place(best) else others
        changed = _change(curve, one) + over_strengths
        own.append(candidate.log_weights[k] + curve.log_bayes_factor + changed)
    gain = 0.0
    if candidate.looked:
        ways = or_none(searched, rest, at_best)
        gain = 0.0 if ways is None else over_ways(gains_of(ways, at_best.log_factor_of(at_best.sign)))
    # What another kind of shape gains where avalanches differ is not known for a part, and not counted.
    same = np.logaddexp.reduce(of_kind)
    in_common, differing = (float(np.logaddexp.reduce([*others, same + more])) for more in (0.0, gain))
    return in_common, differing


def _without(rest: Base, curve: Curve, strengths: FloatArray, part: Part) -> Curve:
    """Evidence by a part of the recordings, at some strengths and at nil."""
    known = {strength: part.fit(fit) for strength, fit in curve.known.items()}
    return curve_at(rest, curve, strengths, USUAL, known)


def _change(curve: Curve, without: Curve) -> float:
    """By how many nats the evidence at the best strength by all recordings changes by a part of them."""
    at_it = without.strengths == curve.top[0]
    return float(without.log_evidence[at_it][0] - curve.log_evidence.max())


def _by_profile(profile: Profile, base: Base, part: Part) -> float:
    """The log Bayes factor of a profile by a part of the recordings."""
    near = profile.mean, part.fit(profile.fit).start
    return fit_profile(part.base(base), profile.kind, near, profile.prior).log_bayes_factor
