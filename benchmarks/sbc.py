"""Simulation-based calibration of a pooled law on the design of the Ryggfonn campaign.

``python -m benchmarks.sbc [--n 200] [--seed 0] [--law pcm] [--out benchmarks/results/sbc.json]``.

Again and again: true parameters from the prior; latent readings y_e ~ N(m(theta), Sigma) of the campaign's
events; what the likelihood takes a recording for (a front velocity of at most 0 is not reached, a reading
that the real campaign misses is missing); the posterior by the sampler that skred uses; and the rank of the
truth among its draws, for each parameter and, sensitive to more errors than they are, for the
log-likelihood (Modrak and others, 2023, doi 10.1214/23-BA1404). If model, likelihood and sampler belong
together all ranks are uniform (Talts and others, 2018, arXiv 1804.06788), prior corners included where no
front moves or all run off the track.

Uniformity is judged by chi-square, and by the band that holds the whole ECDF with 95 % (Sailynoja, Burkner
and Vehtari, 2022, doi 10.1007/s11222-022-10090-6). Every simulation counts: those that raise an error are
listed, and those whose chains fail the gate, after one more try with four times the draws, are kept and
counted. Each is written as soon as it is done; the same command goes on with a run that was ended.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pymc as pm
import pytensor
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import binom, chisquare

from benchmarks import files
from skred.campaign import Status, find_campaign, read_campaign
from skred.errors import InputError
from skred.inference.gate import check_gate
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.pooled.density import PooledArrays
from skred.inference.pooled.problem import PooledProblem, pooled_problem
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.output import plain
from skred.physics.law import Law
from skred.physics.laws import load_law

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SAMPLER = SamplerSettings("metropolis", draws=200, tune=250, chains=4)
SECOND_TRY = 4
"""How many times more draws and adaptation where the gate failed."""
N_RANKED = 199
"""Thinned draws that a truth is ranked among: 200 possible ranks."""
PRIOR_ROWS = 10_000
LOG_LIKELIHOOD = "log_likelihood"
BAND = 0.95
_UNIFORM_SAMPLES = 4000
_MOST_BINS, _FEWEST_IN_A_BIN = 20, 5


# Ranks and their uniformity


@dataclass(frozen=True, eq=False)
class Uniformity:
    """How far ranks are from uniform.

    Attributes
    ----------
    n : int
        Number of ranks.
    n_bins : int
    chi_square_p : float
        Of equal counts in the bins.
    ecdf_p : float
        Of the pointwise least likely value of the ECDF.
    at : (n_points,) array
        Where the ECDF is compared, in (0, 1).
    ecdf_difference, lower, upper : (n_points,) array
        ECDF and the ends of its simultaneous band, less the uniform distribution.
    """

    n: int
    n_bins: int
    chi_square_p: float
    ecdf_p: float
    at: FloatArray
    ecdf_difference: FloatArray
    lower: FloatArray
    upper: FloatArray

    @property
    def inside_band(self) -> bool:
        """Whether the whole ECDF lies inside its band."""
        return bool(np.all((self.ecdf_difference >= self.lower) & (self.ecdf_difference <= self.upper)))


def uniformity(ranks: Sequence[int] | IntArray, n_ranked: int = N_RANKED, band: float = BAND) -> Uniformity:
    """Compare ranks in 0..n_ranked with the uniform distribution on those numbers."""
    ranks = np.asarray(ranks)
    n, n_values = len(ranks), n_ranked + 1
    bins = [b for b in range(2, _MOST_BINS + 1) if n_values % b == 0 and n >= _FEWEST_IN_A_BIN * b]
    n_bins = max(bins, default=2)
    counts = np.bincount(ranks * n_bins // n_values, minlength=n_bins)
    at = np.arange(1, n_values) / n_values
    below = _counts_below(ranks[None], n_values)[0]
    # The pointwise level at which a band holds whole uniform ECDFs with the probability asked for.
    of_uniform = _least_likely_of_uniform(n, n_values)
    level = np.quantile(of_uniform, 1 - band)
    return Uniformity(
        n,
        n_bins,
        float(chisquare(counts).pvalue),
        float(np.mean(of_uniform <= _least_likely(below, n, at))),
        at,
        below / n - at,
        binom.ppf(level / 2, n, at) / n - at,
        binom.isf(level / 2, n, at) / n - at,
    )


def _counts_below(ranks: IntArray, n_values: int) -> IntArray:
    """How many of each row's ranks are below 1, 2, ..., n_values - 1."""
    flat = ranks + n_values * np.arange(len(ranks))[:, None]
    counts = np.bincount(flat.ravel(), minlength=n_values * len(ranks)).reshape(len(ranks), n_values)
    return np.cumsum(counts, axis=1)[:, :-1]


