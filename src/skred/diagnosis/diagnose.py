"""The diagnosis, step by step: what can be told, is anything wrong, where, what, model it, show it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.augment.problem import CLAIM_LIMIT, AugmentedProblem
from skred.diagnosis.augment.reference import Reference
from skred.diagnosis.check.bootstrap_test import BootstrapTest, bootstrap_test
from skred.diagnosis.clock import Clock, Tell
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.compare.decision import Decision, alarmed, decide
from skred.diagnosis.compare.location import Location, locate
from skred.diagnosis.detect.detectability import Identifiability, identify
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.coefficient import Base, Curve, fit_base
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.extension import Extension, extended
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.predict.held_out import HeldOut, held_out
from skred.diagnosis.predict.profile_law import ProfileLaw, profile_law
from skred.inference.calibrate import Calibration, calibrate_surely
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.problem import COARSER, HierarchicalProblem
from skred.inference.sampling import SamplerSettings
from skred.physics.law import Law
from skred.physics.mechanisms.stretches import is_opposed

FloatArray = NDArray[np.float64]
LEAST_EVENTS = 6
LEAST_SENSORS = 2


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    Attributes
    ----------
    replicas : int
        Clean campaigns simulated at most for each check.
    max_mechanisms : int
        1 or 2.
    exact_loo : bool
        Refit without every event.
    """

    replicas: int = 120
    max_mechanisms: int = 2
    exact_loo: bool = False


QUICK_REPLICAS = 100
RACE_AGAIN = 0.2
"""P-value of the augmented law's check below which a second mechanism is looked for.

The check sees little of a second one beside the first; the alarm is raised by the same rule as for the first.
"""


@dataclass(frozen=True, eq=False)
class Step:
    """One mechanism let in.

    Attributes
    ----------
    candidate : Candidate
        The one let in.
    tied : tuple of str
        Ids that the recordings cannot tell from it.
    comparison : Comparison
        In which it won.
    calibration : Calibration
        Of the augmented law.
    check : BootstrapTest
        The omnibus check of the augmented law.
    """

    candidate: Candidate
    tied: tuple[str, ...]
    comparison: Comparison
    calibration: Calibration
    check: BootstrapTest


