"""``skred compare``: which law the recordings prefer.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from skred.api.calibration import compare_to
from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints
from skred.cli.inputs import laws_of, problem_of
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, ExactLoo, Likelihood, Models, Priors, Sampling
from skred.cli.output import OUTPUT, Output


def compare(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    models: Models = "coulomb,pcm,constant,voellmy",
    likelihood: Likelihood = LIKELIHOOD,
    priors: Priors = None,
    exact_loo: ExactLoo = False,
    sampling: Sampling = SAMPLING,
    output: Output = OUTPUT,
) -> int:
    """Calibrate several laws and say which one the recordings prefer, and by how much."""
    laws = laws_of(models, priors)
    problem = problem_of(campaign, likelihood.likelihood, likelihood.errors, likelihood.smoothing)
    tell_hints(problem, output.tell)
    with output.results("compare") as results:
        settings = sampling.settings(problem.likelihood)
        comparison = compare_to(problem, laws, settings, results.unfinished, output.tell, exact=exact_loo)
        from skred.report.folders import write_reports

        output.tell("writing the report")
        write_reports(results.unfinished)

    from skred.report.shared.tables import comparison_table

    output.show(comparison, comparison_table, comparison["statement"], results.path)
    return DONE if all(model["gate"]["passed"] for model in comparison["models"]) else NOT_CONVERGED
