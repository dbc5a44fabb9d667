"""Write benchmarks/README.md from the result files beside it.

``python -m benchmarks.page``, after the benchmarks were run with
``--json benchmarks/results/NAME.json`` (the commands stand in the page).
"""

from statistics import median
from typing import Any

import cyclopts

from benchmarks.files import RESULTS
from benchmarks.page.diagnosis import diagnosis
from benchmarks.page.results import result_of
from skred.output import write_text

HEAD = """# Benchmarks

Written by `python -m benchmarks.page` from `benchmarks/results/`; each section names the command
that measured it. One machine, two cores (AMD EPYC, 2.6 GHz nominal), other work on the second core while
sampling; times are the best of several, and ratios are within one run.
"""


def forward() -> str:
    """The kernel beside plain loops."""
    times = result_of("forward")
    difference = times.pop("largest relative difference")
    peer, python = times["plain numba loop"], times["pure Python"]
    rows = "".join(
        f"| {name} | {us:.2f} | {peer / us:.1f} | {python / us:.0f} |\n" for name, us in times.items()
    )
    plain, many = times["kernel"], times["kernel, 16 times as many"]
    switching = times["kernel, normal force switching (M1)"] / plain
    in_u = times["kernel, terms in U"] / plain, times["kernel, terms in U, 16 times as many"] / many
    return f"""
## The kernel

`python -m benchmarks.forward --json benchmarks/results/forward.json`: 22 fronts with 22 parameter vectors
on the 394 cells of Ryggfonn, four sensors, microseconds per trajectory.

| what | us | numba loop / it | Python / it |
| --- | --- | --- | --- |
{rows}
Asked: at most 1 us (measured {plain:.2f}), or 10 times faster than the numba loop and 200 times than
Python (measured {peer / plain:.1f} and {python / plain:.0f}: the plain loop stops computing where the
front stops, and is itself far faster than the 8 to 15 us it was expected to take). Largest relative
difference from the reference over the prior's range {difference:.1e} (asked: below 1e-10).

Asked, too: fronts that leave the ground (M1) and terms in U within 2 times the plain kernel. Measured:
{switching:.1f} times, and {in_u[0]:.1f} ({in_u[1]:.1f} with 16 times as many fronts): with such a term no
cell has a closed form, and its speed is solved for, two of Newton's steps in each.
"""


def logp() -> str:
    """One evaluation of the log density."""
    result = result_of("logp")
    rows = "".join(
        f"| {row['way']}{', with gradient' if row['gradient'] else ''} | {row['call_us']:.1f} |"
        f" {row['ratio']:.1f} | {row['compile_s']:.1f} |\n"
        for row in result["timings"]
    )
    return f"""
## One log density

`python -m benchmarks.logp --json benchmarks/results/logp.json`: the pooled PCM model on Ryggfonn. Asked: the
numba dispatch at least 2 times faster than `perform`, 15 times faster than `pytensor.scan`.

| way | us a call | times the dispatch | compile [s] |
| --- | --- | --- | --- |
{rows}"""


def sampling() -> str:
    """Effective draws per CPU second."""
    result = result_of("sampling")
    names = list(dict.fromkeys(run["sampler"] for run in result["runs"]))
    rows = [_sampler(name, [r for r in result["runs"] if r["sampler"] == name]) for name in names]
    rows.sort(key=lambda row: -row["rate"])
    base = next(row["rate"] for row in rows if row["name"] == "PyMC Metropolis")
    table = "".join(
        f"| {row['name']} | {row['rate']:.0f} | {row['low']:.0f}-{row['high']:.0f} |"
        f" {row['rate'] / base:.1f} | {row['compile']:.1f} | {row['r_hat']:.3f} | {row['mean']:.4f} |\n"
        for row in rows
    )
    ours = next(row for row in rows if row["name"].startswith("skred"))
    peers = [row for row in rows if row is not ours and row["r_hat"] <= 1.01]
    best = max(peers, key=lambda row: row["rate"])
    return f"""
## Sampling

`python -m benchmarks.sampling --seeds 5 --json benchmarks/results/sampling.json`: bulk effective draws per
CPU second of the pooled PCM posterior on Ryggfonn, the smaller of both parameters, adaptation included,
compilation apart; median and range over {ours["seeds"]} seeds. The result file holds all settings.

| sampler | ESS / CPU s | range | times PyMC's default Metropolis | compile [s] | largest r-hat | mean mu |
| --- | --- | --- | --- | --- | --- | --- |
{table}
Asked: 20 times PyMC's default Metropolis (measured {ours["rate"] / base:.1f}) and ahead of every other
sampler (measured {ours["rate"] / best["rate"]:.2f} times the best that converged, {best["name"]}). The
two parameters are all but uncorrelated in this posterior, so one scalar at a time does far better than on a
ridge: PyMC's default gives {base:.0f} here where 50 to 66 were expected. About half of our time is PyMC's
own work per draw.
"""