@dataclass(frozen=True)
class Left:
    """What a last comparison, of the augmented law, found and did not let in.

    Attributes
    ----------
    comparison : Comparison or None
        None where no such comparison was run.
    reason : str
        Why what it would name was not let in, where it would name something.
    """

    comparison: Comparison | None = None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a diagnosis found.

    Attributes
    ----------
    problem, law :
        What was asked about.
    cannot : str
        Why no diagnosis was possible, empty if one was; what follows is None as far as it did not get there.
    calibration : Calibration
        Of the base law.
    score_test : ScoreTest
    table : Identifiability
    check : BootstrapTest
    comparison : Comparison
    decision : Decision
    location : Location
    steps : tuple of Step
    reference : Calibration
        Of the base law under the error model of the last step, where something was let in: before and after
        then differ by what was let in alone. The same as `calibration` where that error model is its own.
    profile : ProfileLaw
        The force profile let in, where no listed mechanism accounts for what is missing.
    before, after : HeldOut
        Predictions by the base law and, where something was let in, by the law with it.
    left : Left
    seconds : dict
        Of each stage.
    """

    problem: HierarchicalProblem
    law: Law
    cannot: str = ""
    calibration: Calibration | None = None
    score_test: ScoreTest | None = None
    table: Identifiability | None = None
    check: BootstrapTest | None = None
    comparison: Comparison | None = None
    decision: Decision = Decision("cannot_tell", ())
    location: Location | None = None
    steps: tuple[Step, ...] = ()
    reference: Calibration | None = None
    profile: ProfileLaw | None = None
    before: HeldOut | None = None
    after: HeldOut | None = None
    left: Left = Left()
    seconds: dict[str, float] = field(default_factory=dict)


def too_little(problem: HierarchicalProblem) -> str:
    """Why a campaign holds too little for a diagnosis; empty if it does not."""
    seen = problem.observed
    n_events = int(seen.any(axis=1).sum())
    if n_events < LEAST_EVENTS:
        return f"only {n_events} avalanches with a reading; at least {LEAST_EVENTS} are needed"
    n_sensors = int((seen.sum(axis=0) >= 2).sum())
    if n_sensors < LEAST_SENSORS:
        return f"only {n_sensors} sensor with readings of two avalanches or more; at least {LEAST_SENSORS}"
    return ""


def diagnose(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    effort: Effort,
    tell: Tell = lambda line: None,
) -> Diagnosis:
    """Diagnose a base law on a campaign; where the numerics break down that is an answer, and told."""
    clock = Clock(tell)
    reason = too_little(problem)
    if reason:
        return Diagnosis(problem, law, cannot=reason)
    try:
        # A diagnosis has its own threads: those of matrix products, small as these are, get in their way.
        with threadpool_limits(1, user_api="blas"):
            return _steps(problem, law, settings, effort, clock)
    except np.linalg.LinAlgError as error:
        clock.end()
        why = f"the numerics broke down in {list(clock.seconds)[-1]!r}: {error}"
        return Diagnosis(problem, law, why, seconds=clock.seconds)


def _steps(
    problem: HierarchicalProblem, law: Law, settings: SamplerSettings, effort: Effort, clock: Clock
) -> Diagnosis:
    """All steps of a diagnosis."""
    clock.stage("base", f"{law.id}: calibrating the base law")
    calibration = calibrate_surely(as_diagnosed(problem), law, settings)
    problem = _problem_of(calibration)
    if not calibration.gate.passed:
        clock.end()
        why = "the gate of the base law's calibration failed: " + "; ".join(calibration.gate.problems)
        return Diagnosis(problem, law, why, calibration, seconds=clock.seconds)
    draws = population_draws(calibration, effort.replicas, settings.seed)
    base = fit_base(problem, law, typical(draws))
    score_test = ScoreTest(problem, law, base.setting)
    clock.stage("identify", "what these recordings can tell")
    start = (base.population, base.fit.points)
    table = identify(score_test, base.rows, base.fit.points, base.population)
    clock.stage("check", "is anything wrong: clean campaigns simulated and refitted")
    check = bootstrap_test(score_test, base.rows, start, draws, settings.seed, effort.replicas)
    clock.stage("comparison", "what is missing: every candidate refitted")
    raced = compare(base)
    decision = decide(raced.probability, check.p_value, table.can_tell)
    location = _location(raced, decision) if alarmed(raced.probability, check.p_value) else None
    steps, reference, cannot, left = tuple[Step, ...](), calibration, "", Left()
    references = Reference(calibration)
    if decision.names:
        clock.stage("augment", f"{law.id} + {decision.names[0]}: calibrating the augmented law")
        steps, cannot, left = add_mechanisms(base, raced, decision, references, settings, effort, clock)
    if steps:
        reference, cannot = references.on(_base_of(steps[-1]))
        steps = steps if not cannot else ()
    if cannot:
        decision = Decision("cannot_tell", ())
    profile = None
    if decision.verdict == "unexplained":
        clock.stage("profile", "the force profile let in: checked again, fitted anew without each avalanche")
        profile = profile_law(raced.leading(UNLISTED), effort.replicas, settings.seed)
    clock.stage("held out", "predicting avalanches left out")
    before = profile.before if profile is not None else _before(reference, settings.seed, effort)
    after = profile.after if profile is not None else _after(steps, settings.seed, effort)
    clock.end()
    return Diagnosis(
        problem, law, cannot, calibration, score_test, table, check, raced, decision, location, steps,
        reference, profile, before, after, left, clock.seconds,
    )  # fmt: skip


def as_diagnosed(problem: HierarchicalProblem) -> HierarchicalProblem:
    """How a base law's recordings are integrated: what a claim rests on is computed apart from that."""
    return replace(problem, integration_limit=CLAIM_LIMIT, fineness=COARSER)


def _location(raced: Comparison, decision: Decision) -> Location:
    """Where: of what is named the profile that goes with speed as that does, else the most probable."""
    under_errors = raced.leading(UNLISTED)
    if not decision.names:
        return locate(under_errors)
    return locate(
        under_errors, is_opposed(raced.leading(decision.names[0]).candidates[decision.names[0]].best.shape)
    )


def _problem_of(calibration: Calibration) -> HierarchicalProblem:
    """What a base law was calibrated on: perhaps finer than was asked for."""
    problem = calibration.problem
    assert isinstance(problem, HierarchicalProblem)
    return problem


def _base_of(step: Step) -> HierarchicalProblem:
    """What a step's law was calibrated on, without what was let in."""
    problem = step.calibration.problem
    assert isinstance(problem, AugmentedProblem)
    return problem.base.problem


