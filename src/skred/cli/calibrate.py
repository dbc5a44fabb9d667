"""``skred calibrate``: an installed law on a campaign, as ``python -m models.pcm`` does for one of the pack.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from typing import Annotated

from cyclopts import Parameter

from skred.cli.inputs import law_of, problem_of
from skred.cli.options import LIKELIHOOD, SAMPLING, Campaigns, Likelihood, Priors, Samplers, Sampling
from skred.cli.output import OUTPUT, Output
from skred.cli.run_model import calibrate_law

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
    return calibrate_law(chosen, problem, sampling, sampler, output)
