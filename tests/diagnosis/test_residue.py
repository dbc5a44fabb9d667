"""A named effect with a small one beside it, on bodies that roll out: drag, and ground not quite level."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of
from rolling_cases import entering, rolling, speed

from skred.campaign import Campaign
from skred.diagnosis.compare.candidate import Beside, Candidate, names_of_constants, with_or_without
from skred.diagnosis.compare.comparison import compare, free_force
from skred.diagnosis.compare.recomputed import recomputed
from skred.diagnosis.compare.residue import Residue, residues, with_residues
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.discrepancy.climb import climb
from skred.diagnosis.discrepancy.explored import Expansion
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Kind, Profile, log_evidence_of
from skred.diagnosis.discrepancy.sampled_evidence import sampled
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at, curve_near
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape
from skred.physics.mechanisms.strength_prior import log_prior_density

DRAG = mechanisms()["turbulent_drag"]


def fitted(campaign: Campaign) -> tuple[Base, Candidate, list[Profile]]:
    """The base law, drag along the track, and the force that is not in the list."""
    base = base_of(campaign, "coulomb")
    found = curve_near(base, curve(base, placed(DRAG, base.setting, Shape())), Shape())
    candidate = Candidate(DRAG, (found,), np.zeros(1))
    return base, candidate, [*map(partial(free_force, base, candidates={DRAG.id: candidate}), KINDS)]


def test_waves_in_closed_form() -> None:
    """Against small steps along the ground."""
    s, v = 100.0, speed(100.0, 20.0, 0.006, 2.4e-4) ** 2
    while s < 740.0:
        mid = s - 100.0 + 0.05
        v += 0.1 * (-2.0 * 9.81 * 0.006 - 2.0 * 2.4e-4 * v - 2.0 * 0.05 * np.sin(2.0 * np.pi * mid / 400.0))
        s += 0.1
    assert speed(740.0, 20.0, 0.006, 2.4e-4, 0.05) == pytest.approx(np.sqrt(v), rel=1e-4)


def test_a_force_that_takes_both_effects_is_behind_the_first_and_a_force_beside_it() -> None:
    """By four or five nats: so it is, too, by forces sampled beside drags that are held, see below."""
    base, drag, profiles = fitted(rolling(2.4e-4, waves=0.05))
    force = log_evidence_of(profiles)
    assert drag.alone > 10.0 and force > drag.alone + 2.0
    with ThreadPoolExecutor(2) as pool:
        found = with_residues(base, {DRAG.id: drag}, profiles, pool)[DRAG.id]
    assert found.residue is not None and 0.0 < found.residue < drag.alone
    assert found.alone == drag.alone
    assert found.log_bayes_factor == pytest.approx(drag.alone + with_or_without(0.0, found.residue))
    assert found.log_bayes_factor == pytest.approx(force + 4.5, abs=2.0) and force > drag.alone + 30.0


@pytest.mark.slow
def test_climbs_end_where_a_force_beside_a_mechanism_cannot_bring_it_near_what_leads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After the first prior's, and none is reported; where it may count they go on."""
    base, drag, profiles = fitted(rolling(2.4e-4, waves=0.05))
    climbed = list[int]()

    def counted(*given: Any, **more: Any) -> Expansion:
        climbed.append(1)
        return climb(*given, **more)

    monkeypatch.setattr("skred.diagnosis.discrepancy.fit.climb", counted)

    def looked(best: float) -> tuple[int, Candidate]:
        climbed.clear()
        with ThreadPoolExecutor(1) as pool:
            found = with_residues(base, {DRAG.id: drag}, profiles, pool, best)[DRAG.id]
        return len(climbed), found

    by_all, usual = looked(-np.inf)
    assert usual.residue is not None
    n, found = looked(usual.log_bayes_factor)
    assert n == by_all and found.residue == usual.residue
    n, found = looked(usual.log_bayes_factor + 2.0 * COUNTS)
    assert n < 0.7 * by_all
    assert found.residue is None and found.log_bayes_factor == drag.log_bayes_factor


