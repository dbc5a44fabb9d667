"""Simulation-based calibration of the hierarchical likelihood.

``python -m benchmarks.hierarchical_sbc [--kind sparse] [--n 200] [--seed 0] [--law pcm] [--workers 2]``.

Again and again: a population from the model's own prior; strengths of the events; what would have been
recorded of them (`hierarchical_campaigns`: just what the likelihood stands for, outliers, the stop as seen
and negative velocities included); surfaces; the posterior by the sampler that skred uses; the rank
of the truth among its draws, and whether the central 90 % interval covers it. For every parameter of
the population, the log likelihood, and the strengths of two events drawn at random, whose own draws come from
the same surfaces.

How ranks are judged stands in `sbc`. A campaign that raises an error is counted and listed; one whose
chains fail the gate, after one more try with four times the draws, is counted and kept. Each is written as
soon as it is done, and the same command goes on with a run that was ended.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from benchmarks import hierarchical_campaigns as campaigns
from benchmarks import sbc
from skred.errors import InputError
from skred.inference.gate import check_gate
from skred.inference.hierarchical.event_draws import recorded_avalanches
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.output import plain
from skred.physics.law import Law
from skred.physics.laws import load_law

FloatArray = NDArray[np.float64]
Kind = Literal["sparse", "dense"]
Analysed = Callable[[HierarchicalProblem], HierarchicalProblem]

SAMPLER = SamplerSettings("metropolis", draws=500, tune=400, chains=4)
PRIOR_ROWS = 10_000
EVENT_DRAWS = 400
"""Draws of the population for which events' strengths are drawn."""
INTERVAL = 0.9
ASKED = (0.85, 0.95)
"""Share of the intervals that should cover the truth."""
EVENTS = ("a", "b")
"""Names of the two events whose strengths are ranked."""


class Design(NamedTuple):
    """What is simulated again and again; see `hierarchical_campaigns`."""

    kind: Kind
    n_events: int
    error_model: str = "robust"
    release_sd_m: float = 0.0

    def problem(self) -> HierarchicalProblem:
        """The design without recordings."""
        make = campaigns.sparse_design if self.kind == "sparse" else campaigns.dense_design
        return make(self.n_events, error_model=self.error_model, release_sd_m=self.release_sd_m)


def as_it_is(problem: HierarchicalProblem) -> HierarchicalProblem:
    """Analyse what was recorded."""
    return problem


# One campaign


