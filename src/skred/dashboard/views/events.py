"""One event in all runs: what was recorded, what is predicted of it, how much it weighs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from markupsafe import Markup

from skred.campaign import Sensor, Status
from skred.dashboard.each import Failures
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.figures import quietly
from skred.report.explore.panel import Panel
from skred.report.explore.run import MOST_EVENTS, MOST_SENSORS, Run, ids_of, shown

_MOST_DETAILS = 4000
_WORDS: dict[int, str] = {
    Status.NOT_REACHED: "not reached", Status.MISSING: "", Status.AT_LEAST: "at least …",
    Status.AT_MOST: "at most …", Status.BETWEEN: "between …",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Observed:
    """Runs of the same observations: of one campaign, or of files with the same data.

    Attributes
    ----------
    runs : list of Run
    events : list of str
        Each once.
    """

    runs: list[Run]
    events: list[str]

    @property
    def title(self) -> str:
        """Its runs, and the name of its campaign."""
        numbers = ", ".join(str(run.number) for run in self.runs)
        name = str(self.runs[0].tree.attrs.get("campaign", ""))
        of = f"runs {numbers}" if len(self.runs) > 1 else f"run {numbers}"
        return f"Events of {of} ({shown(name, 40)})" if name else f"Events of {of}"


def event_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """For each campaign a table of its events, and of the chosen one its readings in every run."""
    failures = Failures()
    sets = observed_sets(given, failures)
    panels = [
        Panel(
            one.title if len(sets) > 1 else "All events", html=_table(one, failures), wide=True,
            note=_note(one, [other for other in sets if other is not one]),
        )
        for one in sets
    ]  # fmt: skip
    runs = [one for of in sets for one in of.runs if one.likelihood_name is not None]
    panels.append(Panel("The chosen event: recorded and predicted", html=_details(runs, failures), wide=True))
    return panels + failures.panels()


def all_events(given: Given) -> list[str]:
    """Events of all runs, each once, in the order in which they come."""
    ids: dict[str, None] = {}
    for run in given.runs:
        ids |= dict.fromkeys(run.event_ids)
    return list(ids)


def observed_sets(given: Given, failures: Failures) -> list[Observed]:
    """Runs by what they observe: an id says nothing of another campaign's event of that id."""
    sets: dict[str, list[Run]] = {}
    for run, key in failures.of_each(given.runs, _observations):
        sets.setdefault(key, []).append(run)
    found = []
    for runs in sets.values():
        events = list(dict.fromkeys(event for run in runs for event in run.event_ids))
        found += [Observed(runs, events)] if events else []
    return found


def _observations(run: Run) -> str:
    return str(run.tree.attrs.get("campaign_fingerprint", "")) or run.observations or run.key


def _note(one: Observed, others: Sequence[Observed]) -> str:
    """How to use a table, what it leaves out, and which of its ids say less than they seem to."""
    said = ["A click on a row follows the event."]
    if len(one.events) > MOST_EVENTS:
        said.append(f"Only the first {MOST_EVENTS} of {len(one.events)} events are in this table.")
    n_sensors = max((len(_sensors(run)) for run in one.runs), default=0)
    if n_sensors > MOST_SENSORS:
        said.append(f"Only the first {MOST_SENSORS} of {n_sensors} sensors are in this table.")
    again = set(one.events) & {event for other in others for event in other.events}
    if again:
        said.append(
            f"{len(again)} of these ids are in other tables too. They are other events: all of one id are"
            " highlighted together."
        )
    return " ".join(said)


def _table(one: Observed, failures: Failures) -> str:
    """Readings, and for each run Pareto k."""
    recorded = next((run for run in one.runs if run.recordings is not None), None)
    readings = {} if recorded is None else dict(failures.of_each([recorded], _readings)).get(recorded, {})
    sensors = [_sensor(sensor) for sensor in _sensors(recorded)[:MOST_SENSORS]] if readings else []
    head = [Markup('<th class="n">{}</th>').format(name) for name in sensors]
    left_out = (run for run in one.runs if run.likelihood_name is not None)
    scores = dict(failures.of_each(left_out, _scores))
    for run in scores:
        head.append(Markup('<th class="n" title="{}">k, run {}</th>').format(run.title, run.number))
    rows = []
    for event in one.events[:MOST_EVENTS]:
        cells = [
            Markup('<td class="n">{}</td>').format(text) for text in readings.get(event, [""] * len(sensors))
        ]
        for of_run in scores.values():
            k, limit = of_run.get(event, (np.nan, np.inf))
            bad = Markup(' class="n bad"') if k > limit else Markup(' class="n"')
            cells.append(Markup("<td{}>{}</td>").format(bad, "" if np.isnan(k) else f"{k:.2f}"))
        row = Markup('<tr data-event="{0}"><th><button type="button" class="link">{0}</button></th>{1}</tr>')
        rows.append(row.format(event, Markup("").join(cells)))
    told = Markup("").join(Markup("<li>run {}: {}</li>").format(run.number, run.title) for run in scores)
    table = Markup(
        '<div class="tall"><table class="events"><thead><tr><th>event</th>{}</tr></thead><tbody>{}</tbody>'
        '</table></div><p class="note">k is Pareto k; red where importance sampling is not reliable.</p>'
        '<ul class="note">{}</ul>'
    )
    return str(table.format(Markup("").join(head), Markup("").join(rows), told))


def _sensors(run: Run | None) -> Sequence[Sensor]:
    return run.recordings.sensors if run is not None and run.recordings is not None else ()


def _sensor(sensor: Sensor) -> str:
    return f"{shown(sensor.id, 20)} [{'m' if sensor.is_runout else 'm/s'}]"


def _readings(run: Run) -> dict[str, list[str]]:
    recordings = run.recordings
    assert recordings is not None
    found = {}
    for number, event in enumerate(recordings.event_ids):
        texts = []
        for column, sensor in enumerate(recordings.sensors[:MOST_SENSORS]):
            value, status = recordings.values[number, column], int(recordings.status[number, column])
            digits = 0 if sensor.is_runout else 1
            known = f"{value:.{digits}f}" if status == Status.OBSERVED else _WORDS.get(status)
            texts.append(f"unknown status {status}" if known is None else known)
        found[shown(event, 60)] = texts
    return found


def _scores(run: Run) -> dict[str, tuple[float, float]]:
    if not run.can_leave_out:
        return {}
    k = np.asarray(run.loo.pareto_k, dtype=float).ravel()
    return {event: (float(one), float(run.loo.good_k)) for event, one in zip(run.event_ids, k, strict=True)}


def _details(runs: Sequence[Run], failures: Failures) -> str:
    """A row for each event, run and sensor; the page shows those of the chosen event."""
    rows, more = list[Markup](), Markup("")
    made = failures.of_each(runs, lambda run: list(islice(_rows(run), _MOST_DETAILS + 1)))
    for row in (row for _, of_run in made for row in of_run):
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


def _rows(run: Run) -> Iterator[tuple[str, ...]]:
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
            recorded, middle, least, most = (f"{one[k]:.{digits}f}" for one in (values, median, low, high))
            yield (
                event,
                str(run.number),
                run.sensor_label(name),
                recorded,
                f"{middle} ({least} to {most})",
                f"{100.0 * below[k]:.0f} %",
            )
