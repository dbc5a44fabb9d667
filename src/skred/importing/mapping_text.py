"""The text of a mapping file, with comments for who reads or changes it."""

from typing import Any

import tomlkit

from skred.importing.mapping import Mapping

_COMMENTS = {
    "campaign": "keys of campaign.toml that the tables do not hold",
    "table": "how tables are written: encoding, separator, decimal, thousands, sheet, header_row",
    "tables": "what one of several tables has otherwise: how it is written, and its columns",
    "track": "the track: file (beside this one), its columns x and z, and how it is written",
    "cells": "what a cell without a number says of a velocity: missing or not_reached",
    "velocity": "holds for every velocity: unit, place (s, x, altitude, reference), relative_sd, absolute_sd",
    "runout": "holds for every runout: unit, place (s, x, altitude, reference), absolute_sd along the track, "
    "and with altitudes whether bounds speak of the runout or of the altitude",
    "release": "where avalanches start: s_m for all of them, or the place that a column gives",
    "columns": "every column: event, release, release_sd, front_velocity, runout, sd, covariate or ignore",
}


def mapping_text(mapping: Mapping) -> str:
    """The mapping as TOML that `read_mapping` reads back equal."""
    document = tomlkit.document()
    document.add(tomlkit.comment("How a table was read. The next one of its kind imports without questions:"))
    document.add(tomlkit.comment("skred import TABLE --mapping THIS-FILE --out FOLDER"))
    document.add("format", tomlkit.item(1))
    for name, content in mapping.content().items():
        if name == "format" or not content:
            continue
        table = tomlkit.table()
        table.comment(_COMMENTS[name])
        for key, value in content.items():
            table.add(key, _item(value))
        document.add(tomlkit.nl())
        document.add(name, table)
    return tomlkit.dumps(document)


def _item(value: Any) -> Any:
    """A value; a table in one line."""
    if not isinstance(value, dict):
        return tomlkit.item(value)
    inline = tomlkit.inline_table()
    for key, one in value.items():
        inline.add(key, _item(one))
    return inline
