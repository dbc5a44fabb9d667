"""Reports and figures of a folder of results, made from the documents in it: whichever command wrote them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from skred.documents import AGAIN, FORMAT, check_format
from skred.errors import InputError
from skred.output import write_text
from skred.report.shared.documents_read import Documents, ReportError

if TYPE_CHECKING:
    from skred.report.shared.drawing import Picture

type Make = Callable[[Documents, Path], list[str]]
"""Makes page and figures of documents in a folder; returns the figures that there may be."""

__all__ = ["ReportError", "write_reports"]
_MOST_TRACKS = 100


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
        If it holds no results, results of another version of the format, or documents that are not as skred
        writes them. Any other error is a fault of skred: documents are known that a run has just written, or
        that have not changed since skred made their page.
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


def _in_place(folder: Path, make: Make) -> list[Path]:
    """Write into a hidden folder beside the results, then move everything to where it belongs."""
    documents = Documents(folder)
    with TemporaryDirectory(prefix=".skred-report-", dir=folder) as beside:
        possible = _made(make, documents, Path(beside))
        made = sorted(file.relative_to(beside) for file in Path(beside).rglob("*") if file.is_file())
        for name in {*made, *map(Path, possible)}:
            if (folder / name).is_dir():
                raise ReportError(f"{folder / name}: a folder is where this file is to go; move it away")
        for name in made:
            os.replace(Path(beside) / name, folder / name)
    for gone in set(map(Path, possible)).difference(made):
        (folder / gone).unlink(missing_ok=True)
    return [folder / name for name in made]


def _made(make: Make, documents: Documents, beside: Path) -> list[str]:
    """Make page and figures; an error is told as one of the documents, unless skred knows these."""
    try:
        possible = make(documents, beside)
        for page in beside.glob("*.html"):
            documents.sign(page)
    except Exception as error:
        of_the_machine = isinstance(error, OSError) and error.errno is not None
        if isinstance(error, (InputError, MemoryError)) or of_the_machine or documents.are_known():
            raise
        raise documents.unusable(error) from error
    return possible


def _diagnosis(documents: Documents, beside: Path) -> list[str]:
    from skred.report.diagnosis.report import FIGURES, render_diagnosis, save_diagnosis_figures

    document = documents.json("verdict.json")
    file = documents.folder / "verdict.json"
    check_format(file, document.get("report"), "report.format", FORMAT, ReportError)
    with documents.tree("diagnosis.nc") as tree:
        figures = save_diagnosis_figures(document, tree, beside)
        write_text(beside / "report.html", render_diagnosis(document, tree, figures))
    return [f"{name}.png" for name in FIGURES]


def _comparison(documents: Documents, beside: Path) -> list[str]:
    from skred.report.comparison.laws import COMPARISON_FIGURES, save_comparison_figures
    from skred.report.comparison.page import render_comparison
    from skred.report.shared.document import get, listed

    comparison = documents.json("compare.json")
    figures: dict[str, Picture] = {}
    possible = [f"{name}.png" for name in COMPARISON_FIGURES]
    for models, where in (
        (listed(comparison, "models"), ""),
        (listed(comparison, "pooled", "models"), "pooled"),
    ):
        for number, name in enumerate(_plain_name(get(model, "id"), documents.folder) for model in models):
            place = Path(where) / name
            drawn = _model_figures(documents, place, beside, f"m{number}", explored=not where)
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


def _calibration(documents: Documents, beside: Path) -> list[str]:
    from skred.report.calibration.page import render_calibration

    document = documents.json("summary.json")
    figures = _model_figures(documents, Path(), beside)
    write_text(beside / "report.html", render_calibration(document, figures))
    return _possible_of_a_model()


def _model_figures(
    documents: Documents, place: Path, beside: Path, key: str = "", *, explored: bool = True
) -> dict[str, Picture]:
    from skred.report.calibration.figures import save_model_figures

    (beside / place).mkdir(parents=True, exist_ok=True)
    with documents.tree(str(place / "posterior.nc")) as tree:
        return save_model_figures(tree, beside / place, key, explored=explored)


def _possible_of_a_model() -> list[str]:
    from skred.report.calibration.figures import MODEL_FIGURES

    return [f"{name}.png" for name in MODEL_FIGURES]


def _prediction(documents: Documents, beside: Path) -> list[str]:
    from skred.report.prediction.page import FIGURES, render_prediction, save_prediction_figures

    document = documents.json("prediction.json")
    figures: dict[str, Picture] = {}
    if document.get("valid") is True:
        with documents.tree("prediction.nc") as tree:
            figures = save_prediction_figures(document, tree, beside)
    write_text(beside / "report.html", render_prediction(document, figures))
    return [f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")]


def _scorecard(documents: Documents, beside: Path) -> list[str]:
    from skred.report.scorecard.figures import SCORECARD_FIGURES, save_scorecard_figures
    from skred.report.scorecard.page import render_scorecard

    document = documents.json("scorecard.json")
    figures = save_scorecard_figures(document, beside)
    write_text(beside / "scorecard.html", render_scorecard(document, figures))
    return [f"{name}.png" for name in SCORECARD_FIGURES]


def _tracks(documents: Documents, beside: Path) -> list[str]:
    """Figures of the tracks in a folder; nothing else in it is touched."""
    from skred.report.shared.style import write_png
    from skred.report.track.figures import track_figure

    for file in _track_documents(documents.folder):
        document = documents.json(file.name)
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


_KINDS: dict[str, Make] = {
    "verdict.json": _diagnosis,
    "compare.json": _comparison,
    "prediction.json": _prediction,
    "scorecard.json": _scorecard,
    "summary.json": _calibration,
}
"""What a folder holds, and what makes its report."""
