"""Terms along the track that begin at the first recording: above it there may be other ground, or none."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from diagnosis_cases import base_of
from rolling_cases import PLACES_M, rolling

from skred.campaign import Status
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import free_force
from skred.diagnosis.compare.refinement import candidates_of, kinds_of
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.discrepancy.profile import KINDS, log_evidence_of
from skred.diagnosis.evidence.coefficient import Base, curve_near
from skred.diagnosis.evidence.extension import recorded_range
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed, shapes_of
from skred.physics.mechanisms.spec import Shape
from skred.physics.mechanisms.stretches import equation_of

D = 2.4e-4
DRAG = mechanisms()["turbulent_drag"]


def drag_on(base: Base) -> Candidate:
    """Drag along the track and from the first recording on, by the usual number of quadrature points."""
    screened = [curve(base, placed(DRAG, base.setting, shape)) for shape in shapes_of(DRAG, base.setting)]
    again = [curve_near(base, one, one.shape) for one in screened]
    return candidates_of(kinds_of(base.setting, again))[DRAG.id]


def test_a_made_up_ramp_hides_no_drag() -> None:
    """A ramp without losses gives the entry speed, as people write such runs: on it no drag acts."""
    base = base_of(rolling(D, lossless=True), "coulomb")
    drag = drag_on(base)
    whole, recorded = drag.curves
    assert whole.shape == Shape() and recorded.shape == Shape(s_from_m=PLACES_M[0])
    assert recorded.log_bayes_factor > whole.log_bayes_factor + 5.0
    mean, sd = recorded.moments
    assert abs(mean - D) < 3.0 * sd and sd < 0.2 * D
    force = log_evidence_of([*map(partial(free_force, base, candidates={DRAG.id: drag}), KINDS)])
    assert drag.alone > force + 2.0 > whole.log_bayes_factor
    assert drag.ends(0.5) is None  # it is bound to no stretch
    assert equation_of(DRAG, drag.best.shape) == "-D U^2 for s > 140 m"


def test_where_no_speed_was_read_there_is_no_such_place() -> None:
    base = base_of(rolling(D, n_events=6), "coulomb")
    none = replace(base.setting, velocities=(False,) * len(base.setting.velocities))
    assert shapes_of(DRAG, none) == (Shape(),) != shapes_of(DRAG, base.setting)


def test_a_sensor_that_never_read_does_not_stretch_the_recorded_part() -> None:
    base = base_of(rolling(D, n_events=6), "coulomb")
    campaign = base.problem.campaign
    usual = next(one for one in campaign.sensors if not one.is_runout)
    beyond = replace(usual, id="beyond", s_from_m=base.setting.recorded_m[1] + 50.0)
    beyond = replace(beyond, s_to_m=beyond.s_from_m)
    silent = np.full((campaign.n_events, 1), np.nan)
    more = replace(
        campaign,
        sensors=(*campaign.sensors, beyond),
        values=np.hstack([campaign.values, silent]),
        status=np.hstack([campaign.status, np.full(silent.shape, int(Status.MISSING))]),
        stated_sd=np.hstack([campaign.stated_sd, silent]),
        values_to=np.hstack([campaign.values_to, silent]),
    )
    assert recorded_range(replace(base.problem, campaign=more)) == base.setting.recorded_m


def test_a_drag_that_acts_on_the_ramp_too_is_along_the_whole_track() -> None:
    """Both have half of the prior."""
    base = base_of(rolling(D), "coulomb")
    drag = drag_on(base)
    whole, recorded = drag.curves
    assert whole.log_bayes_factor > recorded.log_bayes_factor
    both = np.logaddexp(whole.log_bayes_factor, recorded.log_bayes_factor)
    assert drag.alone == pytest.approx(both - np.log(2.0))
    assert drag.best.shape == Shape()
