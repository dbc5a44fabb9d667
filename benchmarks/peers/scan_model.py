"""M2 as a user without a compiled kernel writes it in PyTensor: `pytensor.scan` over the cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymc as pm
import pytensor
import pytensor.tensor as pt

from benchmarks.peers.forward import Track, cross, march_step, read, track_of
from models.pcm import DRAG, DRY
from skred.inference.pooled.problem import PooledProblem


def scan_readings(track: Track, mu: Any, drag: Any) -> Any:
    """Symbolic readings of one front, (1, n_sensors)."""
    # The first cell apart: there, and only there, a front at rest may start.
    v, distance = cross(pt, pt.zeros(()), tuple(track.cells[:, 0]), mu, drag)
    s = track.release + distance
    speeds, places = pytensor.scan(
        lambda *inputs: march_step(pt, inputs[5], inputs[6], inputs[:5], *inputs[7:]),
        sequences=[pt.as_tensor(row) for row in track.cells[:, 1:]],
        outputs_info=[v, s],
        non_sequences=[mu, drag],
        return_updates=False,
    )
    v_at_edges = pt.concatenate([np.zeros(1), v[None], speeds])
    speeds_read = read(pt, track, v_at_edges[track.sensor_cell], places[-1], mu, drag)
    return pt.concatenate([speeds_read, places[-1:]])[None, :]


def build(problem: PooledProblem) -> pm.Model:
    """PyMC model of the pooled M2 calibration: the priors and the density Op of `models.pcm`."""
    track = track_of(problem)
    with pm.Model(coords=problem.coords) as model:
        mu = pm.HalfNormal("dry_friction", sigma=DRY.strength.prior_scale)
        drag = pm.HalfNormal("turbulent_drag", sigma=DRAG.strength.prior_scale)
        problem.observe_response(scan_readings(track, mu, drag))
    return model
