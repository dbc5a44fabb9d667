"""``skred identify``: what recordings can tell at all.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE
from skred.cli.inputs import campaign_of, hierarchical_of
from skred.cli.options import Campaigns, DiagnosedModel, Errors, IdleSeed, Smoothing
from skred.cli.output import OUTPUT, Output


def identify(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    errors: Errors = None,
    seed: IdleSeed = 0,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say what these recordings can tell at all: from what strength on each mechanism would be seen."""
    from skred.physics.laws import load_law

    law = load_law(base_model)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing)
    folder = output.folder("identify")

    from skred.diagnosis.detect.run import identify_to
    from skred.report.diagnosis.identify import identify_table

    document = identify_to(problem, law, folder, output.tell)
    output.show(document, identify_table, document["statement"], folder)
    return DONE
