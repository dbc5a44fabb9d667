"""Draws of an augmented law, with where what was added acts and how strong it is over all places."""

from __future__ import annotations

import numpy as np
import xarray as xr

from skred.diagnosis.augment.coefficient import augmented_of, strength_of
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.predict.unseen import ProfileTerm
from skred.inference.added_terms import GROUP, AddedTerm, added_group
from skred.inference.hierarchical.population import POPULATION, population_group
from skred.inference.intervals import ENDS
from skred.inference.recorded_data import recorded_groups
from skred.physics.mechanisms.spec import BoundTo, Group, Shape

FORCE = "a force that is in no list"


def augmented_draws(found: Diagnosis) -> xr.DataTree:
    """The draws of the last calibration, and a group ``added`` with what the verdict says.

    The chains hold the place at the best one, so that their spread of a strength is too narrow; the group has
    its mean and standard deviation over all places, and quantiles of both ends of the place, (added,) and
    (added, quantile), NaN where it is not local; and what `skred.inference.added_terms` needs to use the law
    again, at the best place.
    """
    calibration = found.steps[-1].calibration
    added = augmented_of(calibration).added
    names = [one.name for one in added]
    units = [step.candidate.mechanism.strength.unit for step in found.steps]
    strengths = [strength_of(found.steps, number) for number in range(len(names))]
    quantiles = (ENDS[0], 0.5, ENDS[1])
    ends = np.array(
        [[step.candidate.ends(share) or (np.nan, np.nan) for share in quantiles] for step in found.steps]
    )
    about_ends = {"units": "m", "comment": "quantiles over the posterior of the place"}
    group = xr.Dataset(
        {
            "strength_mean": ("added", [one.mean for one in strengths]),
            "strength_sd": ("added", [one.sd for one in strengths]),
            "unit": ("added", units),
            "s_from": (("added", "quantile"), ends[:, :, 0], about_ends),
            "s_to": (("added", "quantile"), ends[:, :, 1], about_ends),
        },
        coords={"added": names, "quantile": list(quantiles)},
        attrs={"comment": "over all places, with the allowance for the form of the term; as in verdict.json"},
    )
    terms = [
        AddedTerm(
            one.name,
            one.mechanism.id,
            one.mechanism.title,
            one.mechanism.group,
            one.added.bound_to,
            one.shape,
            one.direction,
            one.between,
            one.between_name,
        )
        for one in added
    ]
    groups = {path: node.to_dataset() for path, node in calibration.tree.subtree_with_keys}
    return xr.DataTree.from_dict({**groups, GROUP: group.merge(added_group(terms))})


def profile_draws(found: Diagnosis, law: ProfileLaw) -> xr.DataTree:
    """The law with a force that is in no list: a group of populations, and one of the force's values.

    Groups
    ------
    population : see `skred.inference.hierarchical.population.population_group`; ``added_strengths``
        (draw, added) are the force's values at its knots
    added : see `skred.inference.added_terms.added_group`, a term for each knot
    observed_data, constant_data : as of any calibration
    """
    setting = found.comparison.leading(UNLISTED).base.setting
    knots, kind = law.profile.knots_m, law.profile.kind
    directions = ProfileTerm.of(law.profile, setting).directions(setting)
    ends = [*knots[:1], *knots, *knots[-1:]]
    terms = [
        AddedTerm(
            f"force_at_{knot:.0f}_m",
            UNLISTED,
            FORCE,
            Group.PHYSICS,
            BoundTo.PLACE,
            Shape(float(ends[k]), float(ends[k + 2])),
            direction,
        )
        for k, (knot, direction) in enumerate(zip(knots, directions, strict=True))
    ]
    draws = law.draws_after
    strengths = draws.strengths[:, -len(knots) :]
    population = population_group(found.law, draws.means, draws.factors)
    population["added_strengths"] = (("draw", GROUP), strengths, {"units": kind.unit})
    population = population.assign_coords({GROUP: [term.name for term in terms]})
    groups = {POPULATION: population, GROUP: added_group(terms), **recorded_groups(found.problem)}
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = {**found.calibration.tree.attrs, "error_model": law.error_model}
    return tree
