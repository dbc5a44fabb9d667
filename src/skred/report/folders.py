"""Reports and figures of a folder of results, made from the documents in it: whichever command wrote them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from skred.documents import AGAIN, FORMAT, check_format, opened_tree, read_document
from skred.errors import InputError
from skred.output import write_text

if TYPE_CHECKING:
    from skred.report.shared.drawing import Picture

_MOST_TRACKS = 100


class ReportError(InputError):
    """A folder without results, or with results that this version cannot read."""


def write_reports(folder: Path) -> list[Path]:
    """Make the report and the figures of a folder of results anew, from its documents alone.

    Nothing in the folder changes before all of it is there; then each file is replaced as a whole, and
    figures that no longer apply are removed.

    Parameters
    ----------
    folder : Path
        Of ``skred diagnose``, ``compare``, ``predict`` or ``prove``, of a law that was calibrated, or with
        the table of a track and what ``skred track`` wrote beside it.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ReportError
        If it holds no results, or results of another version of the format.
    """
    if not folder.is_dir():
        raise ReportError(f"{folder}: no such folder")
    for document, make in _KINDS.items():
        if (folder / document).is_file():
            return _in_place(folder, make)
    if any(_track_documents(folder)):
        return _in_place(folder, _tracks)
    names = ", ".join(_KINDS)
    raise ReportError(
        f"{folder}: no results to report on; a folder of results holds one of {names}, or the table of a"
        " track with its .json beside it"
    )


def _in_place(folder: Path, make: Callable[[Path, Path], list[str]]) -> list[Path]:
    """Write into a hidden folder beside the results, then move everything to where it belongs."""
    with TemporaryDirectory(prefix=".skred-report-", dir=folder) as beside:
        possible = make(folder, Path(beside))
        made = sorted(file.relative_to(beside) for file in Path(beside).rglob("*") if file.is_file())
        for name in made:
            os.replace(Path(beside) / name, folder / name)
    for gone in set(map(Path, possible)).difference(made):
        (folder / gone).unlink(missing_ok=True)
    return [folder / name for name in made]


def _diagnosis(folder: Path, beside: Path) -> list[str]:
    from skred.report.diagnosis.report import FIGURES, render_diagnosis, save_diagnosis_figures

    document = read_document(folder / "verdict.json", ReportError)
    check_format(folder / "verdict.json", document.get("report"), "report.format", FORMAT, ReportError)
    with opened_tree(folder / "diagnosis.nc", ReportError) as tree:
        figures = save_diagnosis_figures(document, tree, beside)
        write_text(beside / "report.html", render_diagnosis(document, tree, figures))
    return [f"{name}.png" for name in FIGURES]


def _comparison(folder: Path, beside: Path) -> list[str]:
    from skred.report.comparison.laws import COMPARISON_FIGURES, save_comparison_figures
    from skred.report.comparison.page import render_comparison
    from skred.report.shared.document import get, listed

    comparison = read_document(folder / "compare.json", ReportError)
    figures: dict[str, Picture] = {}
    possible = [f"{name}.png" for name in COMPARISON_FIGURES]
    for models, where in (
        (listed(comparison, "models"), ""),
        (listed(comparison, "pooled", "models"), "pooled"),
    ):
        for number, name in enumerate(_plain_name(get(model, "id"), folder) for model in models):
            place = Path(where) / name
            drawn = _model_figures(folder / place, beside / place, f"m{number}")
            possible += [str(place / figure) for figure in _possible_of_a_model()]
            figures |= {} if where else {f"{name}/{figure}": picture for figure, picture in drawn.items()}
    figures |= save_comparison_figures(comparison, beside)
    write_text(beside / "report.html", render_comparison(comparison, figures))
    return possible


def _plain_name(name: Any, folder: Path) -> str:
    """A law's id as the name of its folder, and nothing that leads out of it."""
    if not isinstance(name, str) or name != Path(name).name or name in ("", ".", ".."):
        raise ReportError(f"{folder / 'compare.json'}: {str(name)[:60]!r} is no name of a law")
    return name


def _calibration(folder: Path, beside: Path) -> list[str]:
    from skred.report.calibration.page import render_calibration

    document = read_document(folder / "summary.json", ReportError)
    figures = _model_figures(folder, beside)
    write_text(beside / "report.html", render_calibration(document, figures))
    return _possible_of_a_model()


def _model_figures(folder: Path, beside: Path, key: str = "") -> dict[str, Picture]:
    from skred.report.calibration.figures import save_model_figures

    beside.mkdir(parents=True, exist_ok=True)
    with opened_tree(folder / "posterior.nc", ReportError) as tree:
        return save_model_figures(tree, beside, key)


def _possible_of_a_model() -> list[str]:
    from skred.report.calibration.figures import MODEL_FIGURES

    return [f"{name}.png" for name in MODEL_FIGURES]


def _prediction(folder: Path, beside: Path) -> list[str]:
    from skred.report.prediction.page import FIGURES, render_prediction, save_prediction_figures

    document = read_document(folder / "prediction.json", ReportError)
    figures: dict[str, Picture] = {}
    if document.get("valid") is True:
        with opened_tree(folder / "prediction.nc", ReportError) as tree:
            figures = save_prediction_figures(document, tree, beside)
    write_text(beside / "report.html", render_prediction(document, figures))
    return [f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")]


def _scorecard(folder: Path, beside: Path) -> list[str]:
    from skred.report.scorecard.figures import SCORECARD_FIGURES, save_scorecard_figures
    from skred.report.scorecard.page import render_scorecard

    document = read_document(folder / "scorecard.json", ReportError)
    figures = save_scorecard_figures(document, beside)
    write_text(beside / "scorecard.html", render_scorecard(document, figures))
    return [f"{name}.png" for name in SCORECARD_FIGURES]


def _tracks(folder: Path, beside: Path) -> list[str]:
    """Figures of the tracks in a folder; nothing else in it is touched."""
    from skred.report.shared.style import write_png
    from skred.report.track.figures import track_figure

    for file in _track_documents(folder):
        document = read_document(file, ReportError)
        try:
            figure = track_figure(document)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            lacks = f"{type(error).__name__}: {error}"
            raise ReportError(f"{file}: no track that can be drawn ({lacks:.80}); {AGAIN}") from error
        write_png(figure, beside / f"{file.stem}.png")
    return []


def _track_documents(folder: Path) -> list[Path]:
    """The documents that ``skred track`` wrote: each has the name of a table beside it."""
    tables = sorted(folder.glob("*.csv"))[:_MOST_TRACKS]
    return [file for table in tables if (file := table.with_suffix(".json")).is_file()]


_KINDS: dict[str, Callable[[Path, Path], list[str]]] = {
    "verdict.json": _diagnosis,
    "compare.json": _comparison,
    "prediction.json": _prediction,
    "scorecard.json": _scorecard,
    "summary.json": _calibration,
}
"""What a folder holds, and what makes its report; returns the figures that there may be."""
