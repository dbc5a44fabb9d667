"""Effective draws per CPU second of the pooled M2 posterior: skred's Metropolis and its peers.

``python -m benchmarks.sampling [--seeds 5] [--quick] [--json FILE]``. Every sampler draws from the
same posterior, on one thread, with its defaults except where `SAMPLERS` or its file in
``benchmarks/peers`` says otherwise; all adaptation counts, compilation is listed apart. How many
draws each makes is set so that every run takes some seconds: tuning then weighs as little as it
does in earnest. The measure is the smaller of the two parameters' bulk effective sample sizes over
all chains (ArviZ), over CPU seconds.

Two settings favour the peers. emcee and the runs marked "from mode" start near the posterior's
mode, found free of charge; the others, ours among them, start where PyMC puts them, from where
gradients can lead into a small mode beside a cliff of the likelihood. And emcee has a likelihood
compiled for it, without which the calls from Python would cost it more than the kernel.

A sampler is flagged if its r-hat is above 1.01 or a mean is off from that of all unflagged ones by
more than 4 Monte Carlo errors. With `--json`, every finished run is stored at once, and a run that
was killed goes on where it was when started again.
"""

# ruff: noqa: E402 I001
import benchmarks.peers.single_thread  # noqa: F401

import hashlib
import json
import logging
import traceback
import warnings
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import arviz as az
import numpy as np
from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

import skred.inference
import skred.physics
from models.pcm import LAW
from benchmarks.peers.common import PARAMETERS, Drawn
from skred.campaign import find_campaign, read_campaign
from skred.inference.pooled.problem import PooledProblem, pooled_problem
from benchmarks.files import rounded, write

Run = dict[str, Any]
"""One finished (sampler, seed): its figures, or its error."""

RHAT_LIMIT, MCSE_LIMIT, SAME_LOG_DENSITY = 1.01, 4.0, 1e-8
BAR = 20.0
"""How many times PyMC's default Metropolis ours has to reach."""
PACKAGES = ("pymc", "pytensor", "numba", "numpy", "arviz", "emcee", "nutpie", "numpyro", "jax")


class Sampler(NamedTuple):
    """A sampler with its settings.

    Attributes
    ----------
    name : str
    module : str
        Its file in ``benchmarks/peers``.
    settings, quick_settings : dict
        Keyword arguments of its `sample`; the latter replace some of them in a quick run.
    """

    name: str
    module: str
    settings: dict[str, Any]
    quick_settings: dict[str, Any]


def _sampler(name: str, module: str, draws: int, tune: int, quick: int, **others: Any) -> Sampler:
    return Sampler(name, module, {"draws": draws, "tune": tune, **others}, {"draws": quick})


OURS, BASELINE = "skred JointMetropolis", "PyMC Metropolis"
SAMPLERS = (
    _sampler(OURS, "joint_metropolis", 20_000, 1000, 4000),
    _sampler(BASELINE, "metropolis", 20_000, 1000, 4000),
    _sampler("emcee stretch", "emcee_ensemble", 6000, 200, 2000, moves="stretch"),
    _sampler("emcee DE", "emcee_ensemble", 4000, 200, 1000, moves="de"),
    _sampler("PyMC NUTS", "pymc_nuts", 1000, 1000, 500, start="default"),
    _sampler("PyMC NUTS from mode", "pymc_nuts", 5000, 1000, 1000, start="mode"),
    _sampler("nutpie", "nutpie_nuts", 10_000, 400, 2000, start="default"),
    _sampler("nutpie from mode", "nutpie_nuts", 10_000, 400, 2000, start="mode"),
    _sampler("NumPyro NUTS from mode", "numpyro_nuts", 3000, 500, 500),
)


