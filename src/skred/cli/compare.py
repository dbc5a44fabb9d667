"""``skred compare``: which law the recordings prefer.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.inputs import laws_of, pooled_or_reason, problem_of
from skred.cli.options import SAMPLING, Campaigns, Errors, ExactLoo, Likelihoods, Models, Sampling, Smoothing
from skred.cli.output import OUTPUT, Output


def compare(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    models: Models = "coulomb,pcm,constant,voellmy",
    likelihood: Likelihoods = "pooled",
    errors: Errors = None,
    exact_loo: ExactLoo = False,
    sampling: Sampling = SAMPLING,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Calibrate several laws and say which one the recordings prefer, and by how much."""
    laws = laws_of(models)
    problem = problem_of(campaign, likelihood, errors, smoothing)
    folder = output.folder("compare")

    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.model_selection.compare import compare as compare_pooled
    from skred.model_selection.compare_hierarchical import compare_hierarchical
    from skred.report.folders import write_reports
    from skred.report.shared.tables import comparison_table

    settings, tell = sampling.settings(likelihood), output.tell
    if isinstance(problem, HierarchicalProblem):
        pooled = pooled_or_reason(problem.campaign, smoothing)
        comparison = compare_hierarchical(problem, pooled, laws, settings, folder, tell, exact=exact_loo)
    else:
        comparison = compare_pooled(problem, laws, settings, folder, tell)
    tell("writing the report")
    write_reports(folder)
    output.show(comparison, comparison_table, comparison["statement"], folder / "report.html")
    return DONE if all(model["gate"]["passed"] for model in comparison["models"]) else NOT_CONVERGED