def _least_likely(below: IntArray, n: int, at: FloatArray) -> Any:
    """Smallest two-sided tail probability of an ECDF over all its points."""
    tails = 2 * np.minimum(binom.cdf(below, n, at), binom.sf(below - 1, n, at))
    return np.minimum(tails, 1.0).min(axis=-1)


@cache
def _least_likely_of_uniform(n: int, n_values: int) -> FloatArray:
    """`_least_likely` of many samples of uniform ranks."""
    rng = np.random.default_rng(1)
    below = _counts_below(rng.integers(n_values, size=(_UNIFORM_SAMPLES, n)), n_values)
    least: FloatArray = _least_likely(below, n, np.arange(1, n_values) / n_values)
    return least


def rank(truth: float, draws: FloatArray, rng: np.random.Generator) -> int:
    """Rank of a number among draws; where it equals some, anywhere among those."""
    return int(np.sum(draws < truth) + rng.integers(np.sum(draws == truth) + 1))


def thin(draws: FloatArray, n: int) -> FloatArray:
    """`n` of (chain, draw) draws, evenly spaced."""
    flat = draws.ravel()
    return flat[np.linspace(0, flat.size - 1, n).round().astype(int)]


# One simulation


class Calibrator:
    """Simulates campaigns of one design and calibrates a law on them, compiled once for all.

    Parameters
    ----------
    problem : PooledProblem
        Whose track, sensors, events, gaps and Sigma are taken.
    law : Law
    seed : int
    settings : SamplerSettings
    analysed : callable
        Problem with simulated recordings to the one that is calibrated: the same, unless an error is
        to be planted.
    """

    def __init__(
        self,
        problem: PooledProblem,
        law: Law,
        seed: int,
        settings: SamplerSettings = SAMPLER,
        analysed: Callable[[PooledProblem], PooledProblem] = lambda problem: problem,
    ) -> None:
        self.problem, self.law, self.seed, self.settings, self.analysed = (
            problem,
            law,
            seed,
            settings,
            analysed,
        )
        # The law's own model, with the recordings in shared variables that every simulation sets anew.
        template = replace(problem)
        self._shared = [pytensor.shared(array) for array in problem.arrays]
        template.__dict__["arrays"] = PooledArrays(*self._shared)
        self.model: pm.Model = law.build(template)
        self.step = JointMetropolis(model=self.model, pointwise="recordings")
        self.truths = sample_prior(self.model, law, seed, PRIOR_ROWS)

    def simulate(self, number: int) -> tuple[dict[str, float], PooledProblem]:
        """True parameters of one simulation, and the problem with what would have been recorded."""
        rng = np.random.default_rng([self.seed, number, 0])
        truth = {name: float(self.truths[name].values[0, number]) for name in self.law.parameter_names}
        [mean] = self.problem.simulate(self.law.mechanisms, self.law.strength_rows(truth))
        factor = np.linalg.cholesky(self.problem.covariance)
        return truth, recorded(self.problem, mean + rng.standard_normal(mean.shape) @ factor.T)

    def calibrate(self, number: int) -> dict[str, Any]:
        """Ranks and diagnostics of one simulation."""
        truth, problem = self.simulate(number)
        problem = self.analysed(problem)
        for shared, array in zip(self._shared, problem.arrays, strict=True):
            shared.set_value(array)
        started = time.monotonic()
        for attempt in (1, 2):
            posterior = self._sample(problem, number, SECOND_TRY if attempt == 2 else 1)
            gate = check_gate(posterior, self.law.parameter_names)
            if gate.passed:
                break
        rng = np.random.default_rng([self.seed, number, 1])
        parameters = posterior["posterior"].to_dataset()
        draws = {name: thin(parameters[name].values, N_RANKED) for name in self.law.parameter_names}
        ranks = {name: rank(truth[name], draws[name], rng) for name in truth}
        ranks[LOG_LIKELIHOOD] = rank(
            self._log_likelihood(problem, truth)[0], self._log_likelihood(problem, draws), rng
        )
        return {
            "number": number,
            "truth": truth,
            "ranks": ranks,
            "not_reached": int(problem.not_reached.sum()),
            "attempts": attempt,
            "gate": gate.as_dict(),
            "seconds": round(time.monotonic() - started, 3),
        }

    def _sample(self, problem: PooledProblem, number: int, times: int) -> xr.DataTree:
        seed = int(np.random.SeedSequence([self.seed, number, 1 + times]).generate_state(1)[0] >> 1)
        settings = replace(
            self.settings, draws=times * self.settings.draws, tune=times * self.settings.tune, seed=seed
        )
        # Starting points come from the prior as ever, but not from the row that holds the truth.
        rows = self.truths.isel(draw=slice(PRIOR_ROWS // 2, None))
        return sample_posterior(
            self.model, self.law, problem, rows.roll(draw=number), settings, step=self.step
        )

    def _log_likelihood(self, problem: PooledProblem, parameters: Any) -> FloatArray:
        rows = self.law.strength_rows(parameters)
        return np.asarray(problem.log_density(self.law.mechanisms, rows).sum(axis=1))


def recorded(problem: PooledProblem, latent: FloatArray) -> PooledProblem:
    """What instruments make of latent readings (event, sensor): Tobit, with the gaps of the campaign."""
    is_runout = np.array([sensor.is_runout for sensor in problem.campaign.sensors])
    status = np.where((latent <= 0) & ~is_runout, Status.NOT_REACHED, Status.OBSERVED)
    status = np.where(problem.campaign.status == Status.MISSING, Status.MISSING, status)
    values = np.where(status == Status.OBSERVED, latent, np.nan)
    campaign = replace(problem.campaign, origin="simulated", values=values, status=status)
    return replace(problem, campaign=campaign)


# Many simulations


class Calibrates(Protocol):
    """What analyses one simulation after the other."""

    def calibrate(self, number: int) -> dict[str, Any]:
        """Ranks and diagnostics of one simulation."""


def simulations(calibrator: Calibrates, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Calibrate simulation after simulation; one that raises an error says so in its record."""
    for number in numbers:
        try:
            yield calibrator.calibrate(number)
        except Exception as error:  # to be counted, whatever it is
            yield {"number": number, "error": f"{type(error).__name__}: {error}"}


def summarise(records: Sequence[dict[str, Any]], quantities: Sequence[str]) -> dict[str, Any]:
    """Counts of failures, and the uniformity of each quantity's ranks."""
    ranked = [record for record in records if "ranks" in record]
    passed = [record for record in ranked if record["gate"]["passed"]]
    return {
        "n": len(records),
        "errors": len(records) - len(ranked),
        "gate_failed": len(ranked) - len(passed),
        "second_tries": sum(record["attempts"] > 1 for record in ranked),
        "seconds": sum(record["seconds"] for record in ranked),
        "uniformity": {name: _entry(name, ranked, passed) for name in quantities} if ranked else {},
    }


def _entry(name: str, ranked: Sequence[dict[str, Any]], passed: Sequence[dict[str, Any]]) -> dict[str, Any]:
    result = ranks_of(name, ranked)
    only_passed = ranks_of(name, passed) if passed else None
    return {
        "n": result.n,
        "bins": result.n_bins,
        "chi_square_p": result.chi_square_p,
        "ecdf_p": result.ecdf_p,
        "ecdf_inside_band": result.inside_band,
        "ecdf_p_of_passed": only_passed.ecdf_p if only_passed else None,
    }


def ranks_of(name: str, records: Sequence[dict[str, Any]]) -> Uniformity:
    """Uniformity of one quantity's ranks."""
    return uniformity([record["ranks"][name] for record in records])


def write(file: Path, head: dict[str, Any], records: Sequence[dict[str, Any]], summary: Any = None) -> None:
    """Write all that is known so far, whole or not at all; simulations in columns, one entry for each."""
    files.write(file, {**head, "summary": summary, "simulations": files.as_columns(records)})


def read(file: Path, head: dict[str, Any]) -> list[dict[str, Any]]:
    """Simulations of an earlier run with the same settings.

    Raises
    ------
    InputError
        If the file is of other settings.
    """
    if not file.exists():
        return []
    earlier = files.read(file)
    if earlier["settings"] != files.rounded(plain(head["settings"])):
        raise InputError(f"{file}: holds a run with other settings; choose another --out or delete it")
    return files.as_rows(earlier["simulations"])


def draw_figure(file: Path, records: Sequence[dict[str, Any]], quantities: Sequence[str], title: str) -> None:
    """ECDF differences with their simultaneous bands."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6 * len(quantities), 3.4), layout="constrained")
    axes = figure.subplots(1, len(quantities), sharey=True, squeeze=False)[0]
    for ax, name in zip(axes, quantities, strict=True):
        result = ranks_of(name, records)
        ax.fill_between(result.at, result.lower, result.upper, step="mid", color="0.85", label="95 % band")
        ax.axhline(0.0, color="0.6", linewidth=0.8)
        ax.step(result.at, result.ecdf_difference, where="mid", color="C0", label="ranks")
        ax.set_title(
            f"{name.replace('_', ' ')}\nchi-square p {result.chi_square_p:.2f}, ECDF p {result.ecdf_p:.2f}"
        )
        ax.set_xlabel("rank of the truth / number of ranks")
    axes[0].set_ylabel("ECDF - uniform")
    axes[0].legend(frameon=False, loc="upper left")
    figure.suptitle(title)
    partial = file.with_name(f".{file.name}.partial")
    figure.savefig(partial, dpi=150, format="png")
    partial.replace(file)
    files.shrink(file)


def show(summary: dict[str, Any], records: Sequence[dict[str, Any]], title: str) -> None:
    """Print a table, and every failure."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(width=110)
    table = Table(title=title, title_justify="left")
    table.add_column("quantity")
    for name in ("ranks", "chi-square p", "ECDF p", "ECDF p, gate passed"):
        table.add_column(name, justify="right")
    table.add_column("95 % band")
    for name, entry in summary["uniformity"].items():
        of_passed = entry["ecdf_p_of_passed"]
        table.add_row(
            name,
            str(entry["n"]),
            f"{entry['chi_square_p']:.3f}",
            f"{entry['ecdf_p']:.3f}",
            "-" if of_passed is None else f"{of_passed:.3f}",
            "inside" if entry["ecdf_inside_band"] else "OUTSIDE",
        )
    console.print(table)
    console.print(
        f"{summary['n']} simulations, {summary['seconds']:.0f} s of refits: {summary['errors']} errors,"
        f" {summary['gate_failed']} failed the gate, {summary['second_tries']} needed a second try"
    )
    for record in records:
        if "error" in record:
            console.print(Text(f"simulation {record['number']}: {record['error']}"))
        elif not record["gate"]["passed"]:
            console.print(Text(f"simulation {record['number']}: {'; '.join(record['gate']['problems'])}"))


def main(
    *,
    n: int = 200,
    seed: int = 0,
    law: str = "pcm",
    campaign: str = "ryggfonn",
    out: Path = Path("benchmarks/results/sbc.json"),
) -> int:
    """Calibrate a law on simulated campaigns and test the ranks of the truths.

    Parameters
    ----------
    n
        Number of simulations; those that `out` holds already are not repeated.
    seed
        Seed of all randomness; simulation number i depends on it and on i alone.
    law
        Id of an installed law.
    campaign
        Whose design is used: a folder, or the name of an embedded campaign.
    out
        Results as JSON; the figure goes beside it.
    """
    if not 1 <= n <= PRIOR_ROWS // 2:
        raise InputError(f"--n: expected 1 to {PRIOR_ROWS // 2}, found {n}")
    problem, its_law = pooled_problem(read_campaign(find_campaign(campaign))), load_law(law)
    head = {
        "settings": {
            "law": law,
            "seed": seed,
            "campaign": problem.campaign.name,
            "campaign_fingerprint": problem.campaign.fingerprint(),
            "smoothing_m": problem.terrain.smoothing_m,
            "n_cells": problem.terrain.n_cells,
            "n_ranked": N_RANKED,
            "sampler": {key: value for key, value in asdict(SAMPLER).items() if key != "seed"},
        },
        "versions": {name: version(name) for name in ("skred", "pymc", "pytensor", "numba", "numpy")},
    }
    quantities = [*its_law.parameter_names, LOG_LIKELIHOOD]
    records = read(out, head)
    done = {record["number"] for record in records}
    missing = [number for number in range(n) if number not in done]
    if missing:
        out.parent.mkdir(parents=True, exist_ok=True)
        calibrator = Calibrator(problem, its_law, seed)
        for record in simulations(calibrator, missing):
            records.append(record)
            write(out, head, records)
    summary = summarise(records, quantities)
    write(out, head, records, summary)
    title = f"Simulation-based calibration: {its_law.title}, {problem.campaign.name} design"
    ranked = [record for record in records if "ranks" in record]
    if ranked:
        draw_figure(out.with_suffix(".png"), ranked, quantities, f"{title}, {len(ranked)} simulations")
    show(summary, records, title)
    calibrated = all(entry["ecdf_inside_band"] for entry in summary["uniformity"].values())
    return 0 if ranked and calibrated and not summary["errors"] else 1


if __name__ == "__main__":
    import sys

    from cyclopts import run

    try:
        sys.exit(run(main))
    except InputError as error:
        sys.exit(f"error: {error}")