class Calibrator:
    """Simulates campaigns of one design and calibrates a law on them, compiled once for all.

    Parameters
    ----------
    design : Design
    law : Law
    seed : int
    settings : SamplerSettings
    analysed : callable
        Problem with simulated recordings to the one that is calibrated: the same, unless an error is
        to be planted.
    """

    def __init__(
        self,
        design: Design,
        law: Law,
        seed: int,
        settings: SamplerSettings = SAMPLER,
        analysed: Analysed = as_it_is,
    ) -> None:
        self.law, self.seed, self.settings, self.analysed = law, seed, settings, analysed
        self.problem = design.problem()
        rng = np.random.default_rng([seed, PRIOR_ROWS])
        any_campaign = campaigns.simulated(self.problem, law, campaigns.typical_population(law), rng)
        self.model = law.build(any_campaign.problem)
        self.step = JointMetropolis(model=self.model, pointwise="recordings")
        self.names = campaigns.parameter_names(self.problem, law)
        self.prior = sample_prior(self.model, law, seed, PRIOR_ROWS)[self.names]

    def simulate(self, number: int) -> tuple[dict[str, float], campaigns.Simulated]:
        """True population of one campaign, and the campaign."""
        truth = {name: float(self.prior[name].values[0, number]) for name in self.names}
        rng = np.random.default_rng([self.seed, number, 0])
        return truth, campaigns.simulated(self.problem, self.law, truth, rng)

    def calibrate(self, number: int) -> dict[str, Any]:
        """Ranks, coverage and diagnostics of one campaign."""
        truth, simulated = self.simulate(number)
        problem = self.analysed(simulated.problem)
        started = time.monotonic()
        surfaces = problem.surfaces(self.law.mechanisms)
        surfaces_seconds = time.monotonic() - started
        campaigns.set_surfaces(self.model, problem, self.law)
        for attempt in (1, 2):
            tree = self._sample(problem, number, sbc.SECOND_TRY if attempt == 2 else 1)
            gate = check_gate(tree, self.names)
            if gate.passed:
                break
        draws = {name: tree["posterior"][name].values for name in self.names}
        rng = np.random.default_rng([self.seed, number, 1])
        chosen = rng.choice(len(simulated.strengths), size=len(EVENTS), replace=False)
        some = {name: sbc.thin(values, EVENT_DRAWS) for name, values in draws.items()}
        strengths = recorded_avalanches(problem, self.law, some, rng).strengths
        for name, event in zip(EVENTS, chosen, strict=True):
            for k, mechanism in enumerate(self.law.mechanisms):
                quantity = f"{mechanism.strength.name}_event_{name}"
                truth[quantity] = float(simulated.strengths[event, k])
                draws[quantity] = strengths[:, event, k]
        thinned = {name: sbc.thin(values, sbc.N_RANKED) for name, values in draws.items()}
        ranks = {name: sbc.rank(truth[name], thinned[name], rng) for name in truth}
        at_truth = self._log_likelihood(problem, {name: np.array([truth[name]]) for name in self.names})
        at_draws = self._log_likelihood(problem, thinned)
        ranks[sbc.LOG_LIKELIHOOD] = sbc.rank(at_truth[0], at_draws, rng)
        readings, stops = problem.readings, simulated.stops
        return {
            "number": number,
            "truth": truth,
            "ranks": ranks,
            "covered": {name: _covers(values, truth[name]) for name, values in draws.items()},
            "events_off_the_track": int(np.sum(stops >= problem.terrain.length_m)),
            "events_that_reach_no_sensor": int(np.sum(np.isinf(readings.reached))),
            "patches": surfaces.n_patches,
            "kernel_runs": surfaces.n_runs,
            "attempts": attempt,
            "gate": gate.as_dict(),
            "surfaces_seconds": round(surfaces_seconds, 3),
            "seconds": round(time.monotonic() - started, 3),
        }

    def _sample(self, problem: HierarchicalProblem, number: int, times: int) -> Any:
        seed = int(np.random.SeedSequence([self.seed, number, 1 + times]).generate_state(1)[0] >> 1)
        settings = replace(
            self.settings, draws=times * self.settings.draws, tune=times * self.settings.tune, seed=seed
        )
        # Starting points come from the prior, but not from the rows that hold truths.
        rows = self.prior.isel(draw=slice(PRIOR_ROWS // 2, None)).roll(draw=number)
        return sample_posterior(self.model, self.law, problem, rows, settings, step=self.step)

    def _log_likelihood(self, problem: HierarchicalProblem, parameters: Any) -> FloatArray:
        return np.asarray(problem.log_likelihood(self.law, parameters).sum(axis=1))


def _covers(draws: FloatArray, truth: float) -> bool:
    """Whether the central interval of the draws covers a number."""
    tail = 0.5 * (1.0 - INTERVAL)
    low, high = np.quantile(draws, [tail, 1.0 - tail])
    return bool(low <= truth <= high)


# Many campaigns


_of_worker: dict[str, Calibrator] = {}


def _start_worker(design: Design, law: str, seed: int) -> None:
    _of_worker["calibrator"] = Calibrator(design, load_law(law), seed)


def _one(number: int) -> dict[str, Any]:
    [record] = sbc.simulations(_of_worker["calibrator"], [number])
    return record


def all_records(
    design: Design, law: str, seed: int, numbers: Sequence[int], workers: int
) -> Iterator[dict[str, Any]]:
    """Calibrate campaign after campaign, in one process or several."""
    start = partial(_start_worker, design, law, seed)
    if workers == 1:
        start()
        yield from map(_one, numbers)
        return
    with get_context("spawn").Pool(workers, start) as pool:
        yield from pool.imap_unordered(_one, numbers)


def quantities_of(problem: HierarchicalProblem, law: Law) -> list[str]:
    """Everything that is ranked."""
    strengths = [mechanism.strength.name for mechanism in law.mechanisms]
    of_events = [f"{strength}_event_{event}" for event in EVENTS for strength in strengths]
    return [*campaigns.parameter_names(problem, law), *of_events, sbc.LOG_LIKELIHOOD]


def summarise(records: Sequence[dict[str, Any]], quantities: Sequence[str]) -> dict[str, Any]:
    """Counts of failures, uniformity of the ranks, and coverage, of each quantity."""
    summary = sbc.summarise(records, quantities)
    ranked = [record for record in records if "ranks" in record]
    for name, entry in summary["uniformity"].items():
        if name == sbc.LOG_LIKELIHOOD:
            continue
        covered = sum(record["covered"][name] for record in ranked)
        interval = binomtest(covered, len(ranked)).proportion_ci(0.95, method="wilson")
        entry["coverage_90"] = covered / len(ranked)
        entry["coverage_90_interval"] = [float(interval.low), float(interval.high)]
    if ranked:
        least = min(entry["ecdf_p"] for entry in summary["uniformity"].values())
        # With so many quantities one is outside its own band now and then.
        summary["least_ecdf_p_times_quantities"] = min(1.0, least * len(quantities))
        summary["surfaces_seconds"] = sum(record["surfaces_seconds"] for record in ranked)
        summary["slowest_seconds"] = max(record["seconds"] for record in ranked)
        summary["most_patches"] = max(record["patches"] for record in ranked)
    return summary


def draw_figure(file: Path, records: Sequence[dict[str, Any]], quantities: Sequence[str], title: str) -> None:
    """ECDF differences with their simultaneous bands."""
    from matplotlib.figure import Figure

    n_columns = 5
    n_rows = -(-len(quantities) // n_columns)
    figure = Figure(figsize=(2.9 * n_columns, 2.7 * n_rows + 0.4), layout="constrained")
    axes = figure.subplots(n_rows, n_columns, sharex=True, sharey=True, squeeze=False)
    for ax in axes.flat[len(quantities) :]:
        ax.set_axis_off()
    for ax, name in zip(axes.flat, quantities, strict=False):
        result = sbc.ranks_of(name, records)
        ax.fill_between(result.at, result.lower, result.upper, step="mid", color="0.85", label="95 % band")
        ax.axhline(0.0, color="0.6", linewidth=0.8)
        ax.step(result.at, result.ecdf_difference, where="mid", color="C0", label="ranks")
        words = name.replace("_", " ").replace("dry friction turbulent drag correlation", "correlation")
        ax.set_title(f"{words}\nECDF p {result.ecdf_p:.2f}", fontsize=10)
        ax.xaxis.set_tick_params(labelbottom=True)
    figure.supxlabel("rank of the truth / number of ranks", fontsize=10)
    figure.supylabel("ECDF - uniform", fontsize=10)
    axes[0, 0].legend(frameon=False, loc="upper left", fontsize=8)
    figure.suptitle(title)
    part = file.with_name(f".{file.name}.partial")
    figure.savefig(part, dpi=130, format="png")
    part.replace(file)


def show_coverage(summary: dict[str, Any]) -> None:
    """Print how often the intervals cover the truth."""
    for name, entry in summary["uniformity"].items():
        if "coverage_90" in entry:
            low, high = entry["coverage_90_interval"]
            print(f"{name}: 90 % intervals cover {entry['coverage_90']:.1%} ({low:.1%} to {high:.1%})")


def main(
    *,
    kind: Kind = "sparse",
    n: int = 200,
    seed: int = 0,
    law: str = "pcm",
    error_model: str = "robust",
    n_events: int | None = None,
    release_sd_m: float = 0.0,
    workers: int = 1,
    out: Path | None = None,
) -> int:
    """Calibrate a law on simulated campaigns and test the ranks of the truths.

    Parameters
    ----------
    kind
        Three velocities at Ryggfonn's sensors, or forty along its track; and the runout.
    n
        Number of campaigns; those that `out` holds already are not repeated.
    seed
        Seed of all randomness; campaign number i depends on it and on i alone.
    law
        Id of an installed law.
    error_model
        How readings scatter, in simulation and analysis.
    n_events
        Events in each campaign; 20 sparse or 12 dense ones by default.
    release_sd_m
        How uncertain the release places are.
    workers
        Number of processes.
    out
        Results as JSON; the figure goes beside it.
    """
    if not 1 <= n <= PRIOR_ROWS // 2:
        raise InputError(f"--n: expected 1 to {PRIOR_ROWS // 2}, found {n}")
    out = out or Path(f"benchmarks/results/hierarchical_sbc_{kind}.json")
    design = Design(kind, n_events or (20 if kind == "sparse" else 12), error_model, release_sd_m)
    problem, its_law = design.problem(), load_law(law)
    head = {
        "settings": {
            "law": law,
            "seed": seed,
            **design._asdict(),
            "n_sensors": problem.campaign.n_sensors,
            "place_sd_m": problem.place_sd_m,
            "source": campaigns.source_fingerprint(),
            "n_ranked": sbc.N_RANKED,
            "sampler": {key: value for key, value in asdict(SAMPLER).items() if key != "seed"},
            "retry": f"once, {sbc.SECOND_TRY} times the draws and adaptation, where the gate failed",
        },
        "versions": {name: version(name) for name in ("skred", "pymc", "pytensor", "numba", "numpy")},
    }
    quantities = quantities_of(problem, its_law)
    records = sbc.read(out, head)
    done = {record["number"] for record in records}
    missing = [number for number in range(n) if number not in done]
    if missing:
        out.parent.mkdir(parents=True, exist_ok=True)
        for record in all_records(design, law, seed, missing, workers):
            records = sorted([*records, json.loads(json.dumps(plain(record)))], key=lambda r: r["number"])
            sbc.write(out, head, records)
    summary = summarise(records, quantities)
    sbc.write(out, head, records, summary)
    title = f"Simulation-based calibration, hierarchical: {its_law.title}; {design.n_events} {kind} events"
    ranked = [record for record in records if "ranks" in record]
    if ranked:
        draw_figure(out.with_suffix(".png"), ranked, quantities, f"{title}, {len(ranked)} campaigns")
    sbc.show(summary, records, title)
    show_coverage(summary)
    covered = [entry["coverage_90"] for entry in summary["uniformity"].values() if "coverage_90" in entry]
    calibrated = bool(covered) and ASKED[0] <= min(covered) and max(covered) <= ASKED[1]
    return 0 if calibrated and not summary["errors"] else 1


if __name__ == "__main__":
    import sys

    from cyclopts import run

    try:
        sys.exit(run(main))
    except InputError as error:
        sys.exit(f"error: {error}")
