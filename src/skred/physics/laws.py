"""The laws that are installed, from any pack: entry points in the group ``skred.laws``."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from skred.errors import InputError

if TYPE_CHECKING:
    from skred.physics.law import Law

GROUP = "skred.laws"


class UnknownLawError(InputError):
    """A law was asked for that no installed pack provides."""


def law_ids() -> list[str]:
    """Ids of the installed laws, sorted."""
    return sorted({entry.name for entry in entry_points(group=GROUP)})


def load_law(law_id: str) -> Law:
    """Load one law.

    Raises
    ------
    UnknownLawError
        If no installed pack provides it.
    InputError
        If the pack's law is not one: its inverse does not undo its strengths.
    """
    for entry in entry_points(group=GROUP):
        if entry.name == law_id:
            try:
                law: Law = entry.load()
            except ValueError as error:
                raise InputError(f"the law {law_id!r} of {entry.value} cannot be used: {error}") from error
            return law
    raise UnknownLawError(f"no law named {law_id!r}; there are: {', '.join(law_ids())}")
