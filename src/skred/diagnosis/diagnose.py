"""The diagnosis, step by step: what can be told, is anything wrong, what, where; add it, and try it."""

from __future__ import annotations

from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from skred.arrays import FloatArray
from skred.diagnosis.augment.add import add_mechanisms
from skred.diagnosis.augment.problem import as_diagnosed
from skred.diagnosis.augment.step import Augmented, NotAugmented
from skred.diagnosis.check.bootstrap_test import odds_test
from skred.diagnosis.check.decision import Decision, decide
from skred.diagnosis.clock import Clock, Tell
from skred.diagnosis.compare.between import or_none
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.compare.location import location_of
from skred.diagnosis.detect.detectability import identify
from skred.diagnosis.detect.too_little import too_little
from skred.diagnosis.effort import Effort, Run
from skred.diagnosis.evidence.coefficient import fit_base
from skred.diagnosis.evidence.compile_ahead import compile_ahead
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.influence.influence import influence
from skred.diagnosis.outcome import Diagnosis, Finding, NotDiagnosed, Outcome
from skred.diagnosis.predict.conditional import BeforeAfter
from skred.diagnosis.predict.held_out import HeldOut, gained_by, held_out
from skred.diagnosis.predict.profile_law import ProfileLaw, profile_law
from skred.inference.calibrate import Calibration, calibrate_surely
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.sampling import SamplerSettings
from skred.parallel.processes import meanwhile
from skred.physics.law import Law


def diagnose(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    effort: Effort,
    tell: Tell = lambda line: None,
) -> Outcome:
    """Diagnose a base law on a campaign; where the numerics break down that is an answer, and told."""
    reason = too_little(problem)
    if reason:
        return NotDiagnosed(problem, law, reason, converged=True)
    run = Run(settings, effort, Clock(tell))
    calibration = None
    try:
        # A diagnosis has its own threads: those of matrix products, small as these are, get in their way.
        with threadpool_limits(1, user_api="blas"):
            calibration = _calibrated(problem, law, run)
            return _steps(calibration, run)
    except np.linalg.LinAlgError as error:
        run.clock.end()
        why = f"the numerics broke down in {list(run.clock.seconds)[-1]!r}: {error}"
        return NotDiagnosed(problem, law, why, calibration, seconds=run.clock.seconds)


def _calibrated(asked: HierarchicalProblem, law: Law, run: Run) -> Calibration:
    """The base law, on a problem that is perhaps finer than was asked for."""
    run.clock.stage("base", f"{law.id}: calibrating the base law")
    meanwhile(compile_ahead, asked.readings, asked.error_model)  # where there are workers
    return calibrate_surely(as_diagnosed(asked), law, run.settings)


def _steps(calibration: Calibration, run: Run) -> Outcome:
    """All steps of a diagnosis, from a base law that is calibrated."""
    clock, effort, law, problem = run.clock, run.effort, calibration.law, calibration.problem
    assert isinstance(problem, HierarchicalProblem)
    if not calibration.gate.passed:
        clock.end()
        why = "the gate of the base law's calibration failed: " + "; ".join(calibration.gate.problems)
        return NotDiagnosed(problem, law, why, calibration, seconds=clock.seconds)
    draws = population_draws(calibration, run.seed)
    base = fit_base(problem, law, typical(draws))

    clock.stage("identify", "what these recordings can tell")
    table = identify(base)

    clock.stage("comparison", "what could be missing: every candidate refitted")
    comparison = compare(base, clock.progress, clock.tell)

    clock.stage("check", "is anything wrong: clean campaigns simulated and refitted")
    check = odds_test(base, draws, run.seed, comparison.log_odds, clock.progress)
    decision = decide(comparison.probability, check.p_value, table.can_tell)
    location = location_of(comparison, next(iter(decision.names), None))

    finding: Finding = None
    if decision.names:
        finding = add_mechanisms(base, comparison, decision.names, calibration, run)
    if isinstance(finding, NotAugmented):
        decision = Decision("cannot_tell", ())
    if decision.verdict == "unexplained":
        clock.stage("profile", "the force profile added: checked again, fitted anew without some avalanches")
        finding = profile_law(comparison.leading(UNLISTED), run.seed)
    before, after = _left_out(finding, calibration, run)
    hangs_on = given = None
    if after is not None:
        assert decision.answer is not None
        clock.stage("influence", "what the answer hangs on: without each avalanche, each kind of reading")
        gained: FloatArray | None = after.pointwise - before.pointwise
        if isinstance(finding, Augmented) and len(finding.steps) > 1:
            exact = effort.exact_loo
            gained = or_none(partial(gained_by, exact=exact), finding.steps[0], calibration, run.seed)
        if gained is not None:
            hangs_on = or_none(influence, comparison, decision.answer, gained, check.needed, decision.tied)
        clock.stage("conditional", "predicting each reading from those above it")
        given = or_none(BeforeAfter.of, before, after, run.seed)
    clock.end()
    return Diagnosis(
        problem, law, calibration, table, check, comparison, decision, location, finding, before, after,
        hangs_on, given, clock.seconds,
    )  # fmt: skip


def _left_out(finding: Finding, calibration: Calibration, run: Run) -> tuple[HeldOut, HeldOut | None]:
    """Avalanches left out as the base law predicts them, and as the law with what was added does."""
    if isinstance(finding, ProfileLaw):
        return finding.before, finding.after
    run.clock.stage("held out", "predicting avalanches left out")
    exact = run.effort.exact_loo
    if not isinstance(finding, Augmented):
        return held_out(calibration, run.seed, exact=exact), None
    before = held_out(finding.reference, run.seed, exact=exact)
    return before, held_out(finding.steps[-1].calibration, run.seed, exact=exact)