def _sampler(name: str, runs: list[dict[str, Any]]) -> dict[str, Any]:
    parameters = ("dry_friction", "turbulent_drag")
    done = [run for run in runs if "dry_friction" in run]
    rates = [min(run[p]["ess"] for p in parameters) / run["cpu_seconds"] for run in done]
    return {
        "name": name,
        "seeds": len(done),
        "rate": median(rates),
        "low": min(rates),
        "high": max(rates),
        "compile": median(run["compile_seconds"] for run in done),
        "r_hat": max(run[p]["rhat"] for run in done for p in parameters),
        "mean": median(run["dry_friction"]["mean"] for run in done),
    }


def calibration() -> str:
    """Simulation-based calibration."""
    summary = result_of("sbc")["summary"]
    rows = "".join(
        f"| {name} | {row['chi_square_p']:.2f} | {row['ecdf_p']:.2f} | {row['ecdf_p_of_passed']:.2f} |"
        f" {'inside' if row['ecdf_inside_band'] else 'OUTSIDE'} |\n"
        for name, row in summary["uniformity"].items()
    )
    return f"""
## Simulation-based calibration

`python -m benchmarks.sbc --n 200 --seed 0`: {summary["n"]} data sets from the prior, the pooled PCM model
refitted to each; are the ranks of the truth uniform?

| quantity | chi-square p | ECDF p | ECDF p, gate passed | 95 % band |
| --- | --- | --- | --- | --- |
{rows}
{summary["errors"]} refits ended in an error. {summary["gate_failed"]} still failed the gate of convergence
after a second try with four times the draws; they are kept in the ranks. Of seven such that were looked at,
five had true fronts that leave the track's end and two fronts that stop high up: corners of a vague prior.

![Rank ECDF less uniform, with 95 % band](results/sbc.png)
"""


def hierarchical() -> str:
    """What the hierarchical likelihood costs."""
    found = result_of("hierarchical")
    heads = {
        "ryggfonn": "Ryggfonn, 22 events with up to four readings; wanted within 30 s",
        "dense": "simulated, 15 events with 40 gates and the runout; wanted within 60 s",
    }
    tables = "".join(_to_the_gate(head, found[part]) for part, head in heads.items())
    return f"""
## The hierarchical likelihood: what it costs

`python -m benchmarks.hierarchical --json benchmarks/results/hierarchical.json`: seconds from recordings to a
passed gate (r-hat at most 1.01, 400 effective draws), medians over the seeds, kernels from the cache.
The error is the largest of an event's integrated log density over posterior draws, against much finer
integration.
{tables}{_growth("events", "sparse events", found["events"])}{_growth("gates", "gates", found["gates"])}
{_joint(found["joint"])}"""


def _to_the_gate(head: str, runs: list[dict[str, Any]]) -> str:
    rows = ""
    for law in dict.fromkeys(run["law"] for run in runs):
        own = [run for run in runs if run["law"] == law]
        surfaces, compiling, sampling, whole = (
            median(run[key] for run in own) for key in ("surfaces_s", "compile_s", "sampling_s", "seconds")
        )
        rows += (
            f"| {law} | {surfaces:.2f} | {compiling:.1f} | {sampling:.1f} | {whole:.1f} |"
            f" {max(run['seconds'] for run in own):.1f} |"
            f" {sum(run['gate']['passed'] for run in own)} of {len(own)} |"
            f" {max(run['largest_integration_error_of_an_event'] for run in own):.1e} |\n"
        )
    return f"""
{head[0].upper()}{head[1:]}:

| law | surfaces | compile | sampling | all | slowest | gate passed | error [nats] |
| --- | --- | --- | --- | --- | --- | --- | --- |
{rows}"""


def _growth(part: str, words: str, found: dict[str, Any]) -> str:
    rows = "".join(
        f"| {row['n']} | {row['surfaces_s']:.2f} | {row['us_per_density']:.0f} | {row['patches']} |"
        f" {row['kernel_runs']} |\n"
        for row in found["rows"]
    )
    return f"""
| {words} | surfaces [s] | one density [us] | patches | runs of the kernel |
| --- | --- | --- | --- | --- |
{rows}
Fitted powers of the number of {part}: {found["power_of_surfaces"]:.2f} of the surfaces,
{found["power_of_density"]:.2f} of the density.
"""


