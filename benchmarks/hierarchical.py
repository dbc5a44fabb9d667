"""What the hierarchical likelihood costs: time to a passed gate, growth with events and gates, a peer.

``python -m benchmarks.hierarchical [--quick] [--only PART] [--json FILE]``. Seconds of the wall clock, in a
process whose compiled kernels come from the cache: surfaces (resolving each likelihood), compiling the
model and its step, and sampling 4 chains until the gate is passed (r-hat at most 1.01, 400 effective
draws; if not at once, once more with four times the draws, which counts). Of several seeds the median.

- ``ryggfonn``: its 22 sparse events, three laws.
- ``dense``: 15 simulated events with 40 gates and the runout, three laws.
- ``events``, ``gates``: surfaces and one log density against their number, PCM, with a fitted power.
- ``joint``: NUTS on the joint posterior of population and events (`peers.joint_nuts`) within a time
  budget, and ours, both with normal errors, PCM on Ryggfonn.
"""

# ruff: noqa: I001
from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Annotated, Any

from benchmarks import hierarchical_campaigns as campaigns
import numpy as np
from cyclopts import App, Parameter
from benchmarks.peers import joint_nuts
from rich.console import Console
from rich.table import Table
from benchmarks.sbc import SECOND_TRY

from skred.campaign import find_campaign, read_campaign
from skred.inference.gate import check_gate
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.physics.laws import load_law
from skred.physics.law import Law
from benchmarks.files import write
from skred.output import plain

Row = dict[str, Any]

LAWS = ("coulomb", "pcm", "constant")
SAMPLER = SamplerSettings("metropolis", draws=1000, tune=1000, chains=4)
WANTED_S = {"ryggfonn": 30.0, "dense": 60.0}
EVENTS, GATES, DENSE_EVENTS = (30, 100, 300, 1000), (5, 10, 20, 40, 80), 15
CHECKED_DRAWS = 40
NUTS = {"draws": 300, "tune": 300, "chains": 4, "budget_s": 120.0}


def fresh(problem: HierarchicalProblem) -> HierarchicalProblem:
    """The same without surfaces."""
    return campaigns.with_readings(problem, problem.readings)


def timed(make: Callable[[], Any]) -> tuple[Any, float]:
    """A result, and how long it took."""
    started = time.perf_counter()
    result = make()
    return result, time.perf_counter() - started


def to_the_gate(problem: HierarchicalProblem, law: Law, seed: int) -> Row:
    """One calibration from recordings to a passed gate."""
    problem = fresh(problem)
    surfaces, surfaces_s = timed(lambda: problem.surfaces(law.mechanisms))
    started = time.perf_counter()
    model = law.build(problem)
    prior = sample_prior(model, law, seed)
    step = JointMetropolis(model=model, pointwise="recordings")
    compile_s = time.perf_counter() - started
    names = campaigns.parameter_names(problem, law)
    started = time.perf_counter()
    for times in (1, SECOND_TRY):
        settings = replace(SAMPLER, draws=times * SAMPLER.draws, tune=times * SAMPLER.tune, seed=seed)
        tree = sample_posterior(model, law, problem, prior, settings, step=step)
        gate = check_gate(tree, names)
        if gate.passed:
            break
    sampling_s = time.perf_counter() - started
    posterior = tree["posterior"].to_dataset()
    draws = {name: posterior[name].values.ravel() for name in names}
    chosen = np.linspace(0, posterior[names[0]].size - 1, CHECKED_DRAWS).astype(int)
    errors, check_s = timed(
        lambda: problem.integration_errors(law, {name: values[chosen] for name, values in draws.items()})
    )
    return {
        "law": law.id,
        "seed": seed,
        "events": problem.campaign.n_events,
        "sensors": problem.campaign.n_sensors,
        "surfaces_s": surfaces_s,
        "compile_s": compile_s,
        "sampling_s": sampling_s,
        "seconds": surfaces_s + compile_s + sampling_s,
        "tries": 1 if times == 1 else 2,
        "gate": gate.as_dict(),
        "patches": surfaces.n_patches,
        "kernel_runs": surfaces.n_runs,
        "integration_check_s": check_s,
        "largest_integration_error_of_an_event": float(np.abs(errors).max()),
        "means": {name: float(values.mean()) for name, values in draws.items()},
    }


def warm(seed: int = 0) -> None:
    """Load every compiled kernel that is measured."""
    for law_id in LAWS:
        law = load_law(law_id)
        problem = simulated(campaigns.sparse_design(4), law, seed)
        problem.surfaces(law.mechanisms)


