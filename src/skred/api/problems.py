"""From the names of campaigns and laws to what they name, or what is wrong with them.

Everything heavy is imported inside the functions, so that a command's ``--help`` is instant.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from skred.api.arguments import LIKELIHOODS, one_of, scales
from skred.api.arguments import smoothing as smoothing_length
from skred.api.named import ByName
from skred.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from skred.campaign import Campaign
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.physics.law import Law
    from skred.physics.mechanisms.spec import Mechanism


def read_campaign(name: str | Path) -> Campaign:
    """Read a campaign and check all of it.

    Parameters
    ----------
    name : str or Path
        A folder of five files, or the name of an included campaign such as ``ryggfonn``.

    Returns
    -------
    Campaign
        Track, sensors, events, and the readings as arrays of shape (n_events, n_sensors), in m/s and m.

    Raises
    ------
    skred.campaign.CampaignError
        With every problem of the files.
    """
    return campaign_of(name)


def laws() -> dict[str, Law]:
    """The laws that are installed, by id; those that cannot be used are left out.

    Returns
    -------
    dict of Law
        As ``laws()["pcm"]``. A law has `parameters` and an `equation`; its PyMC model is that of `model`.

    Raises
    ------
    skred.InputError
        Also a KeyError: where a law is asked for by another name than these.
    """
    from skred.physics.laws import installed_laws

    return ByName("law laws", {law.id: law for law in installed_laws()[0]})


def mechanisms() -> dict[str, Mechanism]:
    """The mechanisms that are installed, by id; ``law + mechanism`` is a law.

    Returns
    -------
    dict of Mechanism
        Forces on a front, and faults of the instruments. Of these only forces that act alike along the whole
        track can be added to a law.

    Raises
    ------
    skred.InputError
        Also a KeyError: where a mechanism is asked for by another name than these.
    """
    from skred.physics.mechanisms.library import mechanisms as installed

    return ByName("mechanism mechanisms", installed())


def chosen_laws(given: list[str | Law], priors: Mapping[str, float] | None) -> list[Law]:
    """Laws by id or as they are, each once, with the scales of priors that are given."""
    from skred.inference.priors import laws_with_priors
    from skred.physics.law import Law
    from skred.physics.laws import load_law

    loaded = dict[str, Law]()
    for one in given:
        if not isinstance(one, (str, Law)) or one == "":
            raise InputError(f"law: expected an id or a law of skred.laws(), found {one!r:.60}")
        law = load_law(one) if isinstance(one, str) else one
        if loaded.setdefault(law.id, law) != law:
            raise InputError(f"laws: two different ones are named {law.id!r:.60}; results go by that name")
    if not loaded:
        raise InputError("laws: expected at least one")
    return laws_with_priors(list(loaded.values()), scales(priors))


def campaign_of(given: str | Path | Campaign) -> Campaign:
    """A campaign that passed every check."""
    from skred.campaign import Campaign, find_campaign, read_campaign

    if isinstance(given, Campaign):
        return given
    if not isinstance(given, (str, Path)) or given == "":
        raise InputError(f"campaign: expected a folder, a name or a campaign, found {given!r:.60}")
    return read_campaign(find_campaign(str(given)))


def problem_of(
    campaign: str | Path | Campaign, likelihood: str, errors: str | None, smoothing: float | None
) -> PooledProblem | HierarchicalProblem:
    """The problem of a campaign, or what is wrong with it."""
    one_of("likelihood", likelihood, LIKELIHOODS)
    checked = campaign_of(campaign)
    smoothing = smoothing_length(smoothing)
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
    campaign: Campaign, errors: str | None = None, smoothing: float | None = None
) -> HierarchicalProblem:
    """The hierarchical problem of a campaign, or what is wrong with it."""
    from skred.inference.error_model import DEFAULT_ERRORS, ERROR_MODELS
    from skred.inference.hierarchical.problem import hierarchical_problem

    if errors is not None:
        one_of("errors", errors, tuple(ERROR_MODELS))
    smoothing = smoothing_length(smoothing)
    try:
        return hierarchical_problem(campaign, error_model=errors or DEFAULT_ERRORS, smoothing_m=smoothing)
    except ValueError as error:
        raise InputError(f"campaign {campaign.name}: {error}") from error


def pooled_or_reason(campaign: Campaign, smoothing: float | None) -> PooledProblem | str:
    """The pooled problem of a campaign, or why there is none."""
    from skred.inference.pooled.problem import pooled_problem

    try:
        problem = pooled_problem(campaign, smoothing_m=smoothing)
        _ = problem.arrays
    except ValueError as error:
        return str(error)
    return problem
