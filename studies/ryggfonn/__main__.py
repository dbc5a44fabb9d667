"""The real recordings diagnosed: what each base law leaves out at Ryggfonn, and what that depends on.

``python -m studies.ryggfonn`` diagnoses each case that has no result yet, writes
``studies/results/ryggfonn/<case>.json`` and figures, and then ``docs/ryggfonn.md``; the same command goes on
with a run that was ended. Delete a result to have it made again.
"""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NamedTuple

import cyclopts

from benchmarks.commit import commit
from skred.output import write_text
from skred.physics.mechanisms.strength_prior import SCALES
from studies.files import FIGURES, RESULTS, ROOT, read, shrink, write
from studies.ryggfonn import page as ryggfonn_page
from studies.ryggfonn.groups import groups_figure, retardations

ANSWERS = RESULTS / "ryggfonn"
PRIOR_FACTORS = (0.5, 1.0, 2.0)
SHOWN = ("where",)
"""Figures of the page."""


class Case(NamedTuple):
    """One diagnosis: a base law, and what is different from the usual settings."""

    name: str
    base_model: str
    campaign: str = "ryggfonn"
    smoothing_m: float = 10.0
    errors: str = "robust"
    spans: bool = False
    sensors_m: tuple[float, float] = (0.0, 0.0)
    """How far downstream of where they are taken to be the sensors LC and CD are put."""
    place_sd_m: tuple[float, float] | None = None
    """To how many metres (sd) the places of LC and CD are stated to be known; None states nothing."""
    folds: int = 0
    """Parts of the avalanches without which the diagnosis is repeated; each one is then refitted without."""


CASES = (
    Case("coulomb", "coulomb"),
    Case("pcm", "pcm"),
    Case("constant", "constant"),
    Case("voellmy", "voellmy"),
    Case("pcm-smoothing-5", "pcm", smoothing_m=5.0),
    Case("pcm-smoothing-20", "pcm", smoothing_m=20.0),
    Case("pcm-student", "pcm", errors="student"),
    Case("pcm-spans", "pcm", spans=True),
    Case("pcm-sensors-up", "pcm", sensors_m=(-40.0, -20.0)),
    Case("pcm-sensors-down", "pcm", sensors_m=(40.0, 20.0)),
    Case("pcm-sensors-closer", "pcm", sensors_m=(40.0, -20.0)),
    Case("pcm-places-stated", "pcm", place_sd_m=(40.0, 20.0)),
    Case("pcm-with-dam", "pcm", campaign="ryggfonn-with-dam"),
    *(Case(f"{law}{ryggfonn_page.UNSEEN}", law, folds=5) for law in ryggfonn_page.PUBLISHED),
)


def campaign_of(case: Case) -> Any:
    """The recordings of a case."""
    from skred.campaign import find_campaign, read_campaign
    from studies.ryggfonn.campaigns import build

    if case.spans:
        return build(find_campaign("ryggfonn") / "raw", spans=True)
    campaign = read_campaign(find_campaign(case.campaign))
    shifts = dict(zip(ryggfonn_page.MOVED, case.sensors_m, strict=True))
    sensors = [
        replace(one, s_from_m=one.s_from_m + by, s_to_m=one.s_to_m + by)
        if (by := shifts.get(one.id)) and one.s_from_m is not None and one.s_to_m is not None
        else one
        for one in campaign.sensors
    ]
    errors = {} if case.place_sd_m is None else dict(zip(ryggfonn_page.MOVED, case.place_sd_m, strict=True))
    sensors = [replace(one, place_sd_m=errors.get(one.id)) for one in sensors]
    return replace(campaign, sensors=tuple(sensors))


