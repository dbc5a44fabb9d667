"""``skred predict``: how fast and how far the next avalanche goes.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.inputs import campaign_of, hierarchical_of
from skred.cli.options import (
    SAMPLING,
    BaseModel,
    Campaigns,
    Errors,
    Release,
    Sampling,
    Smoothing,
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
    errors: Errors = None,
    sampling: Sampling = SAMPLING,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say how fast and how far the next avalanche goes, and how sure that is, along a track."""
    from skred.physics.laws import load_law

    law = load_law(base_model)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing)

    from skred.prediction.predict import predict as predict_avalanches
    from skred.prediction.track import prediction_track
    from skred.report.folders import write_reports
    from skred.report.prediction.figures import prediction_table

    where = prediction_track(problem, track, release)
    folder = output.folder("predict")
    settings = sampling.settings("hierarchical")
    prediction = predict_avalanches(
        problem, law, settings, folder, where, output.tell, progress=output.progress
    )
    write_reports(folder)
    output.show(prediction, prediction_table, prediction["statement"], folder)
    return DONE if prediction["gate"]["passed"] else NOT_CONVERGED
