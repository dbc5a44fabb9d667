"""The comparison report: one HTML file that needs nothing else, neither network nor script."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.report import document as doc
from skred.report.labels import name_text, printable, symbol_text, unit_text
from skred.report.numbers import decimals_for, fixed, is_number, rounded, share, whole

if TYPE_CHECKING:
    from jinja2 import Environment

_TITLES = {
    "comparison_elpd": "Differences of elpd to the best law, with their standard errors, single and doubled.",
    "pointwise": "Elpd of each event under each law, less that under the best law.",
    "pareto_k": "Pareto k of each event: above the limit, importance sampling cannot be trusted.",
    "predictions": "Mean response of each law at each sensor against the mean of the recordings.",
    "evidence": "Log evidence of each law; every seed is a point.",
    "trace": "Traces of all chains, and the ranks of their draws.",
    "joint": "Joint posterior of the parameters with marginal histograms.",
    "marginals": "Posterior of each parameter against its prior density.",
    "predictive": "Recorded readings, mean response and predictive distribution at each sensor.",
    "along_track": "Front speed along the track with recordings, and the terrain.",
}
_OF_A_LAW = ("marginals", "joint", "predictive", "along_track", "trace")


def render_comparison(comparison: doc.Document, figures: Mapping[str, Path]) -> str:
    """Render the report of a comparison.

    Parameters
    ----------
    comparison : mapping
        The document that is also written as ``compare.json``; null where there is no number. Runouts in
        ``response`` are arc lengths, shown relative to the campaign's reference where it has one. Where
        ``alpha_beta`` is null, ``alpha_beta_reason`` says why.
    figures : mapping of str to Path
        PNG files: ``comparison_elpd``, ``pointwise``, ``pareto_k``, ``predictions``, ``evidence``, and those
        of one law as ``<law id>/trace``, ``/joint``, ``/marginals``, ``/predictive``, ``/along_track``.
        What is missing is left out.

    Returns
    -------
    str
        A self-contained page: style inside, pictures as data URIs.
    """
    from skred.inference.gate import ESS_LIMIT, R_HAT_LIMIT

    return (
        _environment()
        .get_template("compare.html.jinja")
        .render(
            c=comparison,
            models=doc.models(comparison),
            ranked=doc.ranked(comparison),
            failed=doc.failed(comparison),
            figures={name: _data_uri(file) for name, file in figures.items()},
            sensors=_sensors(comparison),
            titles=_TITLES,
            of_a_law=_OF_A_LAW,
            k_limit=doc.pareto_k_limit(comparison),
            practical=doc.PRACTICAL_DIFFERENCE,
            r_hat_limit=R_HAT_LIMIT,
            ess_limit=ESS_LIMIT,
        )
    )


def _sensors(comparison: doc.Document) -> list[Any]:
    """Sensors of all laws' responses, in their order."""
    names = (doc.get(entry, "sensor") for m in doc.models(comparison) for entry in doc.listed(m, "response"))
    return list(dict.fromkeys(names))


def _data_uri(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode("ascii")


@cache
def _environment() -> Environment:
    """Templates of this package, with every value escaped unless a template says otherwise."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("skred.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(
        fixed=fixed,
        whole=whole,
        share=share,
        rounded=rounded,
        shown=_shown,
        unit=unit_text,
        symbol=symbol_text,
        name=name_text,
        difference=_difference,
    )
    environment.globals.update(get=doc.get, listed=doc.listed, decimals_for=decimals_for, is_number=is_number)
    environment.globals.update(relative=relative_response)
    return environment


def _shown(value: Any) -> str:
    """Any plain value as text; ``n/a`` where it is null."""
    if value is None:
        return "n/a"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return printable(value)


def _difference(value: Any) -> str:
    """Whether a difference matters in practice, in words."""
    return {True: "yes", False: "no"}.get(value, "n/a")


def relative_response(comparison: doc.Document, entry: doc.Document) -> dict[str, Any]:
    """Entry of a law's response, as text; a runout relative to the campaign's reference."""
    reference = doc.get(comparison, "campaign", "reference_s_m")
    from_reference = doc.get(entry, "unit") == "m" and is_number(reference)
    offset = float(reference) if from_reference else 0.0
    decimals = decimals_for(doc.get(entry, "sd"))
    recorded_decimals = decimals_for(doc.get(entry, "recorded_se"))

    def moved(key: str, places: int | None) -> str:
        value = doc.get(entry, key)
        return rounded(value - offset, places) if is_number(value) else rounded(None, places)

    quantity = " from the reference" if from_reference else ""
    return {
        "sensor": printable(doc.get(entry, "sensor")),
        "unit": unit_text(doc.get(entry, "unit")) + quantity,
        "mean": moved("mean", decimals),
        "low": moved("low", decimals),
        "high": moved("high", decimals),
        "sd": rounded(doc.get(entry, "sd"), decimals),
        "recorded_mean": moved("recorded_mean", recorded_decimals),
        "recorded_se": rounded(doc.get(entry, "recorded_se"), recorded_decimals),
        "n_recorded": whole(doc.get(entry, "n_recorded")),
    }
