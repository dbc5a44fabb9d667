"""From the words of a command line to what they name, or what is wrong with them.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from typing import TYPE_CHECKING

from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.physics.law import Law


def laws_of(names: str) -> "list[Law]":
    """Laws from a list of names; each once."""
    from skred.physics.laws import load_law

    wanted = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    if not wanted:
        raise InputError("--models: expected names of laws separated by commas, found none")
    return [load_law(name) for name in wanted]


def campaign_of(name: str) -> "Campaign":
    """A campaign that passed every check."""
    from skred.campaign import find_campaign, read_campaign

    return read_campaign(find_campaign(name))


def problem_of(
    campaign: str, likelihood: str, errors: str | None, smoothing: float | None
) -> "PooledProblem | HierarchicalProblem":
    """The problem of a campaign, or what is wrong with it."""
    checked = campaign_of(campaign)
    if likelihood == "hierarchical":
        return hierarchical_of(checked, errors, smoothing)
    if errors is not None:
        raise InputError(
            "--errors: only with --likelihood hierarchical; pooled errors come from the recordings"
        )
    problem = pooled_or_reason(checked, smoothing)
    if isinstance(problem, str):
        raise InputError(f"campaign {checked.name}: {problem}")
    return problem


def hierarchical_of(
    campaign: "Campaign", errors: str | None, smoothing: float | None
) -> "HierarchicalProblem":
    """The hierarchical problem of a campaign, or what is wrong with it."""
    from skred.inference.error_model import DEFAULT_ERRORS
    from skred.inference.hierarchical.problem import hierarchical_problem

    try:
        return hierarchical_problem(campaign, error_model=errors or DEFAULT_ERRORS, smoothing_m=smoothing)
    except ValueError as error:
        raise InputError(f"campaign {campaign.name}: {error}") from error


def pooled_or_reason(campaign: "Campaign", smoothing: float | None) -> "PooledProblem | str":
    """The pooled problem of a campaign, or why there is none."""
    from skred.inference.pooled.problem import pooled_problem

    try:
        problem = pooled_problem(campaign, smoothing_m=smoothing)
        _ = problem.arrays
    except ValueError as error:
        return str(error)
    return problem
