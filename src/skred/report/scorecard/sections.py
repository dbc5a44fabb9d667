"""Sections of a scorecard's page: what each says, its tables, its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skred.report.scorecard.tables import (
    KINDS,
    Path,
    Table,
    bar_table,
    by_kind,
    count_table,
    share_text,
    snr_table,
    trial_table,
    value_text,
)
from skred.report.shared.document import Document, get
from skred.report.shared.labels import name_text


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes
    ----------
    anchor, title : str
    words : tuple of str
        Paragraphs.
    tables : tuple of Table
    figures : tuple of (str, str)
        Name of each figure, and its caption.
    """

    anchor: str
    title: str
    words: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[tuple[str, str], ...] = ()


def sections_of(document: Document) -> list[Section]:
    """All sections, in order."""
    own = get(document, "methods", str(get(document, "diagnosis")))
    scores = own["open"]
    return [
        _bars(document),
        _alarms(scores),
        _detection(scores),
        _names(scores),
        _unlisted(scores),
        _confusion(),
        _places(scores),
        _probabilities(scores),
        _improvement(scores),
        *_masked(own["masked"]),
        *_baselines(document),
        _times(scores),
        Section("trials", "Every trial", ("None is left out.",), (trial_table(document),)),
    ]


def _bars(document: Document) -> Section:
    words = (
        "Each acceptance criterion was set before the trials. The point estimate is judged, for false alarms "
        "the one-sided upper limit. Beyond doubt: the whole interval lies on the same side. The ceiling is "
        "what linearised calculations with perfect knowledge of the models reach. With fewer than 20 trials, "
        "100 for the calibration of probabilities, no criterion is called met. Trials with a compensated "
        "effect have a section of their own. They are in no other, but for the counts of answers.",
    )
    return Section("bars", "Acceptance criteria", words, (bar_table(document), count_table(document)))


def _alarms(scores: Mapping[str, Any]) -> Section:
    habits = sorted({name for kind in KINDS for name in scores[kind]["false_alarms"]["by_nastiness"]})
    rows: list[tuple[str, Path]] = [
        ("all nulls", ("false_alarms", "all")),
        ("plain", ("false_alarms", "plain")),
        ("contaminated", ("false_alarms", "nasty")),
        *((name_text(name), ("false_alarms", "by_nastiness", name)) for name in habits),
        ("all nulls, failures counted", ("false_alarms", "all", "with_failures")),
    ]
    words = ("An alarm is a verdict that says something is missing, off or unexplained where nothing is "
             "hidden. Contaminated: heavy tails, correlated errors, an odd event, outliers.",)  # fmt: skip
    table = by_kind("Share of alarms, 95 % interval, counts.", scores, rows)
    caption = "Share of alarms and its one-sided 95 % upper limit, which the acceptance criterion is for."
    return Section("alarms", "False alarms", words, (table,), (("false_alarms", caption),))


def _detection(scores: Mapping[str, Any]) -> Section:
    rows: list[tuple[str, Path]] = [
        (f"at {at}, logistic fit", ("detection", "fit", "at", at)) for at in ("5.5", "7")
    ]
    groups = sorted({name for kind in KINDS for name in scores[kind]["detection"]["by_hidden"]})
    rows += [(f"hidden: {name_text(name)}", ("detection", "by_hidden", name)) for name in groups]
    words = ("Found means an alarm, whatever its name. Signal-to-noise is the square root of twice the "
             "expected log likelihood ratio. The ceiling of detection is that of one known candidate at a "
             "limit of 2.85.",)  # fmt: skip
    tables = (snr_table(scores, "detection", "Share found."), by_kind("Found, in other words.", scores, rows))
    caption = (
        "Found, above, and named, below, against signal-to-noise; crosses are acceptance criteria. Where two "
        "points of a panel share a bin they are moved apart."
    )
    return Section("detection", "Detection", words, tables, (("power", caption),))


