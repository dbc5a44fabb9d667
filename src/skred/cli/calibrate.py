"""``skred calibrate``: an installed law on a campaign, as ``python -m models.pcm`` does for one of the pack.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from skred.api.calibration import calibrate_to
from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints
from skred.cli.inputs import law_of, problem_of
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, Likelihood, Priors, Samplers, Sampling
from skred.cli.output import OUTPUT, Output

if TYPE_CHECKING:
    from skred.inference.problem import Problem
    from skred.physics.law import Law

LawIds = Annotated[str, Parameter(help="The law: of the pack, or of any other package that is installed.")]


def calibrate(
    law: LawIds,
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    likelihood: Likelihood = LIKELIHOOD,
    priors: Priors = None,
    sampler: Samplers = "metropolis",
    sampling: Sampling = SAMPLING,
    output: Output = OUTPUT,
) -> int:
    """Calibrate one law: sample the posterior, check it, and write summary.json, posterior.nc and figures."""
    chosen = law_of(law, priors)  # before a campaign is read: a wrong name is told at once
    problem = problem_of(campaign, likelihood.likelihood, likelihood.errors, likelihood.smoothing)
    return _calibrate(chosen, problem, sampling, sampler, output)


def _calibrate(law: "Law", problem: "Problem", sampling: Sampling, sampler: Samplers, output: Output) -> int:
    """Calibrate one law, write its results and tell what came out.

    Returns
    -------
    int
        The exit code.
    """
    tell_hints(problem, output.tell)
    if sampler == "nuts":
        from skred.inference.sampling import KINKED

        output.tell(KINKED)
    with output.results("calibrate", law.id) as results:
        output.tell(f"{law.id}: sampling")

        from skred.inference.fit import calibration_statement
        from skred.report.folders import write_reports
        from skred.report.shared.tables import summary_table

        settings = sampling.settings(problem.likelihood, sampler)
        calibration = calibrate_to(problem, law, settings, results.unfinished, progress=output.progress)
        output.tell(f"{law.id}: writing {results.path}")
        write_reports(results.unfinished)
    entry = calibration.entry()
    output.show(entry, summary_table, calibration_statement(entry), results.path)
    return DONE if calibration.gate.passed else NOT_CONVERGED
