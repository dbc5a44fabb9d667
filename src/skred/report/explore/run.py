"""One run: a tree of draws, and what is asked of it more than once."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
import xarray as xr

from skred.report.explore.plain_json import plain_json
from skred.report.shared.labels import shortened, symbol_text, unit_text
from skred.report.shared.recordings import Recordings, recordings_of

MOST_PARAMETERS = 12
"""Parameters shown at a time: each has panels of its own."""
MOST_SENSORS = 12
"""Observed variables with panels of their own."""
MOST_EVENTS = 1000
"""Events that can be chosen."""
MOST_OBSERVATIONS = 20_000
"""Of a variable: with more of them, leaving out one by one says little and takes long."""
OF_A_FILE = (ArithmeticError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)
"""What a library may raise of a stranger's file that is not what it seems."""
_MOST_LISTED = 500


def shown(text: Any, length: int = 40) -> str:
    """A name from a file as text that is drawn as it is: short, printable, and no formula."""
    return shortened(text, length).replace("$$", "$ $").strip() or "(no name)"


def shown_parts(*parts: str) -> list[str]:
    """Those of some short texts that say something."""
    return [shown(part, 16) for part in parts if part.strip()]


def apart(texts: Sequence[str]) -> list[str]:
    """Texts that differ: those that are alike are numbered from the second on."""
    found: dict[str, None] = {}
    for text in texts:
        number, one = 1, text
        while one in found:
            number += 1
            one = f"{text} (no. {number})"
        found[one] = None
    return list(found)


def unit_of(attributes: Mapping[Any, Any]) -> str:
    """The unit of a variable in brackets; nothing where it says none."""
    return f"[{unit_text(attributes['units'])}]" if "units" in attributes else ""


