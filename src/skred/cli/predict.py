"""``skred predict``: how fast and how far the next avalanche goes.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints, tell_track_hints
from skred.cli.inputs import campaign_of, hierarchical_of
from skred.cli.options import (
    HIERARCHICAL,
    SAMPLING,
    BaseModel,
    Campaigns,
    Hierarchical,
    Release,
    Sampling,
    TrackFile,
)
from skred.cli.output import OUTPUT, Output


def predict(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: BaseModel = "pcm",
    track: TrackFile = None,
    release: Release = None,
    likelihood: Hierarchical = HIERARCHICAL,
    sampling: Sampling = SAMPLING,
    output: Output = OUTPUT,
) -> int:
    """Say how fast and how far the next avalanche goes, and how sure that is, along a track."""
    from skred.physics.laws import load_law

    law = load_law(base_model)
    problem = hierarchical_of(campaign_of(campaign), likelihood.errors, likelihood.smoothing)

    from skred.inference.calibrate import calibrate
    from skred.prediction.predict import predict as predict_avalanches
    from skred.prediction.track import prediction_track
    from skred.report.folders import write_reports
    from skred.report.prediction.figures import prediction_table

    where = prediction_track(problem, track, release)
    tell_hints(problem, output.tell)
    tell_track_hints(where, track, output.tell)
    settings = sampling.settings("hierarchical")
    with output.results("predict") as results:
        output.tell(f"{law.id}: calibrating on {problem.campaign.name}")
        calibration = calibrate(problem, law, settings, progress=output.progress)
        prediction = predict_avalanches(calibration, results.unfinished, where, output.tell)
        write_reports(results.unfinished)
    output.show(prediction, prediction_table, prediction["statement"], results.path)
    return DONE if prediction["gate"]["passed"] else NOT_CONVERGED