def population_draws(calibration: Calibration, n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Means and factors of populations from a posterior, drawn at random without replacement."""
    posterior = calibration.tree["posterior"].to_dataset()
    names = [parameter.name for parameter in calibration.problem.parameters(calibration.law)]
    samples = {name: posterior[name].transpose("chain", "draw").values.ravel() for name in names}
    means, factors = population_of(calibration.law, samples)
    chosen = np.random.default_rng([seed, 41]).choice(len(means), size=min(n, len(means)), replace=False)
    return means[chosen], factors[chosen]


def typical(draws: tuple[FloatArray, FloatArray]) -> Population:
    """Roughly the middle of a posterior of populations."""
    means, factors = draws
    covariance = np.einsum("gij,gkj->gik", factors, factors)
    return Population(means.mean(axis=0)[None], np.median(covariance, axis=0)[None])


def _nothing_added(calibration: Calibration) -> FloatArray:
    sizes = calibration.tree["posterior"].to_dataset().sizes
    return np.empty((sizes["chain"] * sizes["draw"], 0))


def add_mechanisms(
    base: Base,
    raced: Comparison,
    decision: Decision,
    references: Reference,
    settings: SamplerSettings,
    effort: Effort,
    clock: Clock,
) -> tuple[tuple[Step, ...], str, Left]:
    """Let the winner in, check again, and a second one only if it earns it given the first.

    Returns no steps, and why, where the winner's own calibration fails its gate; and what is left.
    """
    steps: list[Step] = []
    cannot, left = "", Left()
    names, chosen = decision.names, list[Curve]()
    for number in range(effort.max_mechanisms):
        under_errors = raced.leading(names[0])
        candidate = under_errors.candidates[names[0]]
        chosen.append(candidate.best)
        references.begin(under_errors.base.problem)
        problem = augmented_problem(_plain(under_errors.base), chosen)
        # Its chains start around the posterior: half the tuning does.
        calibration = calibrate_surely(problem, base.law, replace(settings, tune=settings.tune // 2))
        if not calibration.gate.passed:
            problems = "; ".join(calibration.gate.problems)
            cannot = f"the gate of {base.law.id} + {names[0]} failed: {problems}"
            left = replace(left, reason=cannot) if steps else left
            break
        clock.stage("check again", "is anything wrong with the augmented law")
        check, next_base = _check_again(under_errors.base, calibration, problem, chosen, settings, effort)
        steps.append(Step(candidate, names[1:], raced, calibration, check))
        left = Left()
        if check.p_value > RACE_AGAIN or number + 1 == effort.max_mechanisms:
            break
        clock.stage("second comparison", "something may be left: every candidate refitted again")
        raced = compare(next_base)
        left = Left(raced)
        second = decide(raced.probability, check.p_value, True)
        if not second.names:
            break
        names = second.names
        clock.stage("augment", f"calibrating with {names[0]} as well")
    return tuple(steps), "" if steps else cannot, left


def _plain(base: Base) -> Base:
    """The base law without what was let in before: the augmented problem holds that itself."""
    return replace(base, directions=(), strengths=np.empty(0))


def _check_again(
    base: Base,
    calibration: Calibration,
    problem: AugmentedProblem,
    chosen: list[Curve],
    settings: SamplerSettings,
    effort: Effort,
) -> tuple[BootstrapTest, Base]:
    """The omnibus check of the augmented law, and that law as a base for another comparison."""
    directions = tuple(one.direction for one in chosen)
    strengths = _added(calibration).mean(axis=0)
    draws = population_draws(calibration, effort.replicas, settings.seed + 1)
    again = fit_base(base.problem, base.law, typical(draws), base.fit.points, directions, strengths)
    setting = replace(again.setting, base=(*base.setting.base, *_global_ids(chosen)))
    again = replace(again, setting=setting)
    score_test = ScoreTest(base.problem, base.law, setting, directions, strengths)
    start = (again.population, again.fit.points)
    check = bootstrap_test(score_test, again.rows, start, draws, settings.seed + 1, effort.replicas)
    return check, again


def _global_ids(chosen: list[Curve]) -> list[str]:
    """Ids of mechanisms that act alike everywhere: they cannot be missing a second time."""
    return [one.mechanism.id for one in chosen if one.shape.place_m is None]


def _added(calibration: Calibration) -> FloatArray:
    """Draws of the added strengths, (n_draws, n_added)."""
    problem = calibration.problem
    assert isinstance(problem, AugmentedProblem)
    posterior = calibration.tree["posterior"].to_dataset()
    columns = [posterior[one.name].transpose("chain", "draw").values.ravel() for one in problem.added]
    return np.column_stack(columns)


def _before(reference: Calibration, seed: int, effort: Effort) -> HeldOut:
    problem: Any = reference.problem
    extension = extended(problem, reference.law)
    return held_out(reference, extension, _nothing_added(reference), seed, exact=effort.exact_loo)


def _after(steps: tuple[Step, ...], seed: int, effort: Effort) -> HeldOut | None:
    if not steps:
        return None
    calibration = steps[-1].calibration
    problem: Any = calibration.problem
    extension: Extension = problem.extension
    return held_out(calibration, extension, _added(calibration), seed, exact=effort.exact_loo)
