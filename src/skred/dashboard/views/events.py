"""One event in all runs: what was recorded, what is predicted of it, how much it weighs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from markupsafe import Markup

from skred.campaign import Status
from skred.dashboard.figures import quietly
from skred.dashboard.reading import Given
from skred.dashboard.run import Run, ids_of, shown
from skred.dashboard.view import Asked, Panel

_MOST_ROWS = 400
_MOST_DETAILS = 4000


def event_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """A table of all events, and of the chosen one its readings in every run."""
    runs = [one for one in given.runs if one.likelihood_name is not None]
    return [
        Panel("All events", html=_table(given, runs), wide=True, note="A click on a row follows the event."),
        Panel("The chosen event: recorded and predicted", html=_details(runs), wide=True),
    ]


def all_events(given: Given) -> list[str]:
    """Events of all runs, each once, in the order in which they come."""
    ids: dict[str, None] = {}
    for run in given.runs:
        ids |= dict.fromkeys(run.event_ids)
    return list(ids)


def _table(given: Given, runs: Sequence[Run]) -> str:
    """Readings, and for each run Pareto k and elpd."""
    recorded = next((run for run in given.runs if run.recordings is not None), None)
    readings = {} if recorded is None else _readings(recorded)
    sensors = [] if recorded is None else [_sensor(recorded, k) for k in range(len(_sensors(recorded)))]
    head = [Markup('<th class="n">{}</th>').format(name) for name in sensors]
    scores = {run.key: _scores(run) for run in runs}
    for run in runs:
        head.append(Markup('<th class="n" title="{}">k, run {}</th>').format(run.title, run.number))
    rows = []
    for event in all_events(given)[:_MOST_ROWS]:
        cells = [
            Markup('<td class="n">{}</td>').format(text) for text in readings.get(event, [""] * len(sensors))
        ]
        for run in runs:
            k, limit = scores[run.key].get(event, (np.nan, np.inf))
            bad = Markup(' class="n bad"') if k > limit else Markup(' class="n"')
            cells.append(Markup("<td{}>{}</td>").format(bad, "" if np.isnan(k) else f"{k:.2f}"))
        row = Markup('<tr data-event="{0}"><th><button type="button" class="link">{0}</button></th>{1}</tr>')
        rows.append(row.format(event, Markup("").join(cells)))
    runs_told = Markup("").join(Markup("<li>run {}: {}</li>").format(run.number, run.title) for run in runs)
    table = Markup(
        '<div class="tall"><table class="events"><thead><tr><th>event</th>{}</tr></thead><tbody>{}</tbody>'
        '</table></div><p class="note">k is Pareto k; red where importance sampling is not reliable.</p>'
        '<ul class="note">{}</ul>'
    )
    return str(table.format(Markup("").join(head), Markup("").join(rows), runs_told))


def _sensors(run: Run) -> Sequence[object]:
    assert run.recordings is not None
    return run.recordings.sensors[:8]


def _sensor(run: Run, column: int) -> str:
    assert run.recordings is not None
    sensor = run.recordings.sensors[column]
    return f"{shown(sensor.id, 20)} [{'m' if sensor.is_runout else 'm/s'}]"


def _readings(run: Run) -> dict[str, list[str]]:
    recordings = run.recordings
    assert recordings is not None
    words = {Status.NOT_REACHED: "not reached", Status.MISSING: "", Status.AT_LEAST: "at least …",
             Status.AT_MOST: "at most …", Status.BETWEEN: "between …"}  # fmt: skip
    found = {}
    for number, event in enumerate(recordings.event_ids):
        texts = []
        for column, sensor in enumerate(recordings.sensors[:8]):
            value, status = recordings.values[number, column], Status(int(recordings.status[number, column]))
            digits = 0 if sensor.is_runout else 1
            texts.append(f"{value:.{digits}f}" if status == Status.OBSERVED else words[status])
        found[shown(event, 60)] = texts
    return found


def _scores(run: Run) -> dict[str, tuple[float, float]]:
    if not run.can_leave_out:
        return {}
    k = np.asarray(run.loo.pareto_k, dtype=float).ravel()
    return {event: (float(one), float(run.loo.good_k)) for event, one in zip(run.event_ids, k, strict=True)}


def _details(runs: Sequence[Run]) -> str:
    """A row for each event, run and sensor; the page shows those of the chosen event."""
    rows, more = list[Markup](), Markup("")
    for row in _rows(runs):
        if len(rows) == _MOST_DETAILS:
            more = Markup('<p class="note">Only the first {} rows are in this page.</p>').format(len(rows))
            break
        event, *cells = row
        said = Markup("").join(
            Markup('<td class="{}">{}</td>').format(("", "", "n")[min(k, 2)], cell)
            for k, cell in enumerate(cells)
        )
        rows.append(Markup('<tr data-event="{}" data-only hidden>{}</tr>').format(event, said))
    head = ("run", "sensor", "recorded", "predicted (90 %)", "predicted below")
    titles = Markup("").join(
        Markup('<th class="{}">{}</th>').format("" if k < 2 else "n", name) for k, name in enumerate(head)
    )
    table = Markup(
        '<p class="note" data-none>Choose an event above, or click a point in any figure.</p>'
        '<div class="scroll"><table data-details hidden><thead><tr>{}</tr></thead>'
        "<tbody>{}</tbody></table></div>"
    )
    return str(table.format(titles, Markup("").join(rows)) + more)


def _rows(runs: Sequence[Run]) -> Iterator[tuple[str, ...]]:
    for run in runs:
        for name in run.observed_names:
            observed, predicted = run.group("observed_data")[name], run.group("posterior_predictive")[name]
            draws = predicted.transpose("chain", "draw", *observed.dims).values
            draws = draws.reshape(-1, observed.size)
            with quietly():
                low, median, high = np.quantile(draws, [0.05, 0.5, 0.95], axis=0)
            values = observed.values.ravel()
            digits = 0 if observed.attrs.get("units") == "m" else 1
            below = (draws < values).mean(axis=0) + 0.5 * (draws == values).mean(axis=0)
            for k, event in enumerate(ids_of(observed)):
                recorded, middle, least, most = (
                    f"{one[k]:.{digits}f}" for one in (values, median, low, high)
                )
                yield (
                    event,
                    str(run.number),
                    run.sensor_label(name),
                    recorded,
                    f"{middle} ({least} to {most})",
                    f"{100.0 * below[k]:.0f} %",
                )
