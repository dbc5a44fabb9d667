"""``skred predict``: how fast and how far the next avalanche goes.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from skred.api.prediction import predict_to
from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints, tell_track_hints
from skred.cli.inputs import campaign_of, hierarchical_of, law_of
from skred.cli.options import (
    ASKED,
    HIERARCHICAL,
    SAMPLING,
    Asked,
    BaseModel,
    From,
    Hierarchical,
    PredictedCampaign,
    Priors,
    Releases,
    Sampling,
    TrackFile,
)
from skred.cli.output import OUTPUT, Output
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.prediction.source import Source


def predict(
    campaign: PredictedCampaign = None,
    /,
    *,
    from_: From = None,
    base_model: BaseModel = None,
    track: TrackFile = None,
    release: Releases = None,
    priors: Priors = None,
    asked: Asked = ASKED,
    likelihood: Hierarchical = HIERARCHICAL,
    sampling: Sampling = SAMPLING,
    output: Output = OUTPUT,
) -> int:
    """Say how fast and how far the next avalanche goes, and how sure that is, along a track."""
    from skred.prediction.wanted import release_of

    wanted, scenarios = asked.wanted(), [release_of(text) for text in release or ()]
    source = None
    if from_ is not None:
        source = _source(from_, campaign, base_model, priors, likelihood, sampling)
        law, problem = source.stored.calibration.law, source.stored.problem
    else:
        law = law_of(base_model or "pcm", priors)
        checked = campaign_of(campaign or "ryggfonn")
        problem = hierarchical_of(checked, likelihood.errors, likelihood.smoothing)

    from skred.prediction.statement import cautions, not_used
    from skred.prediction.track import prediction_track
    from skred.report.folders import write_reports
    from skred.report.prediction.table import prediction_table

    where = prediction_track(problem, track, scenarios)
    wanted.check_on(where.length_m, highest_release_m=where.highest_release_m)
    if source is None:
        tell_hints(problem, output.tell)
    tell_track_hints(where, track, output.tell)
    with output.results("predict") as results:
        prediction, _ = predict_to(
            problem,
            law,
            sampling.settings("hierarchical"),
            results.unfinished,
            output.tell,
            where=where,
            wanted=wanted,
            source=source,
            progress=output.progress,
            command=shlex.join(["skred", *sys.argv[1:]]),
        )
        write_reports(results.unfinished)
    first = [*prediction["warnings"], *not_used(prediction), *cautions(prediction)]
    output.show(prediction, prediction_table, prediction["statement"], results.path, first)
    return DONE if prediction["gate"]["passed"] else NOT_CONVERGED


def _source(
    folder: Path,
    campaign: str | None,
    base_model: str | None,
    priors: Path | None,
    likelihood: Hierarchical,
    sampling: Sampling,
) -> "Source":
    """The calibration of a folder; what would calibrate otherwise is refused beside it."""
    from skred.prediction.source import source_of

    beside = {
        "a campaign": campaign is not None,
        "--base-model": base_model is not None,
        "--priors": priors is not None,
        "--errors or --smoothing": likelihood != HIERARCHICAL,
        "--draws, --tune, --chains or --seed": sampling != SAMPLING,
    }
    for what, is_given in beside.items():
        if is_given:
            raise InputError(f"--from {folder}: the calibration is made already; leave out {what}")
    return source_of(folder)
