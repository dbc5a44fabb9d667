"""The library of mechanisms: every file of this folder, and the entry points ``skred.mechanisms`` of others.

A mechanism of another package that cannot be used is left out. `library` says which and why; the rest works.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import numpy as np

from skred.physics.mechanisms.spec import BoundTo, Mechanism
from skred.physics.plugins import OWN_PACKAGE, Refused, RefusedError, entries_of, in_a_line, load, package_of

GROUP = "skred.mechanisms"
NOT_MECHANISMS = ("library", "placed", "spec", "strength_prior", "stretches")
RESERVED = ("nothing", "unlisted")
"""Ids of the two ways out of the list."""
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_ENDINGS = ("_spread", "_correlation")
"""Of the names that the hierarchical likelihood makes from those of coefficients."""


@dataclass(frozen=True)
class Library:
    """Mechanisms that can be used, who offers them, and those that cannot.

    Attributes
    ----------
    mechanisms : mapping
        By id.
    packages : mapping
        Id to the package that offers it.
    refused : tuple of Refused
    """

    mechanisms: Mapping[str, Mechanism]
    packages: Mapping[str, str]
    refused: tuple[Refused, ...] = ()


@cache
def library() -> Library:
    """The mechanisms that are installed."""
    return library_of(built_in(), entries_of(GROUP))


def mechanisms() -> dict[str, Mechanism]:
    """All mechanisms that can be used, by id."""
    return dict(library().mechanisms)


def built_in() -> dict[str, Mechanism]:
    """The constant ``MECHANISM`` of every module in this folder, by id."""
    names = [module.name for module in iter_modules([str(Path(__file__).parent)])]
    modules = [import_module(f"{__package__}.{name}") for name in names if name not in NOT_MECHANISMS]
    return {module.MECHANISM.id: module.MECHANISM for module in modules}


def library_of(own: Mapping[str, Mechanism], entries: Iterable[EntryPoint]) -> Library:
    """The library of skred's own mechanisms and those of entry points; where two clash the first stays."""
    found, packages = dict(own), dict.fromkeys(own, OWN_PACKAGE)
    refused = list[Refused]()
    for entry in entries:
        package = package_of(entry)
        try:
            mechanism = load(entry)
            check_spec(entry.name, mechanism)
            _check_clash(mechanism, found, packages)
        except RefusedError as error:
            refused.append(Refused("mechanism", entry.name, package, str(error)))
            continue
        found[mechanism.id], packages[mechanism.id] = mechanism, package
    for mechanism in list(found.values()):
        if mechanism.id not in own and (reason := _no_twin(mechanism, found)):
            refused.append(Refused("mechanism", mechanism.id, packages.pop(mechanism.id), reason))
            del found[mechanism.id]
    return Library(found, packages, tuple(refused))


def check_spec(name: str, mechanism: Any) -> None:
    """Refuse what is no complete mechanism.

    Raises
    ------
    RefusedError
        Which says what is wrong with it.
    """
    if not isinstance(mechanism, Mechanism):
        raise RefusedError(f"expected a Mechanism, found {type(mechanism).__name__}")
    strength, added = mechanism.strength, mechanism.added
    if added is None:
        raise RefusedError("it has no `added`, which says how it joins a law that leaves it out")
    try:
        twice = added.bound_to is BoundTo.TRACK and added.joins((mechanism.id,))
    except Exception as error:
        raise RefusedError(f"`joins` fails ({in_a_line(error)})") from error
    wrong = {
        f"its id is {mechanism.id!r}, its entry point is named {name!r}": mechanism.id != name,
        f"the id {mechanism.id!r} is reserved": mechanism.id in RESERVED,
        f"the parameter name {strength.name!r} ends like those of spreads and correlations": (
            strength.name.endswith(_ENDINGS)
        ),
        "its coefficient has no symbol or no unit (1 where there is none)": (
            not strength.symbol.strip() or not strength.unit.strip()
        ),
        "its title or its equation is empty": not mechanism.title.strip() or not mechanism.equation.strip(),
        f"it joins laws that have it already; give joins=lacking({mechanism.id!r})": twice,
        "its prior scales must be positive numbers": (
            not all(np.isfinite(one) and one > 0.0 for one in (strength.prior_scale, added.scale))
        ),
        "it has a column without a profile, or a profile without a column": (
            (mechanism.column is None) != (mechanism.profile is None)
        ),
    } | {
        f"{what} {text!r} is not made of small letters, digits and _": _NAME.fullmatch(text) is None
        for what, text in (("the id", mechanism.id), ("the parameter name", strength.name))
    }
    for reason, is_so in wrong.items():
        if is_so:
            raise RefusedError(reason)


def _check_clash(mechanism: Mechanism, others: Mapping[str, Mechanism], packages: Mapping[str, str]) -> None:
    """Refuse ids, parameter names and symbols that are taken: in one law they would mean two things."""
    for other in others.values():
        whose = f"is that of {other.id!r} of the package {packages[other.id]}"
        if mechanism.id == other.id:
            raise RefusedError(f"the id {mechanism.id!r} {whose}")
        if mechanism.strength.name == other.strength.name:
            raise RefusedError(f"the parameter name {mechanism.strength.name!r} {whose}")
        if mechanism.strength.symbol == other.strength.symbol:
            raise RefusedError(f"the symbol {mechanism.strength.symbol!r} {whose}")


def _no_twin(mechanism: Mechanism, others: Mapping[str, Mechanism]) -> str:
    """What is wrong with the mechanism that it says is the same term; empty where nothing is."""
    twin = mechanism.same_term_as
    if not twin:
        return ""
    if twin == mechanism.id or twin not in others:
        return f"`same_term_as` names {twin!r}, which is no other mechanism"
    if others[twin].same_term_as:
        return f"`same_term_as` names {twin!r}; give {others[twin].same_term_as!r}, which that is the same as"
    return ""
