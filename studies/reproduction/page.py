"""The page ``docs/reproduction.md``, every number of it from one study."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from skred.report.shared.numbers import decimals_for, fixed, rounded
from studies.reproduction.cases import LAWS, SHORT, Outcome
from studies.reproduction.facts import (
    RecordedRetardation,
    bowl_limit,
    correlation,
    recorded_retardation,
)
from studies.reproduction.statements import CLOSE, Statement, statements
from studies.reproduction.study import Study
from studies.reproduction.words import what_we_make_of_it

STARTS_M = (0.0, 25.0, 50.0, 100.0, 150.0, 200.0)
_LAW_HEADINGS = {
    "coulomb": ("M1, Coulomb", ("a0 [-]",)),
    "pcm": ("M2, PCM", ("a0 [-]", "a2 [1e-3 1/m]")),
    "constant": ("M3, constant retardation", ("a3 [m/s²]",)),
}


def page(study: Study, *, command: str, seed: int, versions: dict[str, str], seconds: float) -> str:
    """The whole document as Markdown."""
    rows = statements(study)
    sections = [
        _head(study, command, seed, versions, seconds),
        "## Statement by statement\n\n" + _statement_table(rows),
        "## What we make of it\n\n" + what_we_make_of_it(study, rows),
        _routes(study),
        _alternatives(study),
        _preference(study),
        _fits(study),
        _bowl(study),
        _retardations(study),
        _correlations(study),
    ]
    return reflowed("\n\n".join(sections)) + "\n"


def reflowed(text: str) -> str:
    """Paragraphs filled to one width; headings, tables, figures and indented blocks as they are."""
    kept = ("#", "|", "!", "    ")
    blocks = [
        block
        if block.startswith(kept)
        else textwrap.fill(block, 110, break_long_words=False, break_on_hyphens=False)
        for block in text.split("\n\n")
    ]
    return "\n\n".join(blocks)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" for _ in header) + " |"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def with_sd(mean: float, sd: float) -> str:
    """Mean and standard deviation with the decimals that two digits of it deserve."""
    decimals = decimals_for(sd) or 0
    if mean != 0:  # five significant digits at most
        decimals = min(decimals, 4 - math.floor(math.log10(abs(mean))))
    return f"{rounded(mean, decimals)} ± {rounded(sd, decimals)}"


def _head(study: Study, command: str, seed: int, versions: dict[str, str], seconds: float) -> str:
    campaign, terrain = study.base.problem.campaign, study.base.problem.terrain
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    gates = "; ".join(f"{SHORT[law]} {'passed' if study.gates[law].passed else 'FAILED'}" for law in LAWS)
    return f"""# Against the paper

Every number here was computed by `{command}` (seed {seed}, {seconds:.0f} s; {listed}); do not edit it by
hand. Campaign `{campaign.name}`, fingerprint `{campaign.fingerprint()[:12]}`, {campaign.n_events}
events, terrain
smoothed over {terrain.smoothing_m:g} m in {terrain.n_cells} cells. Gate of the chains: {gates}.

"The paper" is the calibration paper on Ryggfonn (its Table 1 is in `data/ryggfonn/raw`); a0 is mu, a2 is D,
a3 is b. **Ours** is the pooled calibration of the pack, with vague priors: y_e ~ N(m, Sigma), Sigma from the
recordings, so ± is the posterior standard deviation of the *mean response*, not of the next avalanche. All
fronts start at s = 0 unless a row says otherwise. Runouts are relative to the dam's crown."""


def _statement_table(rows: Sequence[Statement]) -> str:
    rule = (
        f"A number counts as reproduced where our 90 % posterior interval holds the paper's figure, or"
        f" where it differs "
        f"by at most {100 * CLOSE:.0f} %. Both distances are given: a narrow posterior can be many of"
        f" its own standard "
        "deviations away and yet practically the same."
    )
    header = ("the paper says", "paper", "ours", "verdict", "what moves it (computed)")
    return rule + "\n\n" + table(header, [(r.says, r.paper, r.ours, r.verdict, r.moves) for r in rows])


