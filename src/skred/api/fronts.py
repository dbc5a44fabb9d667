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
        Of the law, by name, each in its unit.

    Returns
    -------
    (n, n_sensors) tensor, m/s or m for a runout
        0 where a front does not come. It has gradients; ``.eval()`` gives the numbers.

    Raises
    ------
    skred.errors.InputError
        If the campaign, the law or the smoothing length cannot be used.
    TypeError
        If parameters are missing or unknown; the message names those of the law.
    """
    import pytensor.tensor as pt

    from skred.inference.pooled.forward_op import front_readings as readings
    from skred.physics.geometry import contributions_of, path_of, sensor_table
    from skred.physics.terrain import build_terrain

    smoothing_m = arguments.smoothing(smoothing_m)
    [chosen], recorded = chosen_laws([law], None), campaign_of(campaign)
    if set(parameters) != set(chosen.parameter_names):
        raise TypeError(
            f"front_readings: expected the parameters {', '.join(chosen.parameter_names)} of {chosen.id!r},"
            f" found {', '.join(sorted(parameters)) or 'none'}"
        )
    track = recorded.track
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    places = [None if one.is_runout else (one.s_from_m, one.s_to_m) for one in recorded.sensors]
    coefficients = chosen.strengths(*(pt.as_tensor(parameters[name]) for name in chosen.parameter_names))
    columns = [pt.atleast_1d(pt.cast(one, "float64")) for one in (*coefficients, pt.as_tensor(release_s_m))]
    *strengths, releases = pt.broadcast_arrays(*columns)
    law_terms = contributions_of(chosen.mechanisms, terrain)
    found: TensorVariable = readings(
        pt.stack(strengths, axis=1), releases, path_of(terrain), law_terms, sensor_table(places)
    )
    return found