def _joint(found: dict[str, Any]) -> str:
    ours, nuts = found["ours"], found["nuts"]
    settings, compared = nuts["settings"], nuts["compared"]
    draws = ", ".join(str(n) for n in nuts["draws_of_chains"])
    result = f"Its chains made {draws} draws after tuning"
    if compared is None:
        result += ": too few to compare."
    else:
        gate = compared["gate"]
        result += (
            f"; over the first {compared['draws']} of the {compared['chains']} that\nmade half: r-hat"
            f" {gate['r_hat_max']:.2f}, {gate['ess_bulk_min']:.0f} effective draws, {gate['divergences']}"
            f" divergences, {compared['gradients_per_draw']:.0f}\ngradients a draw."
        )
    chains = f"{settings['chains']} chains of {settings['tune']} + {settings['draws']} draws"
    gate = ours["gate"]
    budget = f"{settings['budget_s']:.0f} s"
    return f"""NUTS on the joint posterior (PyMC, strengths of every event explicit and non-centred, PCM on
Ryggfonn, normal errors on both sides), started at the pooled posterior's mean, was given {budget} for
{chains}; it took {nuts["seconds"]:.0f} s and {nuts["compile_s"]:.0f} s to compile.
{result}
Ours took {ours["seconds"]:.1f} s: r-hat {gate["r_hat_max"]:.4f}, {gate["ess_bulk_min"]:.0f} effective draws.
"""


def hierarchical_calibration() -> str:
    """Simulation-based calibration of the hierarchical likelihood."""
    return f"""
## Simulation-based calibration, hierarchical

`python -m benchmarks.hierarchical_sbc --kind sparse` and `--kind dense`: populations from the PCM
model's prior, campaigns simulated event by event with outliers and with the stop as it is seen.
Asked: the central 90 % intervals cover the truth in 85 to 95 %.
{_calibrated("sparse")}{_calibrated("dense")}"""


def _calibrated(kind: str) -> str:
    if not (RESULTS / f"hierarchical_sbc_{kind}.json").exists():
        return f"\n{kind.capitalize()}: not run yet on the present source.\n"
    result = result_of(f"hierarchical_sbc_{kind}")
    settings, summary = result["settings"], result["summary"]
    if summary is None:
        return f"\n{kind.capitalize()}: not complete, {len(result['simulations'])} campaigns done.\n"
    if not summary["uniformity"]:
        return f"\n{kind.capitalize()}: all {summary['errors']} campaigns ended in an error.\n"
    rows = ""
    for name, row in summary["uniformity"].items():
        coverage = "- | "
        if "coverage_90" in row:
            low, high = row["coverage_90_interval"]
            met = "" if 0.85 <= row["coverage_90"] <= 0.95 else "NOT MET"
            coverage = f"{100 * row['coverage_90']:.1f} % ({100 * low:.0f}-{100 * high:.0f}) | {met}"
        rows += (
            f"| {name} | {row['chi_square_p']:.3f} | {row['ecdf_p']:.3f} |"
            f" {'inside' if row['ecdf_inside_band'] else 'OUTSIDE'} | {coverage} |\n"
        )
    note = f"\n{result['note']}\n" if "note" in result else ""
    return f"""
{kind.capitalize()}: {settings["n_events"]} events, {settings["n_sensors"] - 1} velocities and the runout,
{summary["n"]} campaigns.

| quantity | chi-square p | ECDF p | 95 % band | 90 % intervals cover (95 % interval of that) | asked |
| --- | --- | --- | --- | --- | --- |
{rows}
{summary["errors"]} ended in an error; {summary["second_tries"]} needed a second try with four times
the draws, after which {summary["gate_failed"]} still failed the gate (kept in the ranks). The slowest took
{summary["slowest_seconds"]:.0f} s. Events a and b are drawn at random in each campaign; theirs are the
strengths of single avalanches.
{note}
![Rank ECDF less uniform, with 95 % band](results/hierarchical_sbc_{kind}.png)
"""


app = cyclopts.App(help=__doc__)


@app.default
def main() -> None:
    """Write the page."""
    page = HEAD + forward() + logp() + sampling() + calibration()
    page += hierarchical() + hierarchical_calibration() + diagnosis()
    write_text(RESULTS.parent / "README.md", page)


if __name__ == "__main__":
    app()
