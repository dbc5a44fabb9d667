"""Which sensors' places have stated errors, as shifts with these as priors: nuisances of every model."""

from __future__ import annotations

from skred.diagnosis.evidence.coefficient import Base
from skred.physics.mechanisms.placed import PlacedMechanism, added_of, placed
from skred.physics.mechanisms.sensor_place import MECHANISM
from skred.physics.mechanisms.spec import Shape


def stated_places(base: Base) -> list[PlacedMechanism]:
    """The shift of each sensor of front velocity whose place has a stated error: its prior's scale."""
    usual = added_of(MECHANISM).scale
    stated = [one for one in base.problem.campaign.sensors if one.place_sd_m and not one.is_runout]
    shapes = [Shape(sensor=one.id, prior_scales=(one.place_sd_m or usual) / usual) for one in stated]
    return [placed(MECHANISM, base.setting, shape) for shape in shapes]