class Results:
    """Finished runs, in a file if there is one.

    Raises
    ------
    ValueError
        If the file holds runs with other settings, versions or code.
    """

    def __init__(self, file: Path | None, header: dict[str, Any]) -> None:
        self._file, self._header = file, header
        self.runs: list[Run] = []
        if file is not None and file.exists():
            stored = json.loads(file.read_text())
            for key, expected in header.items():
                if stored.get(key) != rounded(expected):
                    raise ValueError(
                        f"{file}: made with other {key}: {stored.get(key)}, now {expected};"
                        " remove the file or name another"
                    )
            # What failed is tried again.
            self.runs = [run for run in stored["runs"] if "error" not in run]

    def has(self, sampler: str, seed: int) -> bool:
        """Whether this run is finished."""
        return any(run["sampler"] == sampler and run["seed"] == seed for run in self.runs)

    def add(self, run: Run) -> None:
        """Store a run; the file is never seen half written."""
        self.runs.append(run)
        if self._file is not None:
            write(self._file, {**self._header, "runs": self.runs})


def settings_of(sampler: Sampler, quick: bool) -> dict[str, Any]:
    """Keyword arguments of a sampler."""
    return {**sampler.settings, **(sampler.quick_settings if quick else {})}


def header(quick: bool) -> dict[str, Any]:
    """What runs must have in common to be compared."""
    code = hashlib.sha256()
    for package in (skred.physics, skred.inference):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            code.update(file.read_bytes())
    return {
        "settings": {sampler.name: settings_of(sampler, quick) for sampler in SAMPLERS},
        "versions": {name: version(name) for name in PACKAGES},
        "code": code.hexdigest()[:16],
    }


def check_log_density(problem: PooledProblem, module: Any) -> None:
    """Check a peer's own likelihood against skred's.

    Raises
    ------
    ValueError
        If they differ.
    """
    rng = np.random.default_rng(1)
    near = np.log([0.287, 0.00226]) + 0.2 * rng.standard_normal((10, 2))
    far = rng.uniform([-4.0, -10.0], [0.7, -4.0], size=(30, 2))
    strengths = np.exp(np.vstack([near, far]))
    ours = problem.log_density(LAW.mechanisms, strengths).sum(axis=1)
    theirs = module.log_density(problem, strengths)
    difference = np.max(np.abs(theirs - ours) / np.maximum(1.0, np.abs(ours)))
    if not difference <= SAME_LOG_DENSITY:
        raise ValueError(f"its log density differs from skred's by {difference:.1e}")


def figures_of(drawn: Drawn) -> Run:
    """What is kept of the draws."""
    figures: Run = {
        "shape": list(drawn.draws.shape),
        "cpu_seconds": drawn.cpu_seconds,
        "compile_seconds": drawn.compile_seconds,
    }
    for i, name in enumerate(PARAMETERS):
        draws = np.ascontiguousarray(drawn.draws[:, :, i])
        figures[name] = {
            "mean": float(draws.mean()),
            "sd": float(draws.std()),
            "mcse": float(az.mcse(draws)),
            "ess": float(az.ess(draws)),
            "rhat": float(az.rhat(draws)),
        }
    return figures


