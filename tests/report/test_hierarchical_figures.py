from dataclasses import replace

import numpy as np
import pytest
from hierarchical_cases import hierarchical_calibration, hierarchical_comparison, hierarchical_ryggfonn
from report_cases import HOSTILE, as_saved, comparison
from test_report_figures import assert_pictures

from skred.campaign import Event, Sensor, Status
from skred.physics.laws import load_law
from skred.report.calibration.figures import save_model_figures
from skred.report.calibration.new_avalanches import reached_text
from skred.report.calibration.population import population_lines, set_limits
from skred.report.comparison.laws import save_comparison_figures
from skred.report.comparison.likelihoods import likelihoods_figure
from skred.report.shared.draws import new_avalanche, region_levels, shaded_density
from skred.report.shared.labels import population_label, population_role, symbol_text
from skred.report.shared.recordings import recordings_of
from skred.report.shared.style import new_figure, tint


@pytest.fixture(scope="module")
def problem():
    return hierarchical_ryggfonn()


def with_sensors(problem, sensors, **changes):
    """The problem with other sensors; recordings are repeated as needed."""
    campaign = problem.campaign
    runout = next(k for k, s in enumerate(campaign.sensors) if s.is_runout)
    columns = [runout if s.is_runout else k % runout for k, s in enumerate(sensors)]
    taken = {name: getattr(campaign, name)[:, columns] for name in ("values", "status", "stated_sd")}
    return replace(problem, campaign=replace(campaign, sensors=tuple(sensors), **taken, **changes))


@pytest.mark.slow
@pytest.mark.parametrize("law_id", ["coulomb", "voellmy"])
def test_every_law_has_its_figures(problem, law_id, tmp_path):
    law = load_law(law_id)
    files = save_model_figures(as_saved(hierarchical_calibration(problem, law), law, problem), tmp_path)
    assert list(files) == [
        "trace", "joint", "marginals", "new_avalanche", "population", "events", "along_track",
    ]  # fmt: skip
    assert_pictures(files)


@pytest.mark.slow
def test_a_law_of_three_strengths(problem, tmp_path):
    pcm, constant = load_law("pcm"), load_law("constant")
    law = replace(
        pcm,
        mechanisms=pcm.mechanisms + constant.mechanisms,
        parameters=pcm.parameters + constant.parameters,
    )
    assert_pictures(
        save_model_figures(as_saved(hierarchical_calibration(problem, law), law, problem), tmp_path)
    )


@pytest.mark.slow
def test_spans_many_sensors_events_releases_no_reference_and_hostile_names(problem, tmp_path):
    places = np.linspace(300.0, 1900.0, 13)
    spans = [Sensor(f"{k}{HOSTILE}", "front_velocity", s, s + 60.0, 0.1, 1.0) for k, s in enumerate(places)]
    runout = Sensor("雪 runout", "runout", np.nan, np.nan, 0, 12)
    campaign = problem.campaign
    rows = np.resize(np.arange(campaign.n_events), 70)
    events = tuple(Event(f"{HOSTILE}{k}", 25.0 * (k % 3), 5.0, {}) for k in range(len(rows)))
    taken = {name: getattr(campaign, name)[rows] for name in ("values", "status", "stated_sd")}
    many = replace(problem, campaign=replace(campaign, events=events, **taken))
    changed = with_sensors(many, [*spans, runout], reference_s_m=None)
    law = replace(load_law("pcm"), title=HOSTILE)
    tree = hierarchical_calibration(changed, law, draws=10)
    releases = tree["event_posterior"]["release"].values
    releases += np.random.default_rng(0).uniform(0, 5, releases.shape)
    assert_pictures(save_model_figures(as_saved(tree, law, changed), tmp_path))


@pytest.mark.slow
def test_nothing_recorded_nothing_reached_and_draws_all_alike(problem, tmp_path):
    status = problem.campaign.status.copy()
    status[:, 0] = Status.MISSING
    changed = replace(problem, campaign=replace(problem.campaign, status=status))
    law = load_law("pcm")
    tree = hierarchical_calibration(changed, law)
    tree["new_avalanches"]["reached"].values[..., 0] = False
    for group in ("event_posterior", "new_avalanches"):
        for name in law.parameter_names:
            tree[group][name].values[:] = tree[group][name].values[0, 0, 0]
    for name in (parameter.name for parameter in changed.parameters(law)):
        tree["posterior"][name].values[:] = tree["posterior"][name].values[0, 0]
    del tree.attrs["gate"]
    assert_pictures(save_model_figures(as_saved(tree, law, changed), tmp_path))


