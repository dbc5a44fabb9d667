"""A friction law: a sum of mechanisms, with the parameters a person thinks in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.errors import InputError
from skred.physics.mechanisms.spec import Mechanism, Strength


@dataclass(frozen=True)
class Parameter:
    """A free random variable of a law's model.

    Attributes
    ----------
    name, symbol, unit : str
        In models and files, in equations, and its SI unit (``1`` where there is none).
    paper_symbol : str
        In the Ryggfonn calibration paper, empty where it has none.
    """

    name: str
    symbol: str
    unit: str
    paper_symbol: str = ""


class SymbolClashError(InputError):
    """One name or symbol that stands for two things.

    Attributes
    ----------
    owners : tuple of str
        Ids of the law or mechanisms whose parameters they are.
    """

    def __init__(self, message: str, owners: tuple[str, str]) -> None:
        super().__init__(message)
        self.owners = owners


def parameter_of(strength: Strength) -> Parameter:
    """The parameter that is a mechanism's coefficient itself."""
    return Parameter(strength.name, strength.symbol, strength.unit, strength.paper_symbol)


def _as_they_are(*parameters: Any) -> tuple[Any, ...]:
    return parameters


def _and_the_last(translate: Callable[..., tuple[Any, ...]], *values: Any) -> tuple[Any, ...]:
    """Translate all but the last, which is a parameter and a coefficient at once."""
    return (*translate(*values[:-1]), values[-1])


def _build_with_one_more(build: Callable[[Any], Any], mechanism: Mechanism, problem: Any) -> Any:
    """A law's model with one more mechanism."""
    return build(problem.joined_by(mechanism))


