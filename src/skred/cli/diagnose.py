"""``skred diagnose``: what physics a law leaves out.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from collections.abc import Mapping
from typing import Any

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints
from skred.cli.inputs import campaign_of, hierarchical_of, law_of
from skred.cli.options import (
    DIAGNOSING,
    HIERARCHICAL,
    Campaigns,
    DiagnosedModel,
    Diagnosing,
    Hierarchical,
    Priors,
)
from skred.cli.output import OUTPUT, Output
from skred.cli.refused import tell_refused_mechanisms

_DRAWING = ("skred.report.diagnosis.page", "skred.report.explore.plots.tstat")
"""What figures of the report are drawn by, as files and to be explored."""


def diagnose(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    priors: Priors = None,
    diagnosing: Diagnosing = DIAGNOSING,
    likelihood: Hierarchical = HIERARCHICAL,
    output: Output = OUTPUT,
) -> int:
    """Say what physics a law leaves out, where and how surely, model it, and show what that improves."""
    from skred.parallel.processes import helpers

    recorded = campaign_of(campaign)
    with helpers(
        "skred.diagnosis.diagnose", *_DRAWING
    ):  # they load packages while this process loads its own
        law = law_of(base_model, priors)
        tell_refused_mechanisms()
        problem = hierarchical_of(recorded, likelihood.errors, likelihood.smoothing)
        tell_hints(problem, output.tell)
        with output.results("diagnose") as results:
            from skred.diagnosis.run import diagnose_to
            from skred.report.diagnosis.report import diagnosis_table
            from skred.report.folders import write_reports

            settings, effort = diagnosing.settings(), diagnosing.effort()
            lock, folds = diagnosing.lock or 0, diagnosing.outer_folds or 0
            document = diagnose_to(
                problem, law, settings, effort, results.unfinished, output.tell, lock=lock, folds=folds
            )
            output.tell("writing the report")
            write_reports(results.unfinished)
    output.show(document, diagnosis_table, [], results.path)  # the statement is in the table
    return ends_with(document)


def ends_with(document: Mapping[str, Any]) -> int:
    """Exit code of a verdict; that it cannot tell, or that one refit failed, is an answer.

    It is none where chains that did not converge stood in the way of an answer.
    """
    return DONE if document["reason"] is None or document["converged"] else NOT_CONVERGED