@dataclass(frozen=True, eq=False)
class Run:
    """A tree of draws, or the curves of a diagnosis.

    Attributes
    ----------
    key : str
        Names it in the page: letters and digits.
    title : str
        For people.
    kind : str
        ``calibration``, ``diagnosis`` or ``arviz``.
    source : str
        The file or folder.
    tree : DataTree
    document : mapping
        Of a diagnosis, the content of ``verdict.json``; of a calibration, ``summary.json``; may be empty.
    """

    key: str
    title: str
    kind: str
    source: str
    tree: xr.DataTree
    document: Mapping[str, Any] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """Its number in the page."""
        return int(self.key[1:])

    def has(self, *groups: str) -> bool:
        """Whether there are such groups, none of them empty."""
        return all(name in self.tree.children and len(self.tree[name].data_vars) for name in groups)

    def group(self, name: str) -> xr.Dataset:
        """A group as a dataset."""
        return self.tree[name].to_dataset()

    @property
    def is_ours(self) -> bool:
        """Whether skred wrote it."""
        return self.kind != "arviz"

    @cached_property
    def recordings(self) -> Recordings | None:
        """What was recorded; None where the tree does not say."""
        if not self.is_ours or "constant_data" not in self.tree.children:
            return None
        try:
            return recordings_of(self.tree)
        except (KeyError, TypeError, ValueError, AttributeError):
            return None

    @cached_property
    def names(self) -> list[tuple[str, dict[str, int]]]:
        """The parameters, each a variable and the place in its own dimensions."""
        return scalars_of(self.group("posterior")) if self.has("posterior") else []

    @cached_property
    def labels(self) -> dict[str, str]:
        """What a parameter is called, with its symbol and unit, by the name of its variable."""
        found = {}
        for name, variable in self.group("posterior").data_vars.items():
            symbol = symbol_text(variable.attrs["symbol"]) if "symbol" in variable.attrs else ""
            unit = unit_of(variable.attrs)
            text = str(name).replace("_", " ") if self.is_ours else str(name)
            said = f" {symbol}" if symbol and symbol != text and len(symbol) < 12 else ""
            found[str(name)] = " ".join((shown(text, 48), *shown_parts(said, unit)))
        return found

    def parameters(
        self, chosen: Sequence[str] = (), group: str = "posterior", most: int = MOST_PARAMETERS
    ) -> xr.Dataset:
        """Draws of some parameters: ``p0``, ``p1``, ... (chain, draw), with ``label`` and ``axis``.

        Parameters
        ----------
        chosen : sequence of str
            Labels; the first ones where none is given.
        group : str
        most : int
            How many at most.
        """
        data, wanted = self.group(group), frozenset(chosen)
        columns: dict[str, xr.DataArray] = {}
        for number, ((name, at), label) in enumerate(zip(self.names, self.all_labels, strict=True)):
            if len(columns) < most and (not wanted or label in wanted) and _holds(data, name, at):
                one = data[name].isel(at)
                one = one.drop_vars(set(one.coords) - {"chain", "draw"})
                columns[f"p{number}"] = one.assign_attrs(label=label, axis=self.short_label(name, label))
        return xr.Dataset(columns)

    def labels_in(self, *groups: str) -> list[str]:
        """Labels of the parameters that each of some groups holds."""
        data = [self.group(group) for group in groups if self.has(group)]
        if len(data) < len(groups):
            return []
        named = zip(self.names, self.all_labels, strict=True)
        return [label for (name, at), label in named if all(_holds(one, name, at) for one in data)]

    def label(self, name: str, at: Mapping[str, int]) -> str:
        """A parameter by its variable and the place in that."""
        text = self.labels.get(name, shown(name))
        if not at:
            return text
        places = _places(self.group("posterior")[name], at)
        return f"{text} ({shown(', '.join(places), 24)})"

    def short_label(self, name: str, label: str) -> str:
        """Symbol and unit of a parameter for an axis; its label, cut, where there is no symbol."""
        attributes = self.group("posterior")[name].attrs
        if "symbol" not in attributes:
            return shown(label, 30)
        return " ".join((shown(symbol_text(attributes["symbol"]), 24), *shown_parts(unit_of(attributes))))

    @cached_property
    def all_labels(self) -> list[str]:
        """Labels of all parameters that can be chosen, each another."""
        return apart([self.label(name, at) for name, at in self.names])

    @cached_property
    def identities(self) -> list[str]:
        """What a parameter is by its full name and place, uncut: the same in runs of the same law."""
        data = self.group("posterior") if self.names else xr.Dataset()
        return apart([f"{name}({', '.join(_places(data[name], at))})" for name, at in self.names])

    @cached_property
    def likelihood_name(self) -> str | None:
        """The variable of log_likelihood that leaving out events goes by: the first."""
        if not self.has("log_likelihood", "posterior"):
            return None
        name, values = next(iter(self.group("log_likelihood").data_vars.items()))
        own = [n for d, n in values.sizes.items() if d not in ("chain", "draw")]
        drawn = {"chain", "draw"} <= set(values.dims)
        return str(name) if drawn and int(np.prod(own)) <= MOST_OBSERVATIONS else None

    @cached_property
    def observations(self) -> str:
        """A digest of what was observed, by name and number; empty where the tree does not say."""
        if not self.has("observed_data"):
            return ""
        observed = self.group("observed_data")
        # Other people's files hold covariates too; the variable of the likelihood is what is predicted.
        only = [self.likelihood_name] if self.likelihood_name in observed else sorted(map(str, observed))
        summed = sha256()
        for name in only:
            values = observed[name].values
            if values.dtype.kind in "iufb":
                values = np.where(np.isnan(values.astype(float)), np.nan, values.astype(float)) + 0.0
            summed.update(f"{name} {values.shape}".encode())
            summed.update(values.tobytes() if values.dtype.kind == "f" else repr(values.tolist()).encode())
        return summed.hexdigest()

    @cached_property
    def event_ids(self) -> list[str]:
        """What can be left out: the avalanches, or the observations."""
        if self.likelihood_name is None:
            recordings = self.recordings
            return list(recordings.event_ids) if recordings is not None else []
        return ids_of(self.group("log_likelihood")[self.likelihood_name])

    @cached_property
    def loo(self) -> Any:
        """`arviz.loo` of the likelihood, pointwise."""
        import arviz_stats as azs

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large Pareto k, which the views show
            return azs.loo(self.tree, var_name=self.likelihood_name, pointwise=True)

    @cached_property
    def can_leave_out(self) -> bool:
        """Whether `loo` can be computed."""
        if self.likelihood_name is None:
            return False
        try:
            return len(np.ravel(self.loo.pareto_k)) == len(self.event_ids)
        except OF_A_FILE:
            return False

    @cached_property
    def observed_names(self) -> list[str]:
        """Variables that are both observed and predicted: our sensors."""
        if not self.has("observed_data", "posterior_predictive"):
            return []
        predicted, observed = self.group("posterior_predictive"), self.group("observed_data")
        names = [
            str(name)
            for name, values in observed.data_vars.items()
            if name in predicted and values.dtype.kind in "iuf" and 1 < values.size <= MOST_OBSERVATIONS
            and set(predicted[name].dims) == {"chain", "draw", *values.dims}
        ]  # fmt: skip
        return names[:MOST_SENSORS]

    def sensor_label(self, name: str) -> str:
        """An observed variable with its unit."""
        attributes = self.group("observed_data")[name].attrs
        return " ".join((shown(attributes.get("long_name", name), 30), *shown_parts(unit_of(attributes))))

    @cached_property
    def aligned(self) -> xr.DataTree:
        """The tree with the draws of its predictions only: those may be thinned."""
        if not self.has("posterior_predictive", "posterior"):
            return self.tree
        kept = self.group("posterior_predictive")["draw"].values
        groups = {}
        for name, node in self.tree.children.items():
            data = node.to_dataset()
            of_draws = name in ("posterior", "log_likelihood", "sample_stats") and "draw" in data.sizes
            groups[str(name)] = data.sel(draw=kept) if of_draws else data
        return xr.DataTree.from_dict(groups)

    @cached_property
    def gate(self) -> Mapping[str, Any]:
        """Whether the chains converged; empty where the tree does not say."""
        try:
            found = plain_json(self.tree.attrs["gate"])
        except (KeyError, TypeError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}


