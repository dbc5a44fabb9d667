"""Section of benchmarks/README.md about the diagnosis."""

from typing import Any

import numpy as np

from benchmarks.page.results import result_of
from benchmarks.reference.pairs import SIMULATED
from benchmarks.reference.table import table

DENSE_SENSORS = 40
"""Sensors from which on a campaign is dense."""
_GAINS = 1.0
"""Nats from which a gain is told of."""


def diagnosis() -> str:
    """What a diagnosis and concealed trials cost."""
    here, slower, times = result_of("forward"), result_of("forward_slower"), result_of("diagnose_time")
    rows = ""
    for row in times["runs"]:
        stages = ", ".join(f"{name} {value:.0f}" for name, value in row["stages"].items() if value >= 0.5)
        rows += f"| {row['campaign']} | {row['base_model']} | {stages} |\n"
    said = [", ".join([row["verdict"], *row.get("names", [])]) for row in times["runs"]]
    whole = "".join(
        f"| {row['campaign']} | {row['base_model']} | {row['events']} events, {row['sensors']} sensors"
        f" | {row['verdict_seconds']:.0f} | {row['seconds']:.0f} | {row['cpu_seconds']:.0f}"
        f" | {row['memory_gb']:.1f} | {verdict} | {row['commit']} |\n"
        for row, verdict in zip(times["runs"], said, strict=True)
    )
    more = [slower[name] / here[name] for name in ("kernel", "pure Python")]
    proof = result_of("prove_throughput")
    n = proof["plan"]["n"]
    workers = "".join(
        f"| {run['workers']} | {run['seconds']:.0f} | {run['cpu_seconds_per_trial']:.0f} |\n"
        for run in proof["runs"]
    )
    return f"""
## A diagnosis, and concealed trials

`python -m benchmarks.diagnose_time --json benchmarks/results/diagnose_time.json`: `skred diagnose` by the
clock, everything compiled, both cores free, loading packages included: seconds until its verdict is written,
and until report and figures are. Asked: 40 s on 22 avalanches at 4 sensors, 60 s on 15 with 40 gates, 5
minutes on 200 sparse ones and 25 on 1000, and at most 4 GB. {_in_time(times["runs"])} The machine is not as
fast every day: compare rows of one commit only.

| campaign | base law | recordings | verdict [s] | report [s] | CPU [s] | memory [GB] | verdict | commit |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
{whole}
Of that the stages [s]; the rest are packages and the report.

| campaign | base law | stages |
| --- | --- | --- |
{rows}
`python -m benchmarks.prove_throughput --trials {n} --json benchmarks/results/prove_throughput.json`:
{n} sparse trials that hide nothing, starting the workers included, by the code of 22 November. This was on
another machine with two cores, slower and of a varying speed: at its fastest the kernel takes
{slower["kernel"]:.2f} us and pure Python {slower["pure Python"]:.0f} us, {more[0]:.1f} and {more[1]:.1f}
times what they take above (`python -m benchmarks.forward --json benchmarks/results/forward_slower.json`).

| workers | seconds | CPU seconds a trial |
| --- | --- | --- |
{workers}
Two workers do {proof["gain"]:.2f} times as much as one (asked: 1.8; the last trial runs alone, and with few
trials that counts). Asked of a sparse trial: 30 CPU seconds, on what machine is not said; this one takes
{more[0]:.1f} times as long as the one above. Bytecode was compiled before: where Python is told to
write none, each trial compiles all that it imports on top.

Development sets (`python -m benchmarks.development_set`, seeds 1000 to 999 999) are what was tuned on, and no
claim is made from them. [development.md](development.md) has the goals on one that was not tuned on, with
each mechanism; [the record](../docs/proof.md) has them on sealed trials of the same simulator with other
seeds, and so other tracks, avalanches and effects.
{_evidence()}"""


