"""From the words of a command line to what they name, or what is wrong with them.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from skred.api.problems import campaign_of, hierarchical_of, pooled_or_reason
from skred.api.problems import problem_of as problem_of
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.physics.law import Law

__all__ = ["campaign_of", "hierarchical_of", "law_of", "laws_of", "pooled_or_reason", "problem_of"]


def laws_of(names: str, priors: Path | None = None) -> "list[Law]":
    """Laws from a list of names, each once, with the priors of a file."""
    from skred.inference.priors import laws_with_priors, read_priors
    from skred.physics.laws import load_law

    wanted = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    if not wanted:
        raise InputError("--models: expected names of laws separated by commas, found none")
    laws = [load_law(name) for name in wanted]
    return laws if priors is None else laws_with_priors(laws, read_priors(priors))


def law_of(name: str, priors: Path | None = None) -> "Law":
    """One law, with the priors of a file."""
    from skred.inference.priors import laws_with_priors, read_priors
    from skred.physics.laws import load_law

    law = load_law(name)
    return law if priors is None else laws_with_priors([law], read_priors(priors))[0]