def _names(scores: Mapping[str, Any]) -> Section:
    keys = {
        "right_first_name": "right first name",
        "right_class": "right class",
        "right_set": "right credible set",
        "right_set_of_3": "right credible set of at most 3",
        "named_alone": "a single name given",
        "ceiling_right_first_name": "ceiling: right first name",
        "ceiling_named": "ceiling: a single name given",
    }
    tables = [
        by_kind(caption, scores, [(words, ("naming", part, key)) for key, words in keys.items()])
        for part, caption in (
            ("around_7", "Signal-to-noise 6 to 8.5, one or two listed effects hidden."),
            ("around_10", "Signal-to-noise 8.5 to 13."),
            ("all", "All signal-to-noise."),
        )
    ]
    tables.append(snr_table(scores, "naming", "Right first name by signal-to-noise.", "right_first_name"))
    two: list[tuple[str, Path]] = [
        ("leading name is one of both", ("naming", "two", "right_first_name")),
        ("both found", ("naming", "two", "both_found")),
        ("both found or tied with a name", ("naming", "two", "both_in_sets")),
    ]
    tables.append(by_kind("Two mechanisms hidden.", scores, two))
    honest: list[tuple[str, Path]] = [
        ("right where a single name is given", ("honesty", "right_where_named")),
        ("right class where a single name is given", ("honesty", "right_class_where_named")),
        ("credible sets that hold the truth", ("honesty", "set_holds_truth_where_tied")),
        ("names in a credible set, median", ("honesty", "names_in_tie_sets_median")),
        ("single names over the ceiling's expectation", ("honesty", "named_over_ceiling")),
    ]
    tables.append(
        by_kind("Selectivity: is it so when it is said? All trials, nulls and unlisted too.", scores, honest)
    )
    words = ("Of two hidden mechanisms the leading name may be either. A right class is a right name or one "
             "that no recordings tell from it: drag, friction and entrainment on the same stretch; viscous "
             "and turbulent drag; an obstacle, drag on at most 100 m and a biased sensor; on sparse trials a "
             "release offset and centrifugal friction.",)  # fmt: skip
    return Section("names", "Names", words, tuple(tables))


def _unlisted(scores: Mapping[str, Any]) -> Section:
    keys = {
        "wrong_name": "a listed name, wrongly",
        "wrong_name_is_nearest_listed": "of these, the nearest listed one",
        "unexplained": "unexplained",
        "place_right": "place right",
        "place_right_where_stated": "place right, where stated",
        "stated_length_m_median": "length of the stated stretch, median [m]",
    }
    tables = [
        by_kind(caption, scores, [(words, ("unlisted", part, key)) for key, words in keys.items()])
        for part, caption in (
            ("around_10", "Signal-to-noise 8.5 to 13."),
            ("snr_8_and_more", "Signal-to-noise 8 and more."),
            ("all", "All signal-to-noise."),
        )
    ]
    found = scores["all"]["unlisted"]["by_id"]
    rows = [
        (name_text(name), str(one["n"]), share_text(one["wrong_name"]), share_text(one["unexplained"]),
         share_text(one["place_right"]))
        for name, one in found.items()
    ]  # fmt: skip
    if rows:
        head = ("hidden", "n", "a listed name", "unexplained", "place right")
        tables.append(Table("Each unlisted effect.", head, tuple(rows)))
    words = ("Effects that no list has: every listed name is wrong. A place is right when the true middle "
             "lies in the stated stretch or within 100 m of its middle.",)  # fmt: skip
    return Section("unlisted", "Effects that are not in the list", words, tuple(tables))


def _confusion() -> Section:
    figures = (
        (
            "confusion",
            "Each row is a kind of truth, with its number of trials; frames mark right names. Credible sets "
            "count by their leading name, time-outs as crashes. Trials with a compensated effect are "
            "included.",
        ),
        ("confusion_classes", "The same over classes of mechanisms that recordings cannot tell apart."),
    )
    return Section("confusion", "What was said of what", (), (), figures)