def _routes(study: Study) -> str:
    rows = [
        (
            SHORT[c.law_id],
            f"{c.name} [{c.unit}]",
            f"{c.mean:.5g} ± {c.mcse_mean:.1g}",
            f"{c.grid_mean:.5g}",
            f"{c.z_mean:+.1f}",
            f"{c.sd:.4g} ± {c.mcse_sd:.1g}",
            f"{c.grid_sd:.4g}",
            f"{c.z_sd:+.1f}",
        )
        for c in study.chains
    ]
    evidence = [
        (
            SHORT[e.law_id],
            f"{np.mean(e.smc):.2f}",
            f"{np.std(e.smc, ddof=1) / np.sqrt(len(e.smc)):.2f}",
            f"{e.grid:.2f}",
            f"{np.mean(e.smc) - e.grid:+.2f}",
        )
        for e in study.evidences
    ]
    worst = max(max(abs(c.z_mean), abs(c.z_sd)) for c in study.chains)
    n = 2 * len(study.chains)
    median = float(norm.ppf(0.5 * (1 + 0.5 ** (1 / n))))
    agree = "agree" if worst <= 3 else "DISAGREE"
    return f"""## Two routes to the baseline

The tables below come from a posterior on a fine grid, not from chains: the likelihood has steps (a
front passes the
bowl or not), which a grid does not mind, and it has no Monte Carlo noise. PyMC's Metropolis (joint
proposal), ± its
Monte Carlo standard error (MCSE), is the second route. They {agree}: the largest of {n} differences is
{worst:.1f} standard errors (the largest of {n}
independent ones exceeds {median:.1f} half of the time).

{
        table(
            (
                "law",
                "parameter",
                "mean, chains",
                "grid",
                "diff. [MCSE]",
                "sd, chains",
                "grid",
                "diff. [MCSE]",
            ),
            rows,
        )
    }

Log evidence by sequential Monte Carlo ({len(study.evidences[0].smc)} seeds) and by the grid:

{table(("law", "SMC", "standard error", "grid", "difference"), evidence)}"""


def _alternatives(study: Study) -> str:
    parts = [
        "## One change at a time",
        "Posterior mean ± standard deviation of the strengths, and the mean response they give (m/s at"
        " LC, CD and b; m"
        " from the crown). `modes`: places of the posterior's modes if there are several, with their"
        " height relative"
        " to the highest one in brackets.",
        "![What moves the strengths](figures/reproduction-alternatives.png)",
    ]
    for law_id in LAWS:
        title, columns = _LAW_HEADINGS[law_id]
        shape = ("correlation", "bend") if law_id == "pcm" else ()
        header = ("change", *columns, "modes", *shape, "LC", "CD", "b", "runout")
        chosen = [o for o in study.of_law(law_id) if o.case.curvature or law_id != "constant"]
        parts += [f"### {title}", table(header, [_row(study, o) for o in chosen])]
        if law_id == "pcm":
            parts += [
                "`bend`: share of the variance of a2 that a curved line in a0 explains and a straight"
                " one does not;"
                " 0 for a normal distribution.",
                "![Joint posterior of M2](figures/reproduction-joint.png)",
            ]
    return "\n\n".join(parts)


def _row(study: Study, o: Outcome) -> tuple[str, ...]:
    p = o.posterior
    factors = (1.0, 1e3)[: len(p.mean)]
    strengths = [with_sd(f * m, f * s) for f, m, s in zip(factors, p.mean, p.sd, strict=True)]
    shape = (f"{p.correlation:+.2f}", f"{p.bend:.3f}") if len(p.mean) == 2 else ()
    zero = float(o.case.problem.campaign.reference_s_m or 0.0)
    readings = [with_sd(m, s) for m, s in zip(o.response[:3], o.response_sd[:3], strict=True)]
    runout = with_sd(o.response[3] - zero, o.response_sd[3])
    title = f"**{o.case.title}**" if o.case is study.base else o.case.title
    return (title, *strengths, _modes(o), *shape, *readings, runout)


def _modes(o: Outcome) -> str:
    modes = o.posterior.modes
    if len(modes) < 2:
        return "one"
    factors = (1.0, 1e3)[: len(o.posterior.mean)]
    return "; ".join(
        ", ".join(f"{f * x:.3g}" for f, x in zip(factors, place, strict=True)) + f" ({height:.2f})"
        for place, height in modes
    )


def _preference(study: Study) -> str:
    rows = []
    for case in study.cases:
        z = {law: study.outcomes[case.key, law].posterior.log_evidence for law in LAWS}
        rows.append((case.title, *(f"{z['pcm'] - z[law]:+.1f}" for law in ("coulomb", "constant"))))
    least = min(float(row[column]) for row in rows for column in (1, 2))
    verdict = (
        f"M2 has the larger evidence in every row, by at least {least:.1f}"
        if least > 0
        else f"M2 does not have the larger evidence in every row (least {least:.1f})"
    )
    return f"""## Which law the recordings prefer, under the same changes

Log evidence of M2 less that of the others (within a row only: rows with other recordings or another
Sigma are not
comparable with each other). {verdict}.

{table(("change", "M2 less M1", "M2 less M3"), rows)}"""


