"""``skred identify``: what recordings can tell at all.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE
from skred.cli.hints import tell_hints
from skred.cli.inputs import campaign_of, hierarchical_of, law_of
from skred.cli.options import HIERARCHICAL, Campaigns, DiagnosedModel, Hierarchical, IdleSeed, Priors
from skred.cli.output import OUTPUT, Output
from skred.cli.refused import tell_refused_mechanisms


def identify(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    priors: Priors = None,
    likelihood: Hierarchical = HIERARCHICAL,
    seed: IdleSeed = 0,
    output: Output = OUTPUT,
) -> int:
    """Say what these recordings can tell at all: from what strength on each mechanism would be seen."""
    law = law_of(base_model, priors)
    tell_refused_mechanisms()
    problem = hierarchical_of(campaign_of(campaign), likelihood.errors, likelihood.smoothing)
    tell_hints(problem, output.tell)
    with output.results("identify") as results:
        from skred.diagnosis.detect.run import identify_to
        from skred.report.diagnosis.identify import identify_table

        document = identify_to(problem, law, results.unfinished, output.tell)
    output.show(document, identify_table, document["statement"], results.path)
    return DONE  # nothing is sampled, and "these recordings cannot tell" is an answer