def numbered(data: xr.Dataset) -> xr.Dataset:
    """A group with numbers of its chains and draws, which ArviZ goes by."""
    bare = [d for d in ("chain", "draw") if d in data.sizes and d not in data.coords]
    return data.assign_coords({d: range(data.sizes[d]) for d in bare})


def scalars_of(data: xr.Dataset) -> list[tuple[str, dict[str, int]]]:
    """Every number of a posterior with chains and draws, up to 500 of them, the scalar ones first."""
    found: list[tuple[str, dict[str, int]]] = []
    for name, values in sorted(data.data_vars.items(), key=lambda item: item[1].ndim):
        if not {"chain", "draw"} <= set(values.dims) or values.dtype.kind not in "iuf":
            continue
        own = {d: n for d, n in values.sizes.items() if d not in ("chain", "draw")}
        for place in np.ndindex(*own.values()):
            if len(found) == _MOST_LISTED:
                return found
            found.append((str(name), dict(zip(map(str, own), place, strict=True))))
    return found


def _holds(data: xr.Dataset, name: str, at: Mapping[str, int]) -> bool:
    """Whether a group has a parameter, with the same dimensions beside those of the draws."""
    return name in data and {d for d in data[name].dims if d not in ("chain", "draw")} == at.keys()


def _places(values: xr.DataArray, at: Mapping[str, int]) -> list[str]:
    """The place of a number in its own dimensions, by their coordinates where they have any."""
    return [str(values[d].values[k]) if d in values.coords else str(k) for d, k in at.items()]


def ids_of(values: xr.DataArray) -> list[str]:
    """Ids of the observations of a variable: coordinates of its dimensions, in their order."""
    own = [d for d in values.dims if d not in ("chain", "draw")]
    names = [
        [str(one) for one in values[d].values]
        if d in values.coords
        else list(map(str, range(values.sizes[d])))
        for d in own
    ]
    flat = [", ".join(parts) for parts in _product(names)]
    return [shown(one, 60) for one in flat]


def _product(lists: list[list[str]]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [()]
    for values in lists:
        rows = [(*row, value) for row in rows for value in values]
    return rows