def diagnose_case(case: Case, *, figures: bool = True) -> dict[str, Any]:
    """Diagnose one case; its verdict, and the evidence of each mechanism under other scales of its prior."""
    from skred.diagnosis.diagnose import diagnose
    from skred.diagnosis.effort import SAMPLING, Effort
    from skred.diagnosis.outcome import Diagnosis
    from skred.diagnosis.repeated import outer_folds
    from skred.diagnosis.verdict.document import verdict
    from skred.diagnosis.verdict.figure_data import figure_data
    from skred.diagnosis.verdict.report_facts import report_facts
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.physics.laws import load_law
    from skred.report.diagnosis.report import save_diagnosis_figures
    from skred.report.shared.style import write_png

    problem = hierarchical_problem(campaign_of(case), error_model=case.errors, smoothing_m=case.smoothing_m)
    settings = SAMPLING
    # All else as a person gets it who sets nothing, and so are the answers.
    law, effort = load_law(case.base_model), Effort(exact_loo=case.folds > 0)
    found = diagnose(problem, law, settings, effort, print)
    document = verdict(found) | {"case": case._asdict()}
    if case.folds:
        without = replace(effort, exact_loo=False)
        document["outer_folds"] = outer_folds(
            problem, case.folds, settings.seed, lambda rest: diagnose(rest, law, settings, without), print
        )
    if case.name != case.base_model:
        document.pop("conditional", None)  # long, and of no variant on the page
    if isinstance(found, Diagnosis):
        document["prior_scales"] = {
            name: {str(factor): _best_factor(found.comparison, name, factor) for factor in PRIOR_FACTORS}
            for name in found.comparison.under_each[0].candidates
        }
    if case.name == case.base_model and isinstance(found, Diagnosis):
        document["clean"] = {"log_odds": clean_log_odds(found), "recordings": found.check.statistic}
    if figures and case.name == case.base_model and isinstance(found, Diagnosis):
        with TemporaryDirectory() as folder:
            whole = document | {"report": report_facts(found)}
            written = save_diagnosis_figures(whole, figure_data(found), Path(folder))
            for name in SHOWN:
                if name in written:
                    shrink(written[name].file)
                    shutil.copy(written[name].file, FIGURES / f"ryggfonn-{case.name}-{name}.png")
    if figures and case.name == "pcm" and isinstance(found, Diagnosis):
        document["retardations"] = retardations(found)
        shrink(write_png(groups_figure(document["retardations"]), FIGURES / "ryggfonn-groups.png"))
    return document


def clean_log_odds(found: Any) -> list[float]:
    """Log odds of anything against nothing of as many clean campaigns of the base law as place the limit.

    A diagnosis simulates fewer where the recordings' odds are rare whatever clean campaigns are like.
    """
    from skred.diagnosis.check.bootstrap_test import odds_test
    from skred.diagnosis.evidence.coefficient import fit_base
    from skred.diagnosis.evidence.population_draws import population_draws, typical
    from skred.diagnosis.limits import LIMIT

    draws = population_draws(found.calibration, 0)
    base = fit_base(found.calibration.problem, found.law, typical(draws))
    just_not_rare = -math.log(LIMIT) - 0.01
    return sorted(odds_test(base, draws, 0, just_not_rare).simulated.tolist())


def _best_factor(comparison: Any, name: str, factor: float) -> float:
    """Log Bayes factor of a mechanism's best shape if its prior were wider or narrower."""
    candidate = comparison.leading(name).candidates[name]
    return float(candidate.best.log_factor_of(scales=[factor * one for one in SCALES]))


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    out: Annotated[
        Path | None,
        cyclopts.Parameter(help="Folder for the answers; then page and figures stay as they are."),
    ] = None,
) -> None:
    """Diagnose what has no result yet, and write the page."""
    folder = ANSWERS if out is None else out
    folder.mkdir(parents=True, exist_ok=True)
    for case in CASES:
        file = folder / f"{case.name}.json"
        if not file.exists():
            print(f"== {case.name}", flush=True)
            write(file, diagnose_case(case, figures=out is None) | {"commit": commit()})
    if out is not None:
        return
    found = {case.name: read(ANSWERS / f"{case.name}.json") for case in CASES}
    write_text(ROOT / "docs" / "ryggfonn.md", ryggfonn_page.page(found))


if __name__ == "__main__":
    app()