def run_once(problem: PooledProblem, sampler: Sampler, seed: int, quick: bool) -> Run:
    """One sampler with one seed; an error is a result."""
    record: Run = {"sampler": sampler.name, "seed": seed}
    try:
        module = import_module(f"benchmarks.peers.{sampler.module}")
        if hasattr(module, "log_density"):
            check_log_density(problem, module)
        drawn = module.sample(problem, seed, **settings_of(sampler, quick))
        return {**record, **figures_of(drawn)}
    except Exception as error:
        # Whatever a peer does, the others are still to be measured.
        return {**record, "error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc()}


def least_ess(run: Run) -> float:
    """Effective draws of the parameter that has fewer."""
    return min(run[name]["ess"] for name in PARAMETERS)


def largest_rhat(run: Run) -> float:
    """Largest r-hat, infinite where undefined."""
    rhats = np.array([run[name]["rhat"] for name in PARAMETERS])
    return float(np.max(np.where(np.isnan(rhats), np.inf, rhats)))


def pooled_means(runs: list[Run]) -> dict[str, tuple[float, float]]:
    """Mean and Monte Carlo error of each parameter over all runs that have converged.

    Weighted by precision; every sampler has the same weight per effective draw.
    """
    means = {}
    for name in PARAMETERS:
        figures = [run[name] for run in runs if largest_rhat(run) <= RHAT_LIMIT]
        weights = np.array([1.0 / figure["mcse"] ** 2 for figure in figures])
        values = np.array([figure["mean"] for figure in figures])
        mean = float((weights @ values) / weights.sum()) if figures else float("nan")
        means[name] = (mean, float(weights.sum() ** -0.5) if figures else float("nan"))
    return means


def flags_of(run: Run, means: dict[str, tuple[float, float]]) -> list[str]:
    """What is wrong with a run."""
    flags = []
    if not largest_rhat(run) <= RHAT_LIMIT:
        flags.append(f"r-hat {largest_rhat(run):.3f}")
    for name, (mean, error) in means.items():
        off = abs(run[name]["mean"] - mean) / np.hypot(run[name]["mcse"], error)
        if not off <= MCSE_LIMIT:
            flags.append(f"{name} off by {off:.1f} MCSE")
    return flags


class Summary(NamedTuple):
    """One sampler over its seeds."""

    name: str
    runs: list[Run]
    flags: list[str]
    errors: list[str]

    @property
    def rates(self) -> list[float]:
        """Effective draws per CPU second, per seed."""
        return [least_ess(run) / run["cpu_seconds"] for run in self.runs]

    @property
    def rate(self) -> float:
        """Their median; nothing where no run finished."""
        return float(np.median(self.rates)) if self.runs else float("-inf")

    @property
    def rate_with_compilation(self) -> float:
        """As `rate`, compilation included."""
        seconds = [run["cpu_seconds"] + run["compile_seconds"] for run in self.runs]
        return float(np.median([least_ess(run) / s for run, s in zip(self.runs, seconds, strict=True)]))

    def median(self, *keys: str) -> float:
        """Median over the seeds of a figure."""
        values = []
        for run in self.runs:
            value: Any = run
            for key in keys:
                value = value[key]
            values.append(value)
        return float(np.median(values))


def summaries_of(runs: list[Run]) -> list[Summary]:
    """Samplers, fastest first."""
    means = pooled_means([run for run in runs if "error" not in run])
    summaries = []
    for sampler in SAMPLERS:
        own = [run for run in runs if run["sampler"] == sampler.name]
        done = [run for run in own if "error" not in run]
        flags = [f"seed {run['seed']}: {flag}" for run in done for flag in flags_of(run, means)]
        errors = [f"seed {run['seed']}: {run['error']}" for run in own if "error" in run]
        if own:
            summaries.append(Summary(sampler.name, done, flags, errors))
    return sorted(summaries, key=lambda summary: -summary.rate)


def row_of(summary: Summary, baseline: float) -> list[str]:
    """Cells of a sampler's row."""
    state = "ok"
    if summary.flags:
        state = "FLAGGED"
    if summary.errors:
        state = "FAILED"
    if not summary.runs:
        return [summary.name, *["-"] * 9, state]
    mu, drag = PARAMETERS
    return [
        summary.name,
        f"{summary.rate:,.0f}",
        f"{min(summary.rates):,.0f}-{max(summary.rates):,.0f}",
        f"{summary.rate / baseline:.2f}",
        f"{np.median([least_ess(run) for run in summary.runs]):,.0f}",
        f"{summary.median('cpu_seconds'):.1f}",
        f"{summary.median('compile_seconds'):.1f}",
        f"{summary.rate_with_compilation:,.0f}",
        f"{summary.median(mu, 'mean'):.4f} ({summary.median(mu, 'sd'):.3f})",
        f"{1e3 * summary.median(drag, 'mean'):.3f} ({1e3 * summary.median(drag, 'sd'):.2f})",
        f"{max(largest_rhat(run) for run in summary.runs):.3f} {state}",
    ]


def table_of(summaries: list[Summary]) -> Table:
    """Table for people."""
    seeds = max(len(summary.runs) + len(summary.errors) for summary in summaries)
    table = Table(title=f"Pooled M2 posterior, medians over {seeds} seeds", title_justify="left")
    table.add_column("sampler", no_wrap=True)
    columns = ("ESS/CPU s", "range", "times Metropolis", "ESS", "CPU s", "compile s", "ESS/s with it")
    for name in (*columns, "mu (sd)", "D (sd) [1/km]", "r-hat"):
        table.add_column(name, justify="right", no_wrap=True)
    baseline = rate_of(summaries, BASELINE)
    for summary in summaries:
        table.add_row(*row_of(summary, baseline))
    return table


def rate_of(summaries: list[Summary], name: str) -> float:
    """Rate of one sampler, NaN where it has none."""
    return next((s.rate for s in summaries if s.name == name and s.runs), float("nan"))


def verdicts(summaries: list[Summary]) -> list[tuple[bool, str]]:
    """Whether the bars are met, so far as what they compare was run."""
    ours, baseline = rate_of(summaries, OURS), rate_of(summaries, BASELINE)
    # A peer that has not converged is ahead of nobody.
    peers = [s for s in summaries if s.name != OURS and s.runs and not s.flags]
    best = max(peers, key=lambda s: s.rate, default=None)
    sound = all(not s.flags and not s.errors for s in summaries if s.name == OURS)
    results = []
    if any(s.name == OURS for s in summaries):
        results.append((sound, "every run of ours converged to the common mean"))
    if np.isfinite(ours / baseline):
        results.append((ours >= BAR * baseline, f"{ours / baseline:.1f} times {BASELINE} (bar {BAR:g})"))
    if np.isfinite(ours) and best is not None:
        ratio = ours / best.rate
        results.append((ratio > 1.0, f"{ratio:.2f} times the best peer, {best.name} (bar 1)"))
    return results


def report(console: Console, summaries: list[Summary]) -> bool:
    """Print everything; whether all bars are met."""
    console.print(table_of(summaries))
    for summary in summaries:
        for line in (*summary.flags, *summary.errors):
            console.print(f"{summary.name}, {line}", style="yellow", highlight=False, markup=False)
    results = verdicts(summaries)
    for met, text in results:
        console.print(f"{'met   ' if met else 'MISSED'} {text}", highlight=False)
    return all(met for met, _ in results)


def quieten() -> None:
    """Peers' notices that would tear the progress lines apart; what matters of them is in the table."""
    warnings.filterwarnings("ignore", message="overflow encountered in exp", category=RuntimeWarning)
    logging.getLogger("pymc").setLevel(logging.ERROR)


app = App(result_action="return_value")


@app.default
def main(
    *,
    seeds: int = 5,
    quick: bool = False,
    only: list[str] | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> int:
    """Compare samplers on the pooled M2 posterior.

    Parameters
    ----------
    seeds
        How many runs of each sampler.
    quick
        One seed and few draws.
    only
        Only samplers whose names contain one of these.
    json_file
        Store every finished run here, and go on from what is there.
    """
    quieten()
    console = Console(width=170)
    problem = pooled_problem(read_campaign(find_campaign("ryggfonn")))
    try:
        results = Results(json_file, header(quick))
    except ValueError as error:
        console.print(error, style="red", markup=False, highlight=False)
        return 2
    for seed in range(1, (1 if quick else seeds) + 1):
        for sampler in SAMPLERS:
            wanted = not only or any(part in sampler.name for part in only)
            if not wanted or results.has(sampler.name, seed):
                continue
            record = run_once(problem, sampler, seed, quick)
            results.add(record)
            done = "failed" if "error" in record else f"{record['cpu_seconds']:.1f} CPU s"
            console.print(f"seed {seed}, {sampler.name}: {done}", highlight=False)
    return 0 if report(console, summaries_of(results.runs)) else 1


if __name__ == "__main__":
    raise SystemExit(app())
