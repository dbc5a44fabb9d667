"""The pooled calibration's two pieces of a PyMC model: the mean response, and its recordings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pymc as pm
import pytensor.tensor as pt

from skred.inference.pooled.density_op import PooledLogDensity
from skred.inference.pooled.forward_op import front_readings
from skred.inference.problem import PooledProblem
from skred.physics.mechanisms.spec import Mechanism


def mean_response(problem: PooledProblem, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
    """Symbolic mean response of the path to one vector of strengths.

    Parameters
    ----------
    problem : PooledProblem
    mechanisms : sequence of Mechanism
        The law.
    strengths : sequence of scalar tensors
        One for each mechanism, in its unit.

    Returns
    -------
    (n_releases, n_sensors) tensor, m/s or m
        One row for each different release place of the campaign.
    """
    law = problem.contributions(mechanisms)
    runs = pt.alloc(pt.stack(list(strengths)), len(problem.releases), len(mechanisms))
    return front_readings(runs, problem.releases, problem.path, law, problem.sensors)


def observe(problem: PooledProblem, response: Any) -> Any:
    """Observed variable ``recordings``: y_e ~ N(response, Sigma), one log density per event.

    The readings enter as constants of the density, not as `observed`, where a missing one would
    become a free parameter; what is observed is the number of each event.
    """
    arrays = problem.arrays
    if len(problem.releases) > 1:
        # The distribution's batch is the event: give every event its own row.
        response = response[problem.release_of_event]
        arrays = arrays._replace(release_of_event=np.arange(problem.campaign.n_events))

    def logp(event_number: Any, response_rows: Any) -> Any:
        return PooledLogDensity()(response_rows, *arrays)

    return pm.CustomDist(
        "recordings",
        response,
        logp=logp,
        signature="(n)->()",
        observed=np.arange(problem.campaign.n_events, dtype=float),
        dims="event",
    )
