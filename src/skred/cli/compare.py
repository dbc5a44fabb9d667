"""``skred compare``: which law the recordings prefer.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints
from skred.cli.inputs import laws_of, pooled_or_reason, problem_of
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, ExactLoo, Likelihood, Models, Sampling
from skred.cli.output import OUTPUT, Output

if TYPE_CHECKING:
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.physics.law import Law


def compare(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    models: Models = "coulomb,pcm,constant,voellmy",
    likelihood: Likelihood = LIKELIHOOD,
    exact_loo: ExactLoo = False,
    sampling: Sampling = SAMPLING,
    output: Output = OUTPUT,
) -> int:
    """Calibrate several laws and say which one the recordings prefer, and by how much."""
    laws = laws_of(models)
    problem = problem_of(campaign, likelihood.likelihood, likelihood.errors, likelihood.smoothing)
    tell_hints(problem, output.tell)
    with output.results("compare") as results:
        comparison = _compared(problem, laws, sampling, results.unfinished, output, exact=exact_loo)
        from skred.report.folders import write_reports

        output.tell("writing the report")
        write_reports(results.unfinished)

    from skred.report.shared.tables import comparison_table

    output.show(comparison, comparison_table, comparison["statement"], results.path / "report.html")
    return DONE if all(model["gate"]["passed"] for model in comparison["models"]) else NOT_CONVERGED


def _compared(
    problem: "PooledProblem | HierarchicalProblem",
    laws: "list[Law]",
    sampling: Sampling,
    folder: Path,
    output: Output,
    *,
    exact: bool,
) -> dict[str, Any]:
    """Compare by the likelihood that the problem is for."""
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.model_selection.compare import compare as compare_pooled
    from skred.model_selection.compare_hierarchical import compare_hierarchical

    settings, tell = sampling.settings(problem.likelihood), output.tell
    if isinstance(problem, HierarchicalProblem):
        pooled = pooled_or_reason(problem.campaign, problem.terrain.smoothing_m)
        return compare_hierarchical(problem, pooled, laws, settings, folder, tell, exact=exact)
    return compare_pooled(problem, laws, settings, folder, tell)
