"""A law of the pack as a program: ``python -m models.pcm``.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import sys
from typing import TYPE_CHECKING

from cyclopts import App

from skred.api.work import calibrate_to
from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.hints import tell_hints
from skred.cli.inputs import law_of, problem_of
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, Likelihood, Priors, Samplers, Sampling
from skred.cli.output import OUTPUT, Output
from skred.cli.program import exit_code_of, new_program

if TYPE_CHECKING:
    from skred.inference.problem import Problem
    from skred.physics.law import Law


def run_model(law_id: str) -> None:
    """Run a law of the pack as a program: ``python -m models.pcm``."""
    sys.exit(exit_code_of(lambda: _law_program(law_id)(sys.argv[1:], exit_on_error=False)))


def _law_program(law_id: str) -> App:
    """A program with one command, named and described by a law."""
    from skred.physics.laws import load_law

    program = new_program(f"python -m models.{law_id}", f"Calibrate a law: {load_law(law_id).title}.")

    def calibrate(
        *,
        campaign: Campaigns = "ryggfonn",
        likelihood: Likelihood = LIKELIHOOD,
        priors: Priors = None,
        sampler: Samplers = "metropolis",
        sampling: Sampling = SAMPLING,
        output: Output = OUTPUT,
    ) -> int:
        """Sample the posterior, check it, and write summary.json, posterior.nc and figures."""
        law = law_of(law_id, priors)
        problem = problem_of(campaign, likelihood.likelihood, likelihood.errors, likelihood.smoothing)
        return calibrate_law(law, problem, sampling, sampler, output)

    program.default(calibrate)
    return program


def calibrate_law(
    law: "Law", problem: "Problem", sampling: Sampling, sampler: Samplers, output: Output
) -> int:
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