def _places(scores: Mapping[str, Any]) -> Section:
    ids = sorted({name for kind in KINDS for name in scores[kind]["place"]["by_id"]})
    rows: list[tuple[str, Path]] = [
        ("median error", ("place", "error", "median_m")),
        ("nine in ten errors below", ("place", "error", "quantile_90_m")),
        ("median error, right name in the set", ("place", "error_where_set_is_right", "median_m")),
        *((f"median error, {name_text(name)}", ("place", "by_id", name, "median_m")) for name in ids),
    ]
    shares: list[tuple[str, Path]] = [
        ("right stretch, signal-to-noise 6 to 8.5", ("place", "right_stretch_around_7")),
        ("right stretch, all", ("place", "right_stretch")),
        ("right stretch, where one is stated", ("place", "right_stretch_where_stated")),
    ]
    covered = sorted({name for kind in KINDS for name in scores[kind]["strength"]["by_id"]})
    strengths: list[tuple[str, Path]] = [
        ("interval holds the truth", ("strength", "coverage_90")),
        *((name_text(name), ("strength", "by_id", name)) for name in covered),
        ("stated over true strength, median", ("strength", "mean_over_truth_median")),
    ]
    tables = (
        by_kind("Place errors [m].", scores, rows, decimals=0),
        by_kind("The stated stretch shares at least half of the shorter of the two.", scores, shares),
        by_kind("90 % intervals of strengths, where the right name was given.", scores, strengths),
    )
    words = ("True effects have soft edges and exponents that are not whole, so a true strength is that of a "
             "stand-in. Strengths that mean different quantities are not compared.",)  # fmt: skip
    caption = "Every trial with a place, left; share of trials with a smaller error, right."
    return Section("places", "Places and strengths", words, tables, (("places", caption),))


def _probabilities(scores: Mapping[str, Any]) -> Section:
    rows: list[tuple[str, Path]] = [
        ("ECE, most probable id", ("probability", "top_id", "ece")),
        ("expected if calibrated", ("probability", "top_id", "ece_expected_if_calibrated")),
        ("ECE less that", ("probability", "top_id", "ece_less_expected")),
        ("ECE, all ids", ("probability", "all_ids", "ece")),
        ("expected if calibrated", ("probability", "all_ids", "ece_expected_if_calibrated")),
        ("ECE less that", ("probability", "all_ids", "ece_less_expected")),
        ("log score per trial [nats]", ("probability", "log_score_mean_nats")),
        ("Brier score per trial", ("probability", "brier_mean")),
    ]
    words = ("Where nothing is hidden, contaminated or not, nothing should be probable; where no list has "
             "the effect, unlisted. Of two mechanisms both count, added in the log score; they are left "
             "out of the reliability of all ids. The log score charges for at least a probability of 0.001, "
             "which stands for answers without any. Bins are ten of equal width. Statements of one trial are "
             "not independent: the intervals of all ids are somewhat narrow.",)  # fmt: skip
    caption = "Share of statements that are true against their stated probability."
    table = by_kind("Scores of stated probabilities.", scores, rows, decimals=3)
    return Section("probabilities", "Stated probabilities", words, (table,), (("reliability", caption),))


def _improvement(scores: Mapping[str, Any]) -> Section:
    rows: list[tuple[str, Path]] = [
        ("held-out log score better, where named", ("held_out", "better_where_named")),
        ("held-out difference, median [nats]", ("held_out", "difference_nats_median")),
        ("realised over promised gain, ratio of sums", ("gain", "realised_over_promised")),
        ("slope through the origin", ("gain", "slope_through_origin")),
        ("realised gain positive", ("gain", "realised_positive")),
    ]
    caption = "Each point is a trial in which something was named."
    table = by_kind("Before and after.", scores, rows)
    return Section("improvement", "Improvement", (), (table,), (("gain", caption),))


def _masked(scores: Mapping[str, Any]) -> list[Section]:
    if not scores["all"]["n"]:
        return []
    rows: list[tuple[str, Path]] = [
        ("found", ("detection", "all")),
        ("right first name", ("naming", "all", "right_first_name")),
        ("right class", ("naming", "all", "right_class")),
        ("right credible set", ("naming", "all", "right_set")),
        ("right first name, signal-to-noise 6 to 8.5", ("naming", "around_7", "right_first_name")),
        ("right where a single name is given", ("honesty", "right_where_named")),
        ("right stretch", ("place", "right_stretch")),
        ("log score per trial [nats]", ("probability", "log_score_mean_nats")),
    ]
    words = ("Here the calibrated base model is right on average at every sensor, because its strengths or "
             "an opposing effect took the hidden one on. It shows only in what differs between "
             "avalanches.",)  # fmt: skip
    tables = (
        by_kind("Trials with a compensated effect.", scores, rows),
        snr_table(scores, "detection", "Share found."),
    )
    return [Section("masked", "Trials with a compensated effect", words, tables)]


