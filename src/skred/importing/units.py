"""Units as people write them in the names of columns."""

import re

from skred.campaign.reading import EVENTS

_BRACKETS = re.compile(r"(.*?)[\s_]*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*")
_TRAILING = re.compile(
    r"(.+?)[\s_]+(m/s|km/h|kmh|m s-1|km h-1|m_s|km_h|km|cm|mm|ft|mph|kn|deg)", re.IGNORECASE
)
"""Units without brackets; those that no reading has are here so that they are asked about."""
_RESERVED = frozenset(column.name for column in EVENTS)
_VELOCITY = {
    "m/s": "m/s", "m s-1": "m/s", "m s^-1": "m/s", "ms-1": "m/s", "m s⁻¹": "m/s", "m_s": "m/s",
    "km/h": "km/h", "kmh": "km/h", "kph": "km/h", "km h-1": "km/h", "km/t": "km/h", "km h⁻¹": "km/h",
    "km_h": "km/h",
}  # fmt: skip
METRES = r"m|met(?:er|re)s?|m ?a\.? ?s\.? ?l\.?|masl|m ?ü\.? ?m\.?|m ?ü\.? ?nn|m\.? ?o\.? ?h\.?"
"""Metres, and metres above the sea; a part of a pattern."""
_METRES = re.compile(METRES, re.IGNORECASE)
_NO_UNIT = re.compile(r"altitude|elevation|height|höhe", re.IGNORECASE)
"""What stands in brackets and is a kind of place."""
OF_KIND = {"front_velocity": ("m/s", "km/h"), "runout": ("m", "km"), "sd": ("m/s", "km/h", "m", "km")}
"""Units that readings can have, the format's own first."""


def base_and_unit(name: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit as it stands there; empty where there is none."""
    if name in _RESERVED:
        return name, ""  # a release's speed is a column of its own
    for pattern in (_BRACKETS, _TRAILING):
        found = pattern.fullmatch(name)
        if found is not None and found.group(1):
            return found.group(1).strip(), found.group(2)
    return name, ""


def unit_of(kind: str, name: str) -> str | None:
    """The unit of a column of readings, or of their standard deviations, by its name.

    Returns
    -------
    str or None
        Empty where the name has none; None where it has one that such readings are not given in.
    """
    written = base_and_unit(name)[1]
    if written == "" or kind not in OF_KIND:
        return ""
    unit = _VELOCITY.get(written.casefold())
    if unit is None and _METRES.fullmatch(written):
        unit = "m"
    elif unit is None and written.casefold() == "km":
        unit = "km"
    if unit is None and kind == "runout" and _NO_UNIT.fullmatch(written):
        return ""
    return unit if unit in OF_KIND[kind] else None
