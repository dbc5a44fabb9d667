"""The laws that are installed, from any package: entry points in the group ``skred.laws``."""

from __future__ import annotations

from importlib.metadata import EntryPoint

from skred.errors import InputError, UnknownNameError
from skred.physics.law import Law, SymbolClashError
from skred.physics.mechanisms import library
from skred.physics.mechanisms.placed import can_join
from skred.physics.plugins import OWN_PACKAGE, Refused, RefusedError, entries_of, load, package_of

GROUP = "skred.laws"


class UnknownLawError(UnknownNameError):
    """A law was asked for that no installed package provides."""


def law_ids() -> list[str]:
    """Ids of the installed laws, sorted."""
    return sorted({entry.name for entry in entries_of(GROUP)})


def load_law(law_id: str) -> Law:
    """Load one law.

    Raises
    ------
    UnknownLawError
        If no installed package provides it.
    InputError
        If several do, or it cannot be used: it cannot be imported, its inverse does not undo its strengths,
        or a symbol stands for two things. The message names the packages.
    """
    entries = [entry for entry in entries_of(GROUP) if entry.name == law_id]
    if not entries:
        raise UnknownLawError(f"no law named {law_id!r}; there are: {', '.join(law_ids())}")
    if len(entries) > 1:
        packages = " and ".join(package_of(entry) for entry in entries)
        raise InputError(f"the law {law_id!r} is provided by the packages {packages}; uninstall all but one")
    return _law(entries[0])


def installed_laws() -> tuple[list[Law], list[Refused]]:
    """All laws that can be used, by id, and those that cannot."""
    laws, refused = list[Law](), list[Refused]()
    for law_id in law_ids():
        try:
            laws.append(load_law(law_id))
        except InputError as error:
            refused.append(Refused("law", law_id, package_of_law(law_id), str(error)))
    return laws, refused


def package_of_law(law_id: str) -> str:
    """Name of the package that provides a law; that of skred for one that is not installed."""
    packages = [package_of(entry) for entry in entries_of(GROUP) if entry.name == law_id]
    return " and ".join(packages) or OWN_PACKAGE


def check_library(law: Law) -> None:
    """Refuse a law and mechanisms that may be added to it where a name or symbol would stand for two things.

    Raises
    ------
    InputError
        If so; the message names both packages.
    """
    base = tuple(mechanism.id for mechanism in law.mechanisms)
    for mechanism in library().mechanisms.values():
        if mechanism.id not in base and can_join(mechanism, base):
            try:
                law.check_symbols(mechanism.strength, mechanism.id, law.mechanisms)
            except SymbolClashError as error:
                raise InputError(f"{error}{_packages(error, package_of_law(law.id))}") from error


def _law(entry: EntryPoint) -> Law:
    whose = f"the law {entry.name!r} of the package {package_of(entry)} cannot be used"
    try:
        law = load(entry)
    except RefusedError as error:
        clash = error.__cause__
        more = _packages(clash, package_of(entry)) if isinstance(clash, SymbolClashError) else ""
        raise InputError(f"{whose}: {error}{more}") from error
    if not isinstance(law, Law):
        raise InputError(f"{whose}: expected a Law, found {type(law).__name__}")
    if law.id != entry.name:
        raise InputError(f"{whose}: its id is {law.id!r}, its entry point is named {entry.name!r}")
    return law


def _packages(error: SymbolClashError, package_of_others: str) -> str:
    """Whose the two are that clash: those that are not in the library come with the law."""
    packages = library().packages
    whose = [f"{owner!r} of the package {packages.get(owner, package_of_others)}" for owner in error.owners]
    return f" ({', '.join(whose)})"
