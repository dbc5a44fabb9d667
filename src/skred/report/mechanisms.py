"""The library of mechanisms: one table over all of them, and what there is to say of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.errors import InputError
from skred.physics.mechanisms import library, mechanisms
from skred.physics.mechanisms.placed import added_of, can_join, direction_of, parts_of, shapes_of
from skred.physics.mechanisms.spec import BoundTo, Group, Mechanism, Setting, Shape
from skred.physics.mechanisms.strength_prior import KIND
from skred.physics.mechanisms.stretches import OPPOSED_SCALES, ends_of, is_opposed
from skred.physics.plugins import OWN_PACKAGE
from skred.physics.terrain import Terrain
from skred.report.shared.labels import unit_text, with_units
from skred.report.shared.tables import plain_table, plain_text

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from skred.physics.law import Law

_GROUPS = {
    Group.PHYSICS: "physics: a term of the equation of motion",
    Group.INSTRUMENT: "instrument: the recordings are off",
}
_CELL_M, _N_CELLS, _SLOPE_RAD = 5.0, 800, 0.5
_MOST_LISTED = 5
"""Values that are listed one by one; of more the first and the last are told."""


def mechanism_document(mechanism: Mechanism, laws: Sequence[Law]) -> dict[str, Any]:
    """What a mechanism says of itself, as plain data.

    Parameters
    ----------
    mechanism : Mechanism
        One that can be added to a law, as all of the library can.
    laws : sequence of Law
        Base laws that it may be missing from.
    """
    added, strength = mechanism.added, mechanism.strength
    assert added is not None
    ids = [(law.id, tuple(part.id for part in law.mechanisms)) for law in laws]
    return {
        "id": mechanism.id,
        "title": mechanism.title,
        "package": library().packages.get(mechanism.id, OWN_PACKAGE),
        "group": str(mechanism.group),
        "bound_to": str(added.bound_to),
        "needs": list(added.needs),
        "equation": mechanism.equation,
        "strength": {
            "parameter": strength.name,
            "symbol": strength.symbol,
            "paper_symbol": strength.paper_symbol or None,
            "unit": strength.unit,
            "either_sign": added.either_sign,
        },
        "prior": {
            "kind": KIND[added.either_sign],
            "scale": added.scale,
            "relevant": added.relevant,
            "reason": added.reason,
        },
        "prior_in_a_base_law": None
        if mechanism.column is None
        else {"kind": "half-normal", "scale": strength.prior_scale, "reason": strength.prior_reason},
        "looked_for": looked_for(mechanism),
        "missing_from": [law_id for law_id, base in ids if can_join(mechanism, base)],
        "signature": mechanism.signature,
        "reference": mechanism.reference,
        "doi": mechanism.doi,
        "same_term": same_term(mechanism),
    }


def same_term(mechanism: Mechanism) -> list[str]:
    """Ids of the mechanisms that no recording can tell from it."""
    pairs = [(other.id, other.same_term_as) for other in mechanisms().values() if other.same_term_as]
    return [b if a == mechanism.id else a for a, b in pairs if mechanism.id in (a, b)]


def looked_for(mechanism: Mechanism) -> str:
    """The shapes that it is looked for in, in words; read off its shapes on a made-up track."""
    setting = _example(added_of(mechanism).needs)
    try:
        shapes = shapes_of(mechanism, setting)
        if not shapes:
            return "nothing that a made-up campaign has; `skred identify` says it for recordings"
        where = _where(mechanism, setting, shapes)
    except InputError as error:
        return f"unknown: {error}"
    if any(is_opposed(shape) for shape in shapes):
        where += "; the longer ones also with a driving force that equals it at the typical speed,"
        where += f" the prior of its coefficient {OPPOSED_SCALES:g} times as wide"
    plain = [shape for shape in shapes if not is_opposed(shape)]
    constants = [dict(shape.constants) for shape in plain]
    values = {
        name: sorted({of_shape[name] for of_shape in constants if name in of_shape})
        for name in dict.fromkeys(name for of_shape in constants for name in of_shape)
    }
    words = [f"{name} of {_either(found)}" for name, found in values.items()]
    if not all(constants):
        words = [f"also with {one}" for one in words]
    elif not all(values.keys() == of_shape.keys() for of_shape in constants):
        words = ["with " + ", or with ".join(words)]
    return "; ".join([where, *words])


def _where(mechanism: Mechanism, setting: Setting, shapes: Sequence[Shape]) -> str:
    """What the shapes name: stretches, sensors, covariates, or nothing."""
    added = added_of(mechanism)
    match added.bound_to:
        case BoundTo.PLACE:
            lengths = sorted({round(last - first) for first, last in map(ends_of, shapes)})
            finer = ", finer around the likeliest" if parts_of(mechanism, setting, shapes[0], 1.0) else ""
            return f"stretches of {_either(lengths)} m that end in the recorded part of the track{finer}"
        case BoundTo.SENSOR:
            return "each sensor of front velocity, where there are several"
        case BoundTo.COVARIATE if added.needs:
            return f"the covariate {_either(added.needs)}, in campaigns that have it"
        case BoundTo.COVARIATE:
            return "each covariate of the events that is a number, or a text of two kinds"
        case BoundTo.TRACK:
            moves = direction_of(mechanism, setting, shapes[0]).columns
            parts = any(shape.s_from_m is not None for shape in shapes)
            where = "the whole track, or from the first recording on" if parts else "the whole track"
            return where if moves else "all avalanches alike"


def _example(covariates: Sequence[str]) -> Setting:
    """A straight slope with something of everything that a mechanism can refer to."""
    ones = np.ones(_N_CELLS)
    terrain = Terrain(
        edge_s_m=_CELL_M * np.arange(_N_CELLS + 1.0),
        sin_slope=np.sin(_SLOPE_RAD) * ones,
        cos_slope=np.cos(_SLOPE_RAD) * ones,
        curvature=0.0 * ones,
    )
    return Setting(
        terrain=terrain,
        base=(),
        recorded_m=(0.25 * terrain.length_m, 0.75 * terrain.length_m),
        sensors=("first", "second"),
        velocities=(True, True),
        covariates={name: np.array([-1.0, 1.0]) for name in covariates or ("covariate",)},
        n_events=2,
        front_speed=20.0 * np.ones(_N_CELLS + 1),
    )


def _either(values: Sequence[float] | Sequence[str]) -> str:
    words = [value if isinstance(value, str) else f"{value:g}" for value in values]
    if len(words) > _MOST_LISTED:
        return f"{words[0]} to {words[-1]}"
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"


def mechanisms_table(documents: Sequence[dict[str, Any]], n_laws: int) -> Table:
    """All mechanisms.

    Parameters
    ----------
    documents : sequence of dict
        As `mechanism_document` makes them.
    n_laws : int
        Number of laws that were asked about.
    """
    columns = ("mechanism", "what it is", "group", "symbol", "prior\nscale", "missing\nfrom")
    table = plain_table(plain_text("Mechanisms"), left=columns, right=())
    for column in (0, 2, 3, 4):
        table.columns[column].no_wrap = True
    table.columns[4].justify = "right"
    table.columns[5].max_width = 9
    for one in documents:
        strength = one["strength"]
        symbol = f"{strength['symbol']} [{unit_text(strength['unit'])}]"
        scale = ("± " if strength["either_sign"] else "") + f"{one['prior']['scale']:g}"
        words = (one["id"], one["title"], one["group"], symbol, scale, _missing_from(one, n_laws))
        table.add_row(*map(plain_text, words))
    table.caption = plain_text(
        "Prior scale: of the coefficient as an added mechanism; half-normal, or with ± normal, either sign,"
        " of a third, one or three times that."
        " Missing from: base laws that may leave it out. One in full: skred mechanisms ID."
    )
    table.caption_justify = "left"
    return table


def mechanism_rows(document: dict[str, Any], n_laws: int) -> dict[str, str]:
    """What there is to say of one mechanism, by what each row is about; parameters as `mechanisms_table`."""
    strength, prior, in_base = document["strength"], document["prior"], document["prior_in_a_base_law"]
    paper = f", in the paper {strength['paper_symbol']}" if strength["paper_symbol"] else ""
    unit = "" if strength["unit"] == "1" else f" {unit_text(strength['unit'])}"
    return {
        "group": _GROUPS[document["group"]],
        "enters as": document["equation"],
        "coefficient": f"{strength['parameter']}, symbol {strength['symbol']}{paper}",
        "unit": unit_text(strength["unit"]),
        "sign": "either" if strength["either_sign"] else "positive only",
        "prior": f"{prior['kind']}; scale {prior['scale']:g}{unit}: {prior['reason']}",
        "relevant": f"{prior['relevant']:.2g}{unit} or more: the median size under that prior",
        "in a base law": "cannot be part of one"
        if in_base is None
        else f"{in_base['kind']}, scale {in_base['scale']:g}{unit}: {in_base['reason']}",
        "missing from": _missing_from(document, n_laws),
        "looked for in": with_units(document["looked_for"]),
        "diagnostic signature": document["signature"],
        "same term as": ", ".join(document["same_term"]) or "none other",
        "reference": document["reference"],
        "doi": f"https://doi.org/{document['doi']}" if document["doi"] else "none",
        "package": document["package"],
    }


def mechanism_table(document: dict[str, Any], n_laws: int) -> RenderableType:
    """One mechanism in full; parameters as `mechanisms_table`."""
    from rich.console import Group as Lines
    from rich.table import Table

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, text in mechanism_rows(document, n_laws).items():
        table.add_row(plain_text(name, "bold"), plain_text(text))
    return Lines(plain_text(f"{document['id']}: {document['title']}", "bold"), table)


def _missing_from(document: dict[str, Any], n_laws: int) -> str:
    laws = document["missing_from"]
    return "all laws" if len(laws) == n_laws else ", ".join(laws) or "none"