def _fits(study: Study) -> str:
    crown = study.crown_m
    mean = study.plain_mean
    rows = [
        (
            SHORT[f.law_id],
            f.what,
            f"{f.strengths[0]:.3f}"
            if f.law_id != "pcm"
            else f"{f.strengths[0]:.3f}; {1e3 * f.strengths[1]:.2f}",
            *(f"{value:.1f}" for value in f.readings[:3]),
            fixed(float(f.readings[3] - crown), 0, signed=True),
        )
        for f in study.fits
    ]
    rows.append(
        (
            "recorded",
            "plain means",
            "",
            *(f"{v:.1f}" for v in mean[:3]),
            fixed(float(mean[3] - crown), 0, signed=True),
        )
    )
    latent = study.base.problem.recorded_mean
    latent_row = (*(f"{v:.1f}" for v in latent[:3]), fixed(float(latent[3] - crown), 0, signed=True))
    rows.append(("recorded", "stops counted as latent speeds below 0", "", *latent_row))
    return f"""## Plain fits: an optimisation on the same recordings

The paper's priors came from an optimisation on the same data. Least squares of the mean response
against the plain
means of the readings that exist (which leave out the avalanches that did not arrive) gives (a0; for M2
also a2 in
1e-3 1/m; a3 in m/s²):

{table(("law", "fitted to", "strengths", "LC", "CD", "b", "runout"), rows)}"""


def _bowl(study: Study) -> str:
    problem, base = study.base.problem, study.base
    rows = []
    for start in STARTS_M:
        a0, r1 = bowl_limit(problem, base.mechanisms("coulomb"), 1.5, start)
        a3, r3 = bowl_limit(problem, base.mechanisms("constant"), 9.0, start)
        rows.append(
            (
                f"{start:.0f}",
                f"{a0:.4f}",
                f"{r1[0]:.1f}",
                fixed(float(r1[3] - study.crown_m), 0, signed=True),
                f"{a3:.3f}",
                f"{r3[0]:.1f}",
                fixed(float(r3[3] - study.crown_m), 0, signed=True),
            )
        )
    return f"""## The bowl

Largest strength with which a front still leaves the flat of the bowl, by bisection with the kernel,
and that front's
speed at LC [m/s] and runout [m]. Both limits fall with the start, which Table 1 does not give.

{table(("start s [m]", "M1: a0", "LC", "runout", "M3: a3 [m/s²]", "LC", "runout"), rows)}"""


def _retardations(study: Study) -> str:
    problem = study.base.problem
    rows = []
    shifts = (
        (0, 0, ""),
        (-40, 0, "LC 40 m up"),
        (40, 0, "LC 40 m down"),
        (0, -5, "b 5 m up"),
        (0, 5, "b 5 m down"),
    )
    for up, low, text in shifts:
        rows.append(_retardation_row(f"LC to b{', ' + text if text else ''}", "LC", "b", study, up, low))
    for up, low, text in ((0, 0, ""), (0, -20, "CD 20 m up"), (0, 20, "CD 20 m down")):
        rows.append(_retardation_row(f"LC to CD{', ' + text if text else ''}", "LC", "CD", study, up, low))
    rows.append(_retardation_row("CD to b", "CD", "b", study, 0, 0))
    spread, errors = "mean ± sd over events [m/s²]", "an event's own error [m/s²]"
    header = ("stretch", "length [m]", "drop [m]", "events", spread, errors)
    return f"""## Retardation from the recorded speeds

    a_ret = (U_lower^2 - U_upper^2) / (2 length) - g drop / length

from dU^2/(2 ds) = g sin(phi) + a_ret, with the track's drop; every event that has both
speeds, U = 0 included. An event's own error is what the stated 10 % and 1 m/s of its speeds make of it.

{table(header, rows)}

{_groups(recorded_retardation(problem, "LC", "CD"))}"""


def _retardation_row(
    title: str, upper: str, lower: str, study: Study, up: float, low: float
) -> tuple[str, ...]:
    r = recorded_retardation(study.base.problem, upper, lower, up, low)
    return (
        title,
        f"{r.length_m:.0f}",
        f"{r.drop_m:.0f}",
        str(len(r.events)),
        f"{r.mean:.2f} ± {r.sd:.2f}",
        f"{r.reading_sd.min():.1f} to {r.reading_sd.max():.1f}",
    )


def _groups(r: RecordedRetardation) -> str:
    strong, weak, gap = r.groups()
    order = np.sort(r.values)
    second = float(np.sort(np.diff(order))[-2])
    return (
        f"From LC to CD the widest gap between neighbouring events is {gap:.1f} m/s² (the next widest"
        f" {second:.1f}). It"
        f" separates {len(strong)} events ({', '.join(sorted(strong))}; mean {r.mean_of(strong):.1f}"
        f" m/s²) from"
        f" {len(weak)} (mean {r.mean_of(weak):.1f} m/s²). Found by looking, so a hypothesis; an event's"
        f" own error is up"
        f" to {r.reading_sd.max():.1f} m/s²."
    )


def _correlations(study: Study) -> str:
    problem = study.base.problem
    ids, matrix = problem.campaign.sensor_ids, correlation(problem)
    rows = [(name, *(f"{value:.2f}" for value in line)) for name, line in zip(ids, matrix, strict=True)]
    sd = np.sqrt(np.diag(problem.covariance))
    rows.append(("sd [m/s; m]", *(f"{value:.1f}" for value in sd)))
    return f"""## Correlation of the recordings

From Sigma: all events, missing readings marginalised, `not reached` as a latent reading below 0.

{table(("", *ids), rows)}"""
