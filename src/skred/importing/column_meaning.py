"""The meaning of a column as it is held while a table is understood."""

from collections.abc import Mapping
from dataclasses import dataclass

from skred.importing.mapping import Column
from skred.importing.units import base_and_unit


@dataclass(frozen=True)
class Meaning:
    """What a column is, whether somebody said so, and what of it is not understood.

    Attributes
    ----------
    column : Column
    declared : bool
    foreign_unit : str
        A unit in the column's name that its readings are not given in; empty where there is none.
    """

    column: Column
    declared: bool
    foreign_unit: str = ""


def sensor_id(name: str, column: Column) -> str:
    """Id of a column's sensor: as declared, or the column's name without its unit."""
    return column.sensor or base_and_unit(name)[0]


def by_sensor(meanings: Mapping[str, Meaning]) -> dict[str, dict[str, Column]]:
    """The columns of readings by their sensors' ids."""
    found = dict[str, dict[str, Column]]()
    for name, one in meanings.items():
        if one.column.is_ in ("front_velocity", "runout"):
            found.setdefault(sensor_id(name, one.column), {})[name] = one.column
    return found