@pytest.mark.slow
def test_evidence_of_both_is_that_of_the_force_at_each_strength_of_the_mechanism() -> None:
    """By Laplace with what that lacks of the force alone, and by forces sampled beside drags that are held.

    The latter are summed up over the drags.
    """
    base, drag, profiles = fitted(rolling(2.4e-4, waves=0.05))
    assert DRAG.added is not None
    mean, sd = drag.best.moments
    strengths, known, heights = mean + sd * np.arange(2.0, -17.0, -3.0), drag.best.known, list[float]()
    with ThreadPoolExecutor(2) as pool:
        laplace = with_residues(base, {DRAG.id: drag}, profiles, pool)
        one = recomputed(base, laplace, profiles, pool)[0][DRAG.id]
        for strength in strengths:
            along = curve_at(base, drag.best, np.array([strength]), known=known)
            known = known | along.known
            near = along.nearest(strength)
            held = replace(base, directions=(along.direction,), strengths=np.array([strength]), fit=near)
            forces = [sampled(held, fit_profile(held, kind), pool) for kind in KINDS]
            heights.append(along.log_evidence[-1] + log_evidence_of(forces))
    log_density = np.array(heights) + log_prior_density(strengths, DRAG.added.scale, either_sign=False)
    by_strength = np.log(np.trapezoid(np.exp(log_density - 100.0)[::-1], strengths[::-1])) + 100.0
    before = laplace[DRAG.id].residue
    assert one.residue is not None and before is not None and before < one.residue
    assert drag.alone + one.residue == pytest.approx(by_strength, abs=1.0)


@pytest.mark.slow
def test_drag_is_named_first_where_ground_is_not_quite_level_and_entry_speeds_are_stated() -> None:
    """A force of any shape takes both; drag and such a force beside it win."""
    comparison = compare(base_of(entering(2.4e-4, waves=0.03), "coulomb"))
    drag = comparison.leading(DRAG.id).candidates[DRAG.id]
    assert max(comparison.probability, key=lambda name: comparison.probability[name]) == DRAG.id
    assert drag.residue is not None and drag.residue > 0.0
    assert drag.strength().mean == pytest.approx(2.4e-4, abs=2.0 * drag.strength().sd)


def test_without_a_second_effect_nothing_is_looked_for() -> None:
    base, drag, profiles = fitted(rolling(2.4e-4))
    assert log_evidence_of(profiles) < drag.alone
    with ThreadPoolExecutor(2) as pool:
        assert with_residues(base, {DRAG.id: drag}, profiles, pool)[DRAG.id] is drag
        # A mechanism that explains less than half of what the force does is no first effect.
        weak = replace(drag, correction=0.3 * log_evidence_of(profiles) - drag.alone)
        assert with_residues(base, {DRAG.id: weak}, profiles, pool)[DRAG.id].residue is None


def test_a_mechanism_that_is_overtaken_is_looked_at_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ahead of a force by itself it is not; behind another one with such a force beside it is."""
    base, drag, profiles = fitted(rolling(2.4e-4, n_events=6))
    force = [replace(one, log_bayes_factor=98.0) for one in profiles]
    heights = {"turbulent_drag": 104.0, "viscous_drag": 80.0, "constant_retardation": 40.0}
    candidates = {
        name: replace(drag, mechanism=mechanisms()[name], correction=height - drag.alone)
        for name, height in heights.items()
    }
    n_looked = list[int]()

    def beside(base: Base, curves: list[object], least: object, pool: object) -> list[Residue | None]:
        n_looked.append(len(curves))
        return [Residue(29.0, Beside(drag.best, tuple(profiles)))] * len(curves)

    monkeypatch.setattr("skred.diagnosis.compare.residue.residues", beside)
    with ThreadPoolExecutor(1) as pool:
        found = with_residues(base, candidates, force, pool)
        assert n_looked == [1, 1]
        assert [found[name].residue for name in heights] == [29.0, 29.0, None]
        weak = replace(candidates["viscous_drag"], correction=40.0 - drag.alone)
        behind = with_residues(base, {**candidates, "viscous_drag": weak}, force, pool)
    assert behind["turbulent_drag"].residue is None


def test_each_form_of_a_mechanism_has_a_residue_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that the recordings speak against is not lost where a force beside it makes up for that."""
    base, drag, profiles = fitted(rolling(2.4e-4, n_events=6))
    force = [replace(one, log_bayes_factor=drag.alone + 1.0) for one in profiles]
    other = replace(drag.best, shape=Shape(constants=(("another", 1.0),)))
    weights = np.log([0.9, 0.1])
    both = Candidate(DRAG, (drag.best, other), weights, correction=drag.alone - drag.best.log_bayes_factor)
    assert [(one.shape.constants, np.exp(share)) for one, share in both.best_of_each(names_of_constants)] == [
        ((), pytest.approx(0.9)),
        ((("another", 1.0),), pytest.approx(0.1)),
    ]
    of_each = {(): 1.0, (("another", 1.0),): 8.0}

    def beside(base: Base, curves: list[Curve], least: object, pool: object) -> list[Residue | None]:
        return [Residue(of_each[one.shape.constants], Beside(one, tuple(profiles))) for one in curves]

    monkeypatch.setattr("skred.diagnosis.compare.residue.residues", beside)
    with ThreadPoolExecutor(1) as pool:
        found = with_residues(base, {DRAG.id: both}, force, pool)[DRAG.id]
    assert found.residue == pytest.approx(np.log(0.9 * np.exp(1.0) + 0.1 * np.exp(8.0)))
    far = replace(both, log_weights=np.log([1.0 - 1e-4, 1e-4]))
    assert [one.shape.constants for one, _ in far.best_of_each(names_of_constants)] == [()]


