"""``skred diagnose``: what physics a law leaves out.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from dataclasses import replace

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.inputs import campaign_of, hierarchical_of
from skred.cli.options import (
    DIAGNOSIS_SAMPLING,
    MAX_MECHANISMS,
    Campaigns,
    DiagnosedModel,
    Errors,
    ExactHeldOut,
    Lock,
    MaxMechanisms,
    OuterFolds,
    Quick,
    Seed,
    Smoothing,
)
from skred.cli.output import OUTPUT, Output


def diagnose(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    max_mechanisms: MaxMechanisms = None,
    exact_loo: ExactHeldOut = False,
    outer_folds: OuterFolds = None,
    lock: Lock = None,
    quick: Quick = False,
    errors: Errors = None,
    seed: Seed = 0,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say what physics a law leaves out, where and how surely, model it, and show what that improves."""
    from skred.parallel.processes import helpers

    recorded = campaign_of(campaign)
    with helpers("skred.diagnosis.diagnose"):  # they load packages while this process loads its own
        from skred.physics.laws import load_law

        law = load_law(base_model)
        problem = hierarchical_of(recorded, errors, smoothing)
        folder = output.folder("diagnose")

        from skred.diagnosis.effort import QUICK_REPLICAS, Effort
        from skred.diagnosis.run import diagnose_to
        from skred.report.diagnosis.report import diagnosis_table
        from skred.report.folders import write_reports

        replicas = QUICK_REPLICAS if quick else Effort.replicas
        effort = Effort(replicas, max_mechanisms or MAX_MECHANISMS[quick], exact_loo)
        settings = replace(DIAGNOSIS_SAMPLING, seed=seed).settings("hierarchical")
        document = diagnose_to(
            problem, law, settings, effort, folder, output.tell, lock=lock or 0, folds=outer_folds or 0
        )
        output.tell("writing the report")
        write_reports(folder)
    output.show(document, diagnosis_table, [], folder)  # the statement is in the table
    return DONE if document["reason"] is None else NOT_CONVERGED