def _in_time(runs: list[dict[str, Any]]) -> str:
    """How many verdicts come within what is asked, by the kind of campaign."""
    told = []
    for what, limit, own in (
        ("22 avalanches", 40.0, [one for one in runs if one["campaign"] == "Ryggfonn"]),
        ("dense campaigns", 60.0, [one for one in runs if one["sensors"] >= DENSE_SENSORS]),
        ("200 avalanches", 300.0, [one for one in runs if one["events"] == 200]),
        ("1000 avalanches", 1500.0, [one for one in runs if one["events"] == 1000]),
    ):
        met = sum(one["verdict_seconds"] <= limit for one in own)
        told.append(f"{met} of {len(own)} on {what}")
    return f"Verdicts in time: {', '.join(told)}."


def _evidence() -> str:
    """How far log Bayes factors are from those of a slow reference."""
    found = result_of("evidence_reference")
    pairs = found["all"]
    return f"""
## Evidence

`python -m benchmarks.evidence_reference --n {pairs["n"]} --seed 1 [--also DIR]` draws pairs of a campaign and
a candidate and compares the diagnosis' log Bayes factor with that of a slow reference, which shares only the
likelihood of an event. Candidates are listed mechanisms in one to three given shapes, with a strength in
common. Pairs and summary are in `results/evidence_reference.json`. The
diagnosis is that of commit {found["commit"]}; `--also` gave two campaigns of others, which are not part of
this repository. Median difference of {pairs["n"]} pairs {pairs["median"]:.2f} nats, 95 % within
{pairs["q95"]:.2f}, {pairs["beyond_1"]} beyond 1, the largest {pairs["largest"]:.1f}. Of
{pairs["big"]} pairs that the reference has above 10 nats {pairs["lost"] or "none"} is lost.
Differences in nats:

{table(found)}{_places()}{_starts()}"""


def _places() -> str:
    """What interpolation between refined shapes costs, against draws of place and length."""
    part = result_of("evidence_choices")["places"]
    pairs = [one for one in part["pairs"] if "drawn" in one]
    apart = np.array([one["refined"] - one["drawn"] for one in pairs])
    rows = "".join(
        f"| {one['pair']} | {one['source']} | {one['base']} | {one['recorded']}, {one['n_events']}"
        f" | {', '.join(one['hidden']) or '-'} | {one['mechanism']} | {one['refined']:.1f}"
        f" | {one['drawn']:.1f} ± {one['standard_error']:.1f} | {one['refined'] - one['drawn']:+.1f} |\n"
        for one in pairs
    )
    return f"""
### Places

`python -m benchmarks.evidence_choices places --n {len(part["pairs"])}` (commit
{part["commit"]}): of the mechanism of a stretch that leads, the log Bayes factor interpolated between its
refined shapes, as a comparison has it, and over draws of place and length from their prior, by adaptive
importance sampling. Both take the evidence at a shape as the diagnosis computes it. In nats: median
difference {np.median(np.abs(apart)):.2f}, the largest {np.abs(apart).max():.1f}, the mean
{apart.mean():+.2f}.

| pair | campaign | base law | recordings | hidden | mechanism | refined | drawn | difference |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
{rows}"""


def _starts() -> str:
    """What climbs from another mechanism's fit find."""
    part = result_of("evidence_choices")["starts"]
    # Recordings that are no simulated ones are the same under each base law, however often they are drawn.
    distinct = {
        one["pair"] if one["source"] == SIMULATED else (one["source"], one["base"]): one["mechanisms"]
        for one in part["pairs"]
        if "mechanisms" in one
    }
    found = list(distinct.values())
    more, count = [], 0
    for each in found:
        lead = max(0.0, *(max(one["usual"], one["more"]) for one in each.values()))
        for one in each.values():
            gain = one["more"] - one["usual"]
            more += [(gain, lead - one["more"])] if gain > _GAINS else []
            count += 1
    told = "; ".join(f"{gain:.1f} ({behind:.0f} behind)" for gain, behind in sorted(more, reverse=True))
    return f"""
### Where climbs begin

`python -m benchmarks.evidence_choices starts --n {len(part["pairs"])}` (commit {part["commit"]}): each
mechanism at its best shape, as screened, climbed once more from population and events of the mechanism that
has most evidence. Of {count} curves of {len(found)} campaigns and base laws {len(more)} gain more than a
nat, in nats (and how far behind the leading one they are then): {told}. Such climbs are left out: none of
these leads.
"""
