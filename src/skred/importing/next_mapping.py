"""The mapping file of an import: everything that was declared and understood, for the next tables."""

from collections.abc import Mapping as Map
from typing import Any

from skred.importing.mapping import Column, Mapping
from skred.importing.numbers import Notation
from skred.importing.track_table import TrackRead


def mapping_of_five(declared: Mapping, notation: Notation, track: TrackRead) -> Mapping:
    """The mapping after an import of the campaign format's own tables."""
    content = _common(declared, track)
    if notation.decimal == ",":
        content.setdefault("table", {})["decimal"] = ","
    return Mapping.model_validate(content)


def mapping_of_wide(
    declared: Mapping, columns: Map[str, Map[str, Column]], notations: Map[str, Notation], track: TrackRead
) -> Mapping:
    """The mapping after an import of wide tables.

    Parameters
    ----------
    declared : Mapping
    columns : mapping
        What every column of every table is, by the table's key.
    notations : mapping
        How each table writes numbers.
    track : TrackRead

    Returns
    -------
    Mapping
        What all tables share stands once; what one of them has otherwise, under its own name.
    """
    content = _common(declared, track)
    content["track"]["file"] = "track.csv"  # the campaign's own, which lies beside the mapping file
    tables: dict[str, dict[str, Any]] = content.pop("tables", {})
    for one in tables.values():
        one.pop("columns", None)
    decimals = {key: notation.decimal for key, notation in notations.items()}
    if set(decimals.values()) == {","}:
        content.setdefault("table", {})["decimal"] = ","
    elif "," in decimals.values():
        for key, decimal in decimals.items():
            tables.setdefault(key, {})["decimal"] = decimal
    shared = dict[str, Any]()
    for key, own in columns.items():
        for name, column in own.items():
            meant = column.model_dump(by_alias=True, exclude_none=True)
            if shared.setdefault(name, meant) != meant:
                tables.setdefault(key, {}).setdefault("columns", {})[name] = meant
    return Mapping.model_validate({**content, "tables": tables, "columns": shared})


def _common(declared: Mapping, track: TrackRead) -> dict[str, Any]:
    """What is kept of every import."""
    own = {} if track.x == "x_m" and track.z == "z_m" else {"x": track.x, "z": track.z}
    campaign = declared.campaign.model_copy(update={"name": None})
    return {
        **declared.content(),
        "campaign": campaign.model_dump(exclude_none=True),
        "track": own,
    }
