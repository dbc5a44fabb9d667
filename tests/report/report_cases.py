"""A calibration and a comparison document made up quickly: no sampler runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from skred.campaign import Campaign, Sensor, find_campaign, read_campaign
from skred.inference.along_track import with_along_track
from skred.inference.pooled.problem import PooledProblem, pooled_problem
from skred.inference.problem import Problem
from skred.inference.recorded_data import recorded_groups
from skred.inference.results import law_attributes
from skred.model_selection.ranking import ranking
from skred.physics.law import Law
from skred.report.shared.drawing import Picture

DRAWS = {
    "dry_friction": (0.29, 0.02),
    "turbulent_drag": (0.0023, 0.0002),
    "xi_h": (4500.0, 500.0),
    "retardation": (4.6, 0.05),
}
HOSTILE = "<script>alert('x')</script>[red]$\\frac{$\x1b[31m" + "long" * 60


def picture(file: Path) -> Picture:
    """A figure that shows nothing."""
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    empty = '<svg viewBox="0 0 1 1" role="img" aria-label=""><path d="M0 0" fill="var(--c0072b2)"/></svg>'
    return Picture(file, empty, empty)


def ryggfonn() -> PooledProblem:
    return pooled_problem(read_campaign(find_campaign("ryggfonn")))


def with_sensors(problem: PooledProblem, sensors: list[Sensor], **changes: object) -> PooledProblem:
    """The problem with other sensors: recordings are repeated as needed, the covariance is diagonal."""
    campaign = problem.campaign
    speeds = [k for k, s in enumerate(campaign.sensors) if not s.is_runout]
    runout = next(k for k, s in enumerate(campaign.sensors) if s.is_runout)
    columns = [runout if s.is_runout else speeds[k % len(speeds)] for k, s in enumerate(sensors)]
    changed: Campaign = replace(
        campaign,
        sensors=tuple(sensors),
        values=campaign.values[:, columns],
        status=campaign.status[:, columns],
        stated_sd=campaign.stated_sd[:, columns],
        **changes,
    )
    variance = np.diagonal(problem.covariance)[columns]
    return PooledProblem(changed, problem.terrain, np.diag(variance), problem.recorded_mean[columns])


def calibration(problem: PooledProblem, law: Law, draws: int = 60, chains: int = 2) -> xr.DataTree:
    """Groups that the figures read, from normal draws around plausible values."""
    rng = np.random.default_rng(1)
    dims = ("chain", "draw")
    posterior = {name: (dims, rng.normal(*DRAWS[name], size=(chains, draws))) for name in law.parameter_names}
    prior = {name: (dims, abs(rng.normal(0, DRAWS[name][0], size=(1, 200)))) for name in law.parameter_names}
    rows = law.strength_rows({name: values for name, (_, values) in posterior.items()})
    of_event = problem.simulate(law.mechanisms, rows).reshape(chains, draws, problem.campaign.n_events, -1)
    first = [int(np.flatnonzero(problem.release_of_event == k)[0]) for k in range(len(problem.releases))]
    noise = rng.standard_normal(of_event.shape) @ np.linalg.cholesky(problem.covariance).T
    groups = {
        "posterior": posterior,
        "prior": prior,
        "mean_response": {"response": ((*dims, "release", "sensor"), of_event[:, :, first])},
        "new_avalanches": {"reading": ((*dims, "event", "sensor"), of_event + noise)},
    }
    tree = xr.DataTree.from_dict({name: xr.Dataset(group) for name, group in groups.items()})
    tree.attrs["gate"] = '{"passed": true, "r_hat_max": 1.002, "ess_bulk_min": 900, "ess_tail_min": 800}'
    return tree


def as_saved(tree: xr.DataTree, law: Law, problem: Problem) -> xr.DataTree:
    """The tree with what a file of a calibration has beside the groups above."""
    more = with_along_track(tree, law, problem)
    for name, group in recorded_groups(problem).items():
        more[name] = xr.DataTree(group)
    more.attrs |= law_attributes(problem, law)
    return more


def gate(passed: bool = True) -> dict:
    return {
        "passed": passed,
        "r_hat_max": 1.002 if passed else None,
        "ess_bulk_min": 900.0 if passed else 12.0,
        "ess_tail_min": 800.0 if passed else 9.0,
        "divergences": 0,
        "problems": [] if passed else ["r-hat 1.312 exceeds 1.01: more --tune"],
    }


def pit(sensor: str, n: int) -> dict:
    """Places of readings spread evenly; fronts that may not come in the last one."""
    below = [(k + 0.4) / n for k in range(n)]
    return {
        "sensor": sensor,
        "events": [f"e{k + 1}" for k in range(n)],
        "below": below,
        "up_to": [*below[:-1], below[-1] + 0.1],
    }


def entry(law_id: str, pointwise: list[float], best: list[float], n_sensors: int = 4) -> dict:
    """A law that passed the gate."""
    differences = np.subtract(pointwise, best)
    se = float(np.sqrt(len(best) * differences.var()))
    elpd = float(np.sum(pointwise))
    difference = float(differences.sum())
    parameter = {
        "name": "dry_friction",
        "symbol": "mu",
        "paper_symbol": "a0",
        "unit": "1",
        "mean": 0.286512345,
        "sd": 0.0271234,
        "low": 0.2431234,
        "high": 0.3331234,
        "ess_bulk": 3240.2,
        "ess_tail": 3424.9,
        "r_hat": 1.00203,
        "mcse_mean": 0.00048,
    }
    response = [
        {
            "sensor": f"sensor {k}" if k + 1 < n_sensors else "runout",
            "unit": "m s-1" if k + 1 < n_sensors else "m",
            "mean": 33.21 if k + 1 < n_sensors else 2003.4,
            "sd": 2.6,
            "low": 28.9 if k + 1 < n_sensors else 1955.0,
            "high": 37.5 if k + 1 < n_sensors else 2051.0,
            "recorded_mean": 32.0 if k + 1 < n_sensors else 1971.0,
            "recorded_se": 2.5,
            "n_recorded": 21,
        }
        for k in range(n_sensors)
    ]
    return {
        "id": law_id,
        "title": f"law {law_id}",
        "equation": "dU^2/(2 ds) = g sin(phi) - b",
        "gate": gate(),
        "parameters": [parameter],
        "loo": {
            "elpd": elpd + 0.03,
            "se": 13.4,
            "p": 2.3,
            "pareto_k_max": 0.41,
            "n_bad": 0,
            "pareto_k": [0.41 - 0.1 * k for k in range(len(best))],
            "pit": [pit("sensor 0", len(best))],
        },
        "waic": {"elpd": elpd + 0.04, "se": 13.3, "p": 2.2, "n_unreliable": 1},
        "exact": {"elpd": elpd, "se": 13.5, "pointwise": list(pointwise), "mcse": 0.03, "failed_refits": []},
        "difference": {
            "elpd": difference,
            "se": se,
            "se_doubled": 2 * se,
            "practical": abs(difference) >= 4,
            "z_note": "",
        },
        "evidence": {"log_evidence": [elpd - 3.1, elpd - 2.9], "mean": elpd - 3.0, "spread": 0.2},
        "weight": 0.5,
        "response": response,
    }


def failed_entry(law_id: str) -> dict:
    """A law that failed the gate: it has parameters, and no number that could rank it."""
    made = entry(law_id, [-15.0] * 4, [-15.0] * 4)
    nothing = dict.fromkeys(("loo", "waic", "exact", "difference", "evidence", "weight"))
    return {**made, **nothing, "gate": gate(passed=False)}


def comparison() -> dict:
    """Two laws ranked and one failed, on four events."""
    best = [-14.11, -15.22, -13.93, -16.44]
    return {
        "format": 1,
        "campaign": {
            "name": "ryggfonn",
            "description": "four avalanches",
            "source": "a table",
            "fingerprint": "f8bf56d78bff",
            "n_events": 4,
            "n_sensors": 4,
            "reference_s_m": 1940.0,
            "readings": {"observed": 14, "not_reached": 1, "missing": 1},
        },
        "settings": {"sampler": "metropolis", "draws": 1000, "tune": 500, "chains": 4, "seed": 0},
        "versions": {"skred": "0.1.0", "pymc": "6.4.0"},
        "interval": {"kind": "equal-tailed", "probability": 0.9},
        "limits": {"practical_difference": 4.0, "r_hat": 1.01, "ess": 400.0, "integration": 0.0091},
        "models": [
            entry("pcm", best, best),
            entry("constant", [-15.0, -15.1, -17.0, -17.5], best),
            failed_entry("coulomb"),
        ],
        "event_ids": ["e1", "e2", "e3", "e4"],
        "alpha_beta": {
            "beta_deg": 27.9,
            "alpha_deg": 25.4,
            "runout_m": 160.2,
            "runout_minus_1sd_m": None,
            "recorded_max_m": 333.0,
            "recorded_max_event": "e4",
            "exceedance_of_recorded_max": 0.21,
            "note": "kept out of LOO",
        },
        "statement": ["The recordings prefer PCM.", "The difference to the next law is 4.90."],
        "seconds": 93.2,
    }


def ranked_comparison(n: int = 8) -> dict:
    """Three laws on some avalanches, with all that a comparison writes of the ranking."""
    events = [f"e{k + 1}" for k in range(n)]
    best = [-14.0 - 0.1 * k for k in range(n)]
    one_decides = [value - 0.4 for value in best[:-1]] + [best[-1] - 6.0]
    even = [value - 2.0 for value in best]
    document = {**comparison(), "event_ids": events}
    document["models"] = [
        entry("pcm", best, best),
        entry("voellmy", one_decides, best),
        entry("constant", even, best),
    ]
    for law in document["models"]:
        law["loo"]["pit"] = [pit("sensor 0", n), pit("runout", n)]
    document["ranking"] = ranking(document["models"], events)
    document["campaign"]["n_events"] = n
    return document
