"""A hierarchical calibration and its comparison document made up quickly: no sampler runs."""

from functools import cache

import numpy as np
import xarray as xr
from report_cases import DRAWS, comparison, entry, failed_entry, gate, ryggfonn

from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.problem import Problem
from skred.physics.law import Law

UNITS = {"dry_friction": "1", "turbulent_drag": "m-1", "retardation": "m s-2"}
PLACE_SD_M = 8.0


@cache
def hierarchical_ryggfonn() -> HierarchicalProblem:
    pooled = ryggfonn()
    return HierarchicalProblem(pooled.campaign, pooled.terrain)


def hierarchical_calibration(problem: Problem, law: Law, draws: int = 40, chains: int = 2) -> xr.DataTree:
    """Groups that the figures read, in the dims of a result: medians, spreads, avalanches."""
    rng = np.random.default_rng(2)
    dims = ("chain", "draw")
    size = (chains, draws)
    own = set(law.parameter_names)
    posterior, prior = {}, {}
    for parameter in problem.parameters(law):
        name = parameter.name
        mean, sd = DRAWS[name] if name in own else (-0.2, 0.2) if "correlation" in name else (0.2, 0.04)
        values = rng.normal(mean, sd, size=size)
        posterior[name] = (dims, values if "correlation" in name else abs(values))
        wide = rng.normal(0, abs(mean), size=(1, 200))
        prior[name] = (dims, np.clip(wide, -1, 1) if "correlation" in name else abs(wide))
    medians = law.strength_rows({name: posterior[name][1] for name in law.parameter_names})
    groups = {"posterior": posterior, "prior": prior}
    for group, spread in (("event_posterior", 0.1), ("new_avalanches", 0.2)):
        groups[group] = avalanches(problem, law, medians, size, spread, rng)
    tree = xr.DataTree.from_dict({name: xr.Dataset(group) for name, group in groups.items()})
    tree.attrs["gate"] = '{"passed": true, "r_hat_max": 1.002, "ess_bulk_min": 900, "ess_tail_min": 800}'
    return tree


def avalanches(problem, law, medians, size, spread, rng):
    """Variables of single avalanches; readings from a formula, not from the physics."""
    campaign = problem.campaign
    n_events, n_strengths = campaign.n_events, len(law.mechanisms)
    logs = spread * rng.standard_normal((len(medians), n_events, n_strengths))
    strengths = medians[:, None, :] * np.exp(logs)
    dims = ("chain", "draw", "event")
    made = {
        mechanism.strength.name: (dims, strengths[..., k].reshape(*size, n_events))
        for k, mechanism in enumerate(law.mechanisms)
    }
    release = np.array([event.release_s_m for event in campaign.events])
    made["release"] = (dims, np.broadcast_to(release, (*size, n_events)).copy())
    made["release_speed"] = (dims, np.zeros((*size, n_events)))
    is_runout = np.array([sensor.is_runout for sensor in campaign.sensors])
    shape = (*size, n_events, campaign.n_sensors)
    front = np.where(is_runout, 1970.0, 25.0) * np.exp(-0.3 * logs.sum(-1).reshape(*size, n_events, 1))
    made["front"] = ((*dims, "sensor"), np.broadcast_to(front, shape).copy())
    made["reading"] = ((*dims, "sensor"), front * rng.normal(1, 0.1, size=shape))
    made["reached"] = ((*dims, "sensor"), is_runout | (rng.random(shape) < 0.8))
    return made


def population_parameters() -> list[dict]:
    """Rows of a law of two strengths, as a calibration's entry has them."""
    rows = []
    for name, symbol, unit, mean, sd in (
        ("dry_friction", "mu", "1", 0.3201617, 0.0218765),
        ("turbulent_drag", "D", "m-1", 0.0031123, 0.00091),
        ("dry_friction_spread", "sd(log mu)", "1", 0.2101336, 0.0534724),
        ("turbulent_drag_spread", "sd(log D)", "1", 0.9512345, 0.2181909),
        ("dry_friction_turbulent_drag_correlation", "corr(log mu, log D)", "1", -0.1891382, 0.2162255),
    ):
        rows.append(
            {
                "name": name, "symbol": symbol, "paper_symbol": "", "unit": unit, "mean": mean, "sd": sd,
                "low": mean - 1.6 * sd, "high": mean + 1.7 * sd, "ess_bulk": 1542.6, "ess_tail": 1492.9,
                "r_hat": 1.0017357, "mcse_mean": sd / 39,
            }
        )  # fmt: skip
    return rows


