"""Result files: small and readable, one trial a line, written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skred.output import plain, write_text

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DIGITS = 8
"""Significant digits that are kept."""


def read(file: Path) -> Any:
    """Content of a result file."""
    return json.loads(file.read_text(encoding="utf-8"))


def write(file: Path, document: Mapping[str, Any]) -> None:
    """Write a result file; a mapping or a list of many records has one of them a line."""
    write_text(file, as_text(rounded(plain(dict(document)))))


def as_text(document: Mapping[str, Any]) -> str:
    """A JSON object with one key a line; within lists and objects of objects, one of these a line."""
    lines = (f"{json.dumps(key)}: {_in_lines(value)}" for key, value in document.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _in_lines(value: Any) -> str:
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        return "[\n" + ",\n".join(f" {_text(one)}" for one in value) + "\n]"
    if isinstance(value, dict) and value and all(isinstance(one, dict) for one in value.values()):
        return "{\n" + ",\n".join(f" {json.dumps(key)}: {_text(one)}" for key, one in value.items()) + "\n}"
    return _text(value)


def _text(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def rounded(value: Any, digits: int = DIGITS) -> Any:
    """Plain data with so many significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}")
    if isinstance(value, dict):
        return {key: rounded(item, digits) for key, item in value.items()}
    return [rounded(item, digits) for item in value] if isinstance(value, list) else value


def as_columns(rows: Sequence[Any]) -> Any:
    """Objects with equal keys as one object of columns, and so on within; anything else as the list it is."""
    first = rows[0] if rows else None
    if not isinstance(first, dict) or not first:
        return list(rows)
    if any(not isinstance(row, dict) or row.keys() != first.keys() for row in rows):
        return list(rows)
    return {key: as_columns([row[key] for row in rows]) for key in first}


def as_rows(columns: Any) -> list[Any]:
    """What `as_columns` was given."""
    if not isinstance(columns, dict):
        return list(columns)
    parts = {key: as_rows(column) for key, column in columns.items()}
    return [dict(zip(parts, row, strict=True)) for row in zip(*parts.values(), strict=True)]


def shrink(picture: Path) -> None:
    """Write a PNG file anew with a palette of at most 256 colours, which is what a plot has."""
    from PIL import Image

    with Image.open(picture) as image:
        small = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    partial = picture.with_name(f".{picture.name}.partial")
    small.save(partial, format="PNG", optimize=True)
    partial.replace(picture)