def test_what_is_said_of_a_sensor(problem):
    law = load_law("pcm")
    tree = hierarchical_calibration(problem, law)
    recordings = recordings_of(as_saved(tree, law, problem))
    sensor = recordings.sensors[2]
    reached = tree["new_avalanches"]["reached"].values
    reached[..., 2] = False
    reached[0, :, 0, 2] = True
    draws = new_avalanche(tree, recordings, sensor)
    assert draws.reached == pytest.approx(1 / 44) and len(draws.reading) == 40
    text = reached_text(draws, problem.terrain.length_m)
    assert text == "reached by 2 % of new avalanches,\nby 15 of 21 recorded (3 read 0), 1 missing"
    runout = new_avalanche(tree, recordings, recordings.sensors[3])
    assert runout.offset == problem.campaign.reference_s_m
    assert reached_text(runout, float(runout.front.max()) + runout.offset).startswith("less than 1 % of new")
    assert reached_text(runout, 1e6) == "22 recorded"


def test_the_median_of_new_avalanches_narrows_with_the_population_alone(problem):
    law = load_law("constant")
    tree = hierarchical_calibration(problem, law, draws=20)
    for name in ("retardation", "retardation_spread"):
        tree["posterior"][name].values[:] = tree["posterior"][name].values[0, 0]
    medians = as_saved(tree, law, problem)["along_track"]["median_speed"].values
    assert np.ptp(medians, axis=0).max() == pytest.approx(0.0, abs=1e-9)
    median = float(tree["posterior"]["retardation"].values[0, 0])
    at_median = problem.speeds(law.mechanisms, np.array([[median]]), 0.0)[0]
    assert medians[0, 50:250] == pytest.approx(at_median[50:250], rel=0.02)


def test_the_population_in_words(problem):
    law = load_law("voellmy")
    lines = population_lines(as_saved(hierarchical_calibration(problem, law, draws=500), law, problem))
    assert [line for line in lines if line and not line.startswith(" ")] == [
        "Across avalanches: mean and 90 % interval",
        "median μ", "median D", "spread sd(log μ)", "spread sd(log D)", "correlation corr(log μ, log D)",
    ]  # fmt: skip
    assert lines[3].startswith("    0.29") and lines[6].endswith("1/m")


def test_regions_hold_their_share():
    mass = np.array([[0.4, 0.3], [0.2, 0.1]])
    assert region_levels(mass, (0.85, 0.5)) == [0.2, 0.3]


def test_wide_ranges_are_logarithmic_with_legible_ticks():
    axes = new_figure(2.0, "").subplots()
    set_limits(axes, axes.xaxis, 0.0004, 0.05)
    set_limits(axes, axes.yaxis, 4.0, 5.0)
    assert axes.get_xscale() == "log" and axes.get_yscale() == "linear"
    shown = [axes.xaxis.get_major_formatter()(v) for v in axes.xaxis.get_majorticklocs()]
    assert {"0.001", "0.003", "0.01", "0.03"} <= set(shown)


def test_shaded_density_has_the_intervals_of_the_draws():
    axes = new_figure(2.0, "").subplots()
    draws = np.linspace(0.0, 1.0, 1001)
    grid = np.linspace(0.0, 1.0, 50)
    shaded_density(axes, grid, np.ones(50), draws, "#0072B2", "draws")
    spans = [np.ptp(area.get_paths()[0].vertices[:, 0]) for area in axes.collections]
    assert spans == pytest.approx([1.0, 0.9, 0.5])
    assert tint("#000000", 0.25) == pytest.approx((0.75, 0.75, 0.75))


def test_labels_of_a_population(problem):
    parameters = problem.parameters(load_law("voellmy"))
    assert [population_label(p) for p in parameters] == [
        "median dry friction\nμ [-]",
        "median\nξ h [m²/s²]",
        "spread\nsd(log μ) [-]",
        "spread\nsd(log D) [-]",
        "correlation\ncorr(log μ, log D) [-]",
    ]
    assert population_role("dry_friction") == "median" and population_role(None) == "median"
    assert symbol_text("sd(log  mu)") == "sd(log μ)" and symbol_text("mu0") == "mu0"


def test_comparison_figures(tmp_path):
    files = save_comparison_figures(hierarchical_comparison(), tmp_path)
    names = ["comparison_elpd", "pointwise", "pareto_k", "predictions", "evidence", "likelihoods"]
    assert list(files) == names
    assert_pictures(files)


def test_comparison_figures_with_gaps_and_hostile_names(tmp_path):
    document = hierarchical_comparison()
    for model in [*document["models"], *document["pooled"]["models"]]:
        model["id"] = f"{HOSTILE}{model['id']}"
    rows = document["models"][0]["new_avalanche"]
    rows[0].update(sensor=HOSTILE, low=None, mean=None, recorded_mean=None, recorded_reached=None)
    document["models"][1]["new_avalanche"] = rows[:1]
    document["models"][1]["difference"]["se"] = None
    document["pooled"]["models"][0]["difference"] = None
    assert_pictures(save_comparison_figures(document, tmp_path))


def test_no_figure_of_both_calibrations_where_there_is_one():
    assert likelihoods_figure(comparison()) is None
    for pooled in (None, {"reason": "too few readings", "models": []}):
        assert likelihoods_figure({**hierarchical_comparison(), "pooled": pooled}) is None
