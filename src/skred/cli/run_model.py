"""A law of the pack as a program: ``python -m models.pcm``.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import sys

from cyclopts import App

from skred.cli.calibrate import calibrate as calibrate_installed
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, Likelihood, Priors, Samplers, Sampling
from skred.cli.output import OUTPUT, Output
from skred.cli.program import exit_code_of, new_program


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
        return calibrate_installed(
            law_id,
            campaign,
            likelihood=likelihood,
            priors=priors,
            sampler=sampler,
            sampling=sampling,
            output=output,
        )

    program.default(calibrate)
    return program