def new_avalanche_rows() -> list[dict]:
    speed = {
        "unit": "m/s", "n_recorded": 20, "mean": 25.998, "sd": 15.64, "low": 6.06, "high": 56.28,
        "recorded_mean": 22.0, "recorded_sd": 14.74, "recorded_low": 0.95, "recorded_high": 43.05,
    }  # fmt: skip
    runout = {
        "sensor": "runout", "unit": "m", "reached": 1.0, "recorded_reached": 1.0, "n_recorded": 22,
        "mean": 1799.23, "sd": 495.4, "low": 638.5, "high": 2283.97,
        "recorded_mean": 1971.05, "recorded_sd": 143.1, "recorded_low": 1791.5, "recorded_high": 2163.75,
    }  # fmt: skip
    return [
        {"sensor": "LC", **speed, "reached": 0.852216, "recorded_reached": 1.0},
        {"sensor": "CD", **speed, "reached": 0.850557, "recorded_reached": 0.952381},
        {"sensor": "b", **speed, "reached": 0.632023, "recorded_reached": 0.714286},
        runout,
    ]


def hierarchical_entry(law_id: str, pointwise: list[float], best: list[float]) -> dict:
    made = entry(law_id, pointwise, best)
    del made["response"]
    strengths = {
        name: {"median": 0.27, "low": 0.19, "high": 0.37, "unit": UNITS[name]}
        for name in ("dry_friction", "turbulent_drag")
    }
    made["exact"]["refitted"] = ["e2", "e4"]
    return {
        **made,
        "parameters": population_parameters(),
        "error_model": {"id": "robust", "title": "normal, with a few outliers"},
        "place_sd_m": PLACE_SD_M,
        "integration": {
            "largest_error_of_an_event": 0.00256195,
            "largest_mean_error": 0.00025737,
            "checked_events": 4,
        },
        "new_avalanche": new_avalanche_rows(),
        "events": [{"event": event, **strengths} for event in ("e1", "e2", "e3", "e4")],
    }


def error_model(name: str, difference: float, *, passed: bool = True) -> dict:
    return {
        "id": name,
        "title": f"{name}, in words",
        "elpd": -52.4 + difference,
        "se": 11.2,
        "difference": {"elpd": difference, "se": 0.83 if difference else 0.0, "practical": difference < -4},
        "evidence": {"mean": -55.3 + difference, "spread": 0.12},
        "gate": gate(passed),
        "n_refitted": 2,
    }


def hierarchical_comparison() -> dict:
    """Two laws ranked and one failed; beside them a pooled comparison and three error models."""
    best = [-13.11, -14.22, -12.93, -15.44]
    pooled = comparison()
    models = [hierarchical_entry("pcm", best, best), hierarchical_entry("constant", [-15.0] * 4, best)]
    kept = ("id", "title", "gate", "parameters", "exact", "difference", "evidence", "weight", "loo", "waic")
    failed = {**hierarchical_entry("coulomb", best, best), **failed_entry("coulomb")}
    failed.update(parameters=population_parameters(), response=None)
    for law in pooled["models"][:2]:
        law["exact"]["refitted"] = pooled["event_ids"]
    return {
        **pooled,
        "likelihood": "hierarchical",
        "models": [*models, failed],
        "pooled": {"reason": None, "models": [{k: m[k] for k in kept} for m in pooled["models"][:2]]},
        "error_models": [
            error_model("robust", 0.0),
            error_model("normal", -5.61),
            error_model("student", -0.4, passed=False),
        ],
        "changes": ["PCM stays first.", "The spread of D now explains what Sigma did."],
    }