def test_what_laplace_lacks_of_the_force_is_added_beside_a_mechanism(monkeypatch: pytest.MonkeyPatch) -> None:
    base, drag, profiles = fitted(rolling(2.4e-4, waves=0.05, n_events=6))

    def five_more(base: Base, profile: Profile, *given: object) -> Profile:
        return replace(profile, log_bayes_factor=profile.log_bayes_factor + 5.0)

    monkeypatch.setattr("skred.diagnosis.compare.recomputed.sampled", five_more)
    with ThreadPoolExecutor(1) as pool:
        beside, again = recomputed(base, {DRAG.id: replace(drag, residue=30.0)}, profiles, pool)
        alone = recomputed(base, {DRAG.id: drag}, profiles, pool)[0]
    lacked = log_evidence_of(again) - log_evidence_of(profiles)
    assert 4.9 < lacked <= 5.0
    assert beside[DRAG.id].residue == pytest.approx(30.0 + lacked)
    assert alone[DRAG.id].residue is None


def test_what_stated_places_leave_of_a_mechanism_decides_whether_a_force_counts_beside_it() -> None:
    """One that explains nothing any more does not inherit what such a force explains."""
    _, drag, _ = fitted(rolling(2.4e-4, n_events=6))
    one = replace(drag, correction=20.0 - drag.alone, residue=10.0)
    still, nothing_left = one.with_places(-8.0, -12.0, None), one.with_places(-22.0, -18.0, None)
    assert still.alone == pytest.approx(12.0) and still.residue == pytest.approx(6.0)
    assert nothing_left.residue is None and nothing_left.log_bayes_factor == pytest.approx(-2.0)


def test_a_kind_of_force_that_breaks_down_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """It counts for nothing, with its prior probability; where all do there is no residue."""
    base, drag, profiles = fitted(rolling(2.4e-4, n_events=6))
    breaking = set[str]()

    def beside(base: Base, curve: Curve, least: float, kind: Kind) -> Profile:
        if kind.equation in breaking:
            raise np.linalg.LinAlgError
        return replace(profiles[KINDS.index(kind)], log_bayes_factor=curve.log_bayes_factor + 8.0)

    monkeypatch.setattr("skred.diagnosis.compare.residue.fit_beside", beside)

    def found() -> Residue | None:
        with ThreadPoolExecutor(1) as pool:
            return residues(base, [drag.best], [-np.inf], pool)[0]

    every, breaking = found(), {KINDS[1].equation}
    two, breaking = found(), {kind.equation for kind in KINDS}
    assert every is not None and every.log_factor == pytest.approx(8.0)
    assert two is not None and [one.kind for one in two.beside.profiles] == [KINDS[0], KINDS[2]]
    assert two.log_factor == pytest.approx(8.0 + np.log(KINDS[0].share + KINDS[2].share))
    assert found() is None


def test_what_a_force_beside_adds() -> None:
    """With it or without it, at even odds."""
    assert with_or_without(0.0, -50.0) == pytest.approx(np.log(0.5))
    assert with_or_without(0.0, 0.0) == pytest.approx(0.0)
    assert with_or_without(0.0, 50.0) == pytest.approx(50.0 + np.log(0.5))


def test_nothing_is_one_of_those_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mechanism a little less probable than nothing is computed again; one far less probable is not."""
    base, drag, _ = fitted(rolling(2.4e-4, n_events=6))
    heights = {"turbulent_drag": -1.0, "viscous_drag": -7.0}
    candidates = {
        name: replace(drag, mechanism=mechanisms()[name], correction=height - drag.alone)
        for name, height in heights.items()
    }
    monkeypatch.setattr(
        "skred.diagnosis.compare.recomputed.computed_again", lambda base, curve: (curve, 0.125)
    )
    with ThreadPoolExecutor(1) as pool:
        found, _ = recomputed(base, candidates, [], pool)
    assert found["turbulent_drag"].error == 0.125
    assert found["viscous_drag"] is candidates["viscous_drag"]