@dataclass(frozen=True)
class Law:
    """A friction law: what brakes a front, and the prior of how much.

    Attributes
    ----------
    id, title : str
        Short name (command line, files) and name in plain words.
    mechanisms : tuple of Mechanism
        Its summands.
    parameters : tuple of Parameter
        The free random variables of its model.
    build : callable
        ``build(problem) -> pymc.Model``, see `skred.inference.problem.Problem`.
    reference : str
        Where the law comes from.
    strengths : callable
        Parameters, in order, to the coefficients of the mechanisms, in order.
    inverse : callable
        Coefficients, in order, to parameters, in order.
    derived : tuple of Parameter
        Quantities that its model computes from the parameters, for display.
    relation : str
        The same in words of an equation, where they are not the parameters themselves.
    changed_priors : tuple of (str, float)
        Parameters whose prior is not the law's own, and its scale instead; see `skred.inference.priors`.
    """

    id: str
    title: str
    mechanisms: tuple[Mechanism, ...]
    parameters: tuple[Parameter, ...]
    build: Callable[[Any], Any]
    reference: str
    strengths: Callable[..., tuple[Any, ...]] = _as_they_are
    inverse: Callable[..., tuple[Any, ...]] = _as_they_are
    derived: tuple[Parameter, ...] = ()
    relation: str = ""
    changed_priors: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse an inverse that is none, and symbols that stand for two things."""
        some = np.linspace(0.3, 0.7, len(self.parameters))
        if not np.allclose(self.inverse(*self.strengths(*some)), some):
            raise ValueError(f"{self.id}: inverse does not give back the parameters of strengths")
        for k, mechanism in enumerate(self.mechanisms):
            self.check_symbols(mechanism.strength, mechanism.id, self.mechanisms[:k])

    def __add__(self, mechanism: Mechanism) -> Law:
        """The law with one more term, which acts alike on all avalanches; its prior is the mechanism's own.

        Raises
        ------
        InputError
            If it is no mechanism or cannot be a part of a law, or the law has it, its name or its symbol
            already.
        """
        if not isinstance(mechanism, Mechanism):
            raise InputError(
                f"law + mechanism: expected a mechanism, such as skred.mechanisms()['viscous_drag'], found"
                f" {mechanism!r:.60}"
            )
        if mechanism.column is None or mechanism.profile is None:
            raise InputError(
                f"{mechanism.id!r} cannot be a part of a law: it acts at a place, on an instrument or by a"
                " covariate that a diagnosis has to find; expected a mechanism with a column and a profile"
            )
        if mechanism.id in (own.id for own in self.mechanisms):
            raise InputError(f"the law {self.id!r} has {mechanism.id!r} already")
        self.check_symbols(mechanism.strength, mechanism.id, self.mechanisms)
        return replace(
            self,
            id=f"{self.id}+{mechanism.id}",
            title=f"{self.title}, and {mechanism.title}",
            mechanisms=(*self.mechanisms, mechanism),
            parameters=(*self.parameters, parameter_of(mechanism.strength)),
            build=partial(_build_with_one_more, self.build, mechanism),
            strengths=partial(_and_the_last, self.strengths),
            inverse=partial(_and_the_last, self.inverse),
        )

    def check_symbols(self, strength: Strength, owner: str, others: Iterable[Mechanism]) -> None:
        """Refuse a coefficient that has the name or the symbol of something else.

        Parameters
        ----------
        strength : Strength
            The coefficient.
        owner : str
            Id of its mechanism.
        others : iterable of Mechanism
            Other mechanisms, none of which may use either. Of the law's parameters one may be it, with both.

        Raises
        ------
        SymbolClashError
        """
        own = {"name": strength.name, "symbol": strength.symbol}
        parameters: list[tuple[str, Parameter | Strength]] = [
            (self.id, one)
            for one in (*self.parameters, *self.derived)
            if (one.name, one.symbol) != (strength.name, strength.symbol)
        ]
        for other, one in [*parameters, *((other.id, other.strength) for other in others)]:
            for what, word in own.items():
                if getattr(one, what) == word:
                    raise SymbolClashError(
                        f"the {what} {word!r} is used twice, by {owner!r} and by {other!r}", (owner, other)
                    )

    def __repr__(self) -> str:
        """One line."""
        told = ", ".join(f"{one.name} {one.symbol} [{one.unit}]" for one in self.parameters)
        return f"<Law {self.id}: {self.title}; {told}>"

    def _repr_html_(self) -> str:
        """For notebooks."""
        rows = "".join(
            f"<tr><td>{escape(one.name)}</td><td>{escape(one.symbol)}</td><td>{escape(one.unit)}</td></tr>"
            for one in self.parameters
        )
        head = "<tr><th>parameter</th><th>symbol</th><th>unit</th></tr>"
        said = f"<p>{escape(self.id)}: {escape(self.title)}<br>{escape(self.equation)}</p>"
        return f"{said}<table><thead>{head}</thead><tbody>{rows}</tbody></table>"

    @property
    def equation(self) -> str:
        """Its equation of motion."""
        terms = " ".join(f"- {mechanism.equation.removeprefix('-')}" for mechanism in self.mechanisms)
        relation = f", {self.relation}" if self.relation else ""
        return f"dU^2/(2 ds) = g sin(phi) {terms}{relation}"

    @property
    def prior_note(self) -> str:
        """Which priors are not the law's own; empty where all are."""
        if not self.changed_priors:
            return ""
        units = {parameter.name: parameter.unit for parameter in self.parameters}
        changed = (
            f"{name} {scale:g}{'' if units[name] == '1' else ' ' + units[name]}"
            for name, scale in self.changed_priors
        )
        return f"Priors were changed: of {self.id} the scale of {', of '.join(changed)}."

    @property
    def parameter_names(self) -> list[str]:
        """Names of the free random variables."""
        return [parameter.name for parameter in self.parameters]

    def strength_rows(self, samples: Mapping[str, Any]) -> NDArray[np.float64]:
        """Coefficients of many parameter vectors: arrays by name to (n, n_mechanisms)."""
        columns = [np.asarray(samples[name], dtype=float).ravel() for name in self.parameter_names]
        return np.column_stack(self.strengths(*columns))

    def parameter_rows(self, strengths: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Parameters by name, n values each, of many coefficients of the mechanisms, (n, n_mechanisms)."""
        return dict(zip(self.parameter_names, self.inverse(*strengths.T), strict=True))
