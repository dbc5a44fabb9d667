"""A law of the pack as a program: ``python -m models.pcm``.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import sys
from typing import TYPE_CHECKING

from skred.cli.exit_codes import DONE, NOT_CONVERGED
from skred.cli.inputs import problem_of
from skred.cli.options import SAMPLING, Campaigns, Errors, Likelihoods, Samplers, Sampling, Smoothing
from skred.cli.output import OUTPUT, Output
from skred.cli.program import new_program, run_program

if TYPE_CHECKING:
    from skred.inference.problem import Problem


def run_model(law_id: str) -> None:
    """Run a law of the pack as a program: ``python -m models.pcm``."""
    from skred.physics.laws import load_law

    program = new_program(f"python -m models.{law_id}", f"Calibrate a law: {load_law(law_id).title}.")

    def calibrate(
        *,
        campaign: Campaigns = "ryggfonn",
        likelihood: Likelihoods = "pooled",
        errors: Errors = None,
        sampler: Samplers = "metropolis",
        sampling: Sampling = SAMPLING,
        smoothing: Smoothing = 10.0,
        output: Output = OUTPUT,
    ) -> int:
        """Sample the posterior, check it, and write summary.json, posterior.nc and figures."""
        problem = problem_of(campaign, likelihood, errors, smoothing)
        return calibrate_law(law_id, problem, sampling, sampler, output)

    program.default(calibrate)
    sys.exit(run_program(sys.argv[1:], program))


def calibrate_law(
    law_id: str, problem: "Problem", sampling: Sampling, sampler: Samplers, output: Output
) -> int:
    """Calibrate one law and tell what came out."""
    from skred.physics.laws import load_law

    law = load_law(law_id)
    folder = output.folder(law_id)
    output.tell(f"{law_id}: sampling")

    from skred.inference.calibrate import calibrate, write_calibration
    from skred.report.folders import write_reports
    from skred.report.shared.tables import summary_table

    settings = sampling.settings(problem.likelihood, sampler)
    calibration = calibrate(problem, law, settings, progress=output.progress)
    output.tell(f"{law_id}: writing {folder}")
    write_calibration(calibration, folder)
    write_reports(folder)
    gate = calibration.gate
    verdict = "the chains can be trusted" if gate.passed else "THE GATE FAILED: do not use this result"
    measured = f"r-hat at most {gate.r_hat_max:.3f}, effective draws at least {gate.ess_bulk_min:.0f}"
    output.show(calibration.entry(), summary_table, [f"{verdict} ({measured})", *gate.problems], folder)
    return DONE if gate.passed else NOT_CONVERGED
