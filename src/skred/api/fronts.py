"""Readings of fronts as a differentiable PyTensor expression: to build models of one's own around."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.api import arguments
from skred.api.problems import campaign_of, chosen_laws

if TYPE_CHECKING:
    from pytensor.tensor.variable import TensorVariable

    from skred.campaign import Campaign
    from skred.physics.law import Law


@arguments.told_by_name
def front_readings(
    law: str | Law,
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    release_s_m: Any = 0.0,
    smoothing_m: float | None = None,
    **parameters: Any,
) -> TensorVariable:
    """What the campaign's sensors read of fronts that a law brakes, without errors.

    Parameters
    ----------
    law : str or Law
        Its id, or itself.
    campaign : str, Path or Campaign
        Its track and its sensors are used, not its recordings.
    release_s_m : scalar or (n,) tensor or array, m
        Where the fronts start from rest.
    smoothing_m : float, optional
        Smoothing length of the terrain [m]; by default 10, in proportion less on tracks below 600 m.
    **parameters : scalar or (n,) tensor or array
        Of the law, by name, each in its unit. Numbers are checked: none may be below 0. Symbolic tensors are
        not; their priors must keep them within what a law takes.

    Returns
    -------
    (n, n_sensors) tensor, m/s or m for a runout
        0 where a front does not come. It has gradients; ``.eval()`` gives the numbers.

    Raises
    ------
    skred.InputError
        If the campaign, the law or the smoothing length cannot be used; if parameters are missing, unknown,
        or no numbers that the law takes; if their lengths differ.
    """
    import pytensor.tensor as pt

    from skred.api.front_inputs import checked_columns, checked_names
    from skred.inference.pooled.forward_op import front_readings as readings
    from skred.physics.geometry import contributions_of, path_of, sensor_table
    from skred.physics.terrain import build_terrain

    smoothing_m = arguments.smoothing(smoothing_m)
    [chosen], recorded = chosen_laws([law], None), campaign_of(campaign)
    checked_names(chosen, parameters)
    columns = checked_columns(chosen, parameters, release_s_m, recorded.track.length_m)
    track = recorded.track
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    places = [None if one.is_runout else (one.s_from_m, one.s_to_m) for one in recorded.sensors]
    *given, places_of_release = (pt.as_tensor(one) for one in columns.values())
    rows = [pt.atleast_1d(pt.cast(one, "float64")) for one in (*chosen.strengths(*given), places_of_release)]
    *strengths, releases = pt.broadcast_arrays(*rows)
    law_terms = contributions_of(chosen.mechanisms, terrain)
    found: TensorVariable = readings(
        pt.stack(strengths, axis=1), releases, path_of(terrain), law_terms, sensor_table(places)
    )
    return found
