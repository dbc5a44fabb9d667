"""Readings of a document as text: runouts relative to the campaign's reference, decimals as they deserve."""

from __future__ import annotations

from typing import Any

from skred.report.shared import document as doc
from skred.report.shared.labels import printable, unit_text
from skred.report.shared.numbers import decimals_for, is_number, rounded, share, whole


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


def relative_new_avalanche(comparison: doc.Document, entry: doc.Document) -> dict[str, str]:
    """Entry of a new avalanche at a sensor beside the recorded ones, as text, as `relative_response`."""
    reference = doc.get(comparison, "campaign", "reference_s_m")
    is_runout = doc.get(entry, "unit") == "m"
    from_reference = is_runout and is_number(reference)
    offset = float(reference) if from_reference else 0.0
    shown = {
        "sensor": printable(doc.get(entry, "sensor")),
        "unit": unit_text(doc.get(entry, "unit")) + (" from the reference" if from_reference else ""),
        "n_recorded": whole(doc.get(entry, "n_recorded")),
    }
    for prefix in ("", "recorded_"):
        decimals = decimals_for(doc.get(entry, f"{prefix}sd"))
        texts = []
        for key in ("low", "high", "mean"):
            value = doc.get(entry, prefix + key)
            texts.append(rounded(value - offset if is_number(value) else None, decimals))
        known = is_number(doc.get(entry, f"{prefix}mean"))
        shown[f"{prefix}interval"] = f"{texts[0]} to {texts[1]}" if known else "-"
        shown[f"{prefix}mean"] = texts[2]
        shown[f"{prefix}reached"] = "-" if is_runout else share(doc.get(entry, f"{prefix}reached"))
    return shown