def _baselines(document: Document) -> list[Section]:
    paired = get(document, "paired") or {}
    if not paired:
        return []
    tables = [_paired_table(paired, kind) for kind in ("sparse", "dense")]
    tables += [_side_by_side(get(document, "methods"), kind) for kind in ("sparse", "dense")]
    words = ("Every baseline has the same trials. So that a loose method has no advantage over a strict one, "
             "each method's score gets the threshold at which it raises as many false alarms as the "
             "diagnosis; for the diagnosis the score is 1 less the probability of nothing. As decided: "
             "the diagnosis by its own verdicts, the baseline by that threshold. Differences come with "
             "paired bootstrap intervals, thresholds drawn anew each time.",)  # fmt: skip
    caption = "Right first names, left; differences, right."
    return [
        Section("baselines", "Baselines on the same trials", words, tuple(tables), (("baselines", caption),))
    ]


def _paired_table(paired: Mapping[str, Any], kind: str) -> Table:
    rows = [
        (
            name,
            _difference(one[kind]["right_first_name"]),
            _difference(one[kind]["right_set"]),
            _difference(one[kind]["as_decided_right_first_name"]),
            "states none" if one[kind]["log_score_difference_nats"] is None
            else value_text(one[kind]["log_score_difference_nats"]),
        )
        for name, one in paired.items()
    ]  # fmt: skip
    first = next(iter(paired.values()))[kind]
    caption = (
        f"{kind}: diagnosis, baseline, difference and its interval, at {first['false_alarms']} false alarms "
        f"in {first['n_nulls']} nulls; {first['n_listed']} trials with listed effects."
    )
    head = (
        "baseline",
        "right first name",
        "right credible set",
        "right first name, as decided",
        "log score [nats]",
    )
    return Table(caption, head, tuple(rows))


def _difference(one: Mapping[str, Any]) -> str:
    if one["difference"] is None:
        return "no trial"
    interval = f"({one['low']:+.2f} to {one['high']:+.2f})"
    return f"{one['ours']:.2f}, {one['theirs']:.2f}: {one['difference']:+.2f} {interval}"


def _side_by_side(methods: Mapping[str, Any], kind: str) -> Table:
    """Main scores of every method by its own verdicts."""
    columns: Sequence[tuple[str, Path]] = (
        ("false alarms", ("false_alarms", "all")),
        ("found", ("detection", "all")),
        ("right first name", ("naming", "all", "right_first_name")),
        ("right credible set", ("naming", "all", "right_set")),
        ("right where named", ("honesty", "right_where_named")),
    )
    rows = []
    for name, parts in methods.items():
        found = by_kind("", parts["open"], columns)
        place = 1 + KINDS.index(kind)
        log = get(parts["open"], kind, "probability", "log_score_mean_nats", "value")
        rows.append((name, *(row[place] for row in found.rows), "none" if log is None else f"{log:.2f}"))
    head = ("method", *(words for words, _ in columns), "log score")
    return Table(f"{kind}: every method by its own verdicts.", head, tuple(rows))


def _times(scores: Mapping[str, Any]) -> Section:
    rows: list[tuple[str, Path]] = []
    for key, clock in (("wall", "wall"), ("cpu", "CPU")):
        rows += [
            (f"{clock} time, median [s]", ("time", key, "median_seconds")),
            (f"{clock} time, nine in ten below [s]", ("time", key, "quantile_90_seconds")),
            (f"{clock} time, longest [s]", ("time", key, "max_seconds")),
        ]
    shares: list[tuple[str, Path]] = [
        ("wall time within 60 s sparse, 120 s dense", ("time", "wall", "within_limit")),
        ("CPU time within 30 s sparse, 60 s dense", ("time", "cpu", "within_limit")),
        ("crashes", ("failures", "crash")),
        ("time-outs", ("failures", "timeout")),
    ]
    words = ("A crash, a time-out and an answer that never came are wrong answers and count as such "
             "in all scores.",)  # fmt: skip
    tables = (
        by_kind("Time of a verdict.", scores, rows, decimals=0),
        by_kind("Limits and failures.", scores, shares),
    )
    return Section("times", "Times and failures", words, tables)