def simulated(design: HierarchicalProblem, law: Law, seed: int) -> HierarchicalProblem:
    """A campaign from a population like Ryggfonn's."""
    rng = np.random.default_rng([seed, 17])
    return campaigns.simulated(design, law, campaigns.typical_population(law), rng).problem


def ryggfonn(seeds: int) -> list[Row]:
    """Real campaign, three laws."""
    problem = hierarchical_problem(read_campaign(find_campaign("ryggfonn")))
    return [to_the_gate(problem, load_law(law), seed) for law in LAWS for seed in range(seeds)]


def dense(seeds: int) -> list[Row]:
    """Simulated dense campaigns, a new one for each seed, each law on its own data."""
    design = campaigns.dense_design(DENSE_EVENTS)
    rows = []
    for law_id in LAWS:
        law = load_law(law_id)
        rows += [to_the_gate(simulated(design, law, seed), law, seed) for seed in range(seeds)]
    return rows


def cost(designs: Sequence[tuple[int, HierarchicalProblem]], repeat: int) -> Row:
    """Seconds for surfaces and microseconds a density against a number, and the powers between them."""
    law, rows = load_law("pcm"), []
    for n, design in designs:
        problem = simulated(design, law, 0)
        times = []
        for _ in range(repeat):
            problem = fresh(problem)
            surfaces, seconds = timed(lambda: problem.surfaces(law.mechanisms))  # noqa: B023
            times.append(seconds)
        nodes, repeats = surfaces.nodes, max(2000 // problem.campaign.n_events, 5)
        us = 1e6 * min(_density_s(problem, law, repeats) for _ in range(5 * repeat))
        rows.append(
            {
                "n": n,
                "events": problem.campaign.n_events,
                "surfaces_s": min(times),
                "us_per_density": us,
                "patches": surfaces.n_patches,
                "nodes": len(nodes.log_weights),
                "kernel_runs": surfaces.n_runs,
            }
        )
    return {
        "rows": rows,
        "power_of_surfaces": power([r["n"] for r in rows], [r["surfaces_s"] for r in rows]),
        "power_of_density": power([r["n"] for r in rows], [r["us_per_density"] for r in rows]),
    }


def _density_s(problem: HierarchicalProblem, law: Law, repeats: int) -> float:
    """Seconds for the log density of all events at one population."""
    population = campaigns.typical_population(law)
    samples = {name: np.full(repeats, value) for name, value in population.items()}
    _, seconds = timed(lambda: problem.log_likelihood(law, samples))
    return float(seconds / repeats)


def power(n: Sequence[float], cost: Sequence[float]) -> float:
    """Slope of log cost against log number."""
    return float(np.polyfit(np.log(n), np.log(cost), 1)[0])


def joint(seed: int) -> Row:
    """NUTS with explicit strengths beside ours."""
    problem = hierarchical_problem(read_campaign(find_campaign("ryggfonn")), error_model="normal")
    law = load_law("pcm")
    names = campaigns.parameter_names(problem, law)
    ours = to_the_gate(problem, law, seed)
    drawn = joint_nuts.sample(problem, law, seed, campaigns.typical_population(law), **NUTS)  # type: ignore[arg-type]
    row: Row = {
        "settings": NUTS,
        "draws_of_chains": drawn.draws,
        "compile_s": drawn.compile_seconds,
        "seconds": drawn.seconds,
        "compared": None,
    }
    if drawn.tree is not None:
        posterior, stats = (drawn.tree[group].to_dataset() for group in ("posterior", "sample_stats"))
        row["compared"] = {
            "chains": posterior.sizes["chain"],
            "draws": posterior.sizes["draw"],
            "gate": check_gate(drawn.tree, names).as_dict(),
            "gradients_per_draw": float(stats["n_steps"].mean()),
            "means": {name: float(posterior[name].mean()) for name in names},
            "means_of_chains": {name: posterior[name].mean("draw").values.tolist() for name in names},
        }
    return {"ours": ours, "nuts": row}


# Telling


def medians(rows: Sequence[Row]) -> list[Row]:
    """One row for each law."""
    keys = ("surfaces_s", "compile_s", "sampling_s", "seconds", "patches")
    result = []
    for law in dict.fromkeys(row["law"] for row in rows):
        own = [row for row in rows if row["law"] == law]
        result.append(
            {
                "law": law,
                **{key: median(row[key] for row in own) for key in keys},
                "slowest": max(row["seconds"] for row in own),
                "passed": sum(row["gate"]["passed"] for row in own),
                "runs": len(own),
                "tries": max(row["tries"] for row in own),
                "r_hat": max(row["gate"]["r_hat_max"] for row in own),
                "ess": min(min(row["gate"]["ess_bulk_min"], row["gate"]["ess_tail_min"]) for row in own),
                "error": max(row["largest_integration_error_of_an_event"] for row in own),
            }
        )
    return result


def show(console: Console, found: Row) -> bool:
    """Print what was measured; whether all that was asked for is met."""
    met = True
    for part, wanted in WANTED_S.items():
        if part not in found:
            continue
        table = Table(
            title=f"{part}: seconds to a passed gate, wanted within {wanted:g}", title_justify="left"
        )
        columns = ("surfaces", "compile", "sampling", "all", "slowest", "gate passed", "r-hat", "ESS")
        for name in ("law", *columns, "patches", "worst error of an event"):
            table.add_column(name)
        for row in medians(found[part]):
            seconds = (row[k] for k in ("surfaces_s", "compile_s", "sampling_s", "seconds", "slowest"))
            table.add_row(
                row["law"],
                *(f"{value:.2f}" for value in seconds),
                f"{row['passed']} of {row['runs']}",
                f"{row['r_hat']:.4f}",
                f"{row['ess']:.0f}",
                f"{row['patches']:.0f}",
                f"{row['error']:.1e}",
            )
            met &= row["slowest"] <= wanted and row["passed"] == row["runs"]
        console.print(table)
    for part in ("events", "gates"):
        if part not in found:
            continue
        table = Table(title=f"cost against {part}", title_justify="left")
        for name in (part, "surfaces [s]", "density [us]", "patches", "kernel runs"):
            table.add_column(name, justify="right")
        for row in found[part]["rows"]:
            table.add_row(
                str(row["n"]),
                f"{row['surfaces_s']:.2f}",
                f"{row['us_per_density']:.1f}",
                str(row["patches"]),
                str(row["kernel_runs"]),
            )
        console.print(table)
        powers = found[part]["power_of_surfaces"], found[part]["power_of_density"]
        console.print(f"powers: surfaces {powers[0]:.2f}, density {powers[1]:.2f}")
    if "joint" in found:
        console.print_json(json.dumps(plain(found["joint"]["nuts"])))
        ours = found["joint"]["ours"]
        console.print(f"ours, normal errors: {ours['seconds']:.1f} s, {ours['means']}", highlight=False)
    return bool(met)


app = App(result_action="return_value")


@app.default
def main(
    *,
    seeds: int = 3,
    quick: bool = False,
    only: list[str] | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
) -> int:
    """Measure the hierarchical likelihood.

    Parameters
    ----------
    seeds
        How many runs of each law.
    quick
        One seed, no more than 100 events, a tenth of the time for NUTS.
    only
        Only these parts: ryggfonn, dense, events, gates, joint; with `json_file` the others are kept.
    json_file
        Store the figures here.
    """
    seeds = 1 if quick else seeds
    if quick:
        NUTS["budget_s"] *= 0.1
    events = [n for n in EVENTS if n <= 100] if quick else EVENTS
    parts: dict[str, Callable[[], Any]] = {
        "ryggfonn": lambda: ryggfonn(seeds),
        "dense": lambda: dense(seeds),
        "events": lambda: cost([(n, campaigns.sparse_design(n)) for n in events], 1 if quick else 2),
        "gates": lambda: cost(
            [(n, campaigns.dense_design(DENSE_EVENTS, n)) for n in GATES], 1 if quick else 3
        ),
        "joint": lambda: joint(1),
    }
    console = Console(width=150)
    found: Row = {}
    if json_file is not None and json_file.exists() and only:
        found = json.loads(json_file.read_text(encoding="utf-8"))
    found["machine"] = {"processor": platform.machine(), "versions": _versions()}
    warm()
    for name in only or parts:
        found[name] = parts[name]()
        found.setdefault("sources", {})[name] = campaigns.source_fingerprint()
        console.print(f"{name}: done", highlight=False)
        if json_file is not None:
            write(json_file, found)
    return 0 if show(console, found) else 1


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("pymc", "pytensor", "numba", "numpy")}


if __name__ == "__main__":
    raise SystemExit(app())
