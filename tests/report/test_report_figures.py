import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from report_cases import HOSTILE, as_saved, calibration, comparison, entry, ryggfonn, with_sensors

from skred.campaign import Event, Sensor
from skred.physics.laws import load_law
from skred.report.calibration.along_track import along_track_figure
from skred.report.calibration.figures import save_model_figures
from skred.report.comparison.laws import save_comparison_figures
from skred.report.shared.draws import density, interval, spread
from skred.report.shared.labels import figure_text, printable, shortened, symbol_text, unit_text
from skred.report.shared.style import law_colours, write_png

SHAPES = {"svg", "g", "defs", "clipPath", "path", "rect", "use", "text", "tspan", "image", "circle", "title"}
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def problem():
    return ryggfonn()


def assert_pictures(pictures, at_least=12_000):
    files = [one.file for one in pictures.values()]
    for file in files:
        assert file.read_bytes().startswith(PNG)
        assert file.stat().st_size > at_least, file.name
    folder = files[0].parent
    assert sorted(folder.iterdir()) == sorted(files), "nothing but the figures, no partial files"
    for one in pictures.values():
        assert_drawing(one.wide)
        assert_drawing(one.narrow)


def assert_drawing(markup):
    """What a page with a strict policy can hold: no style attribute, no script, nothing from elsewhere."""
    root = ElementTree.fromstring(markup)
    assert root.tag == "svg" and root.get("role") == "img" and root.get("aria-label") == ""
    names = {element.get("id") for element in root.iter()} - {None}
    for element in root.iter():
        assert element.tag in SHAPES, element.tag
        assert not {name for name in element.attrib if name == "style" or name.startswith(("on", "{"))}
        reference = element.get("href", "#")
        assert reference.startswith("data:image/png;base64,") or reference[1:] in names | {""}
        for name in ("fill", "stroke"):
            assert not element.get(name, "").startswith("#"), "a colour that does not follow light and dark"


@pytest.mark.slow
@pytest.mark.parametrize("law_id", ["coulomb", "voellmy"])
def test_every_law_of_the_pack_has_its_figures(problem, law_id, tmp_path):
    law = load_law(law_id)
    files = save_model_figures(as_saved(calibration(problem, law), law, problem), tmp_path)
    names = ["trace", "joint", "marginals", "predictive", "along_track"]
    if len(law.parameters) == 1:
        names.remove("joint")
    assert list(files) == names
    assert_pictures(files)


@pytest.mark.slow
def test_spans_many_sensors_no_reference_and_hostile_names(problem, tmp_path):
    places = np.linspace(300.0, 1900.0, 13)
    spans = [Sensor(f"{k}{HOSTILE}", "front_velocity", s, s + 60.0, 0.1, 1.0) for k, s in enumerate(places)]
    changed = with_sensors(
        problem, [*spans, Sensor("雪 runout", "runout", np.nan, np.nan, 0, 12)], reference_s_m=None
    )
    law = replace(load_law("pcm"), title=HOSTILE)
    assert_pictures(save_model_figures(as_saved(calibration(changed, law), law, changed), tmp_path))


def test_names_in_any_script(problem, tmp_path):
    sensors = [Sensor("雪崩", "front_velocity", 1700.0, 1700.0, 0.1, 1.0)]
    changed = with_sensors(problem, sensors)
    law = load_law("constant")
    assert_pictures(save_model_figures(as_saved(calibration(changed, law), law, changed), tmp_path))


@pytest.mark.slow
def test_only_runouts_several_releases_and_draws_all_alike(problem, tmp_path):
    events = tuple(
        Event(event.id, 25.0 * (k % 3), None, {}) for k, event in enumerate(problem.campaign.events)
    )
    changed = with_sensors(problem, [Sensor("runout", "runout", np.nan, np.nan, 0, 12)], events=events)
    law = load_law("pcm")
    tree = calibration(changed, law)
    for name in law.parameter_names:
        tree["posterior"][name].values[:] = tree["posterior"][name].values[0, 0]
    tree["mean_response"]["response"].values[:] = 2000.0
    del tree.attrs["gate"]
    assert_pictures(save_model_figures(as_saved(tree, law, changed), tmp_path))


def test_comparison_figures(tmp_path):
    files = save_comparison_figures(comparison(), tmp_path)
    assert list(files) == ["comparison_elpd", "pointwise", "pareto_k", "predictions", "evidence"]
    assert_pictures(files)


@pytest.mark.slow
def test_comparison_figures_of_many_sensors_events_and_laws(tmp_path):
    best = [-15.0 - 0.01 * k for k in range(60)]
    laws = [entry(f"{k}{HOSTILE}", [b - 0.1 * k for b in best], best, n_sensors=14) for k in range(8)]
    laws[1]["exact"]["failed_refits"] = [f"{HOSTILE}3"]
    laws[2]["exact"]["pointwise"][5] = None
    events = [f"{HOSTILE}{k}" for k in range(60)]
    files = save_comparison_figures({**comparison(), "models": laws, "event_ids": events}, tmp_path)
    assert len(files) == 6
    assert_pictures(files)


def test_figures_without_numbers_are_left_out(tmp_path):
    document = comparison()
    assert save_comparison_figures({**document, "models": document["models"][2:]}, tmp_path) == {}
    only = save_comparison_figures({**document, "models": document["models"][:1]}, tmp_path)
    assert "pointwise" not in only and "comparison_elpd" in only
    for model in document["models"]:
        model.update(loo=None, exact=None, difference=None, evidence=None, response=None)
    assert save_comparison_figures(document, tmp_path) == {}


def test_the_users_settings_change_nothing(problem, tmp_path):
    import matplotlib

    law = load_law("constant")
    tree = as_saved(calibration(problem, law), law, problem)
    plain = write_png(along_track_figure(tree), tmp_path / "plain.png")
    with matplotlib.rc_context({"font.size": 30.0, "axes.facecolor": "red", "lines.linewidth": 9}):
        before = dict(matplotlib.rcParams)
        other = write_png(along_track_figure(tree), tmp_path / "other.png")
        assert dict(matplotlib.rcParams) == before
    assert plain.read_bytes() == other.read_bytes()


def test_importing_the_report_is_light():
    heavy = "{'matplotlib', 'jinja2', 'rich', 'xarray', 'arviz', 'pymc', 'numba'}"
    code = (
        "import sys, skred.report.calibration.figures, skred.report.comparison.page; "
        "import skred.report.shared.tables, skred.report.folders, skred.report.diagnosis.report; "
        "import skred.report.prediction.figures, skred.report.scorecard.page; "
        f"print(sorted({heavy} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_law_has_one_colour_in_every_figure():
    alone = law_colours(["pcm"])["pcm"]
    together = law_colours(["voellmy", "pcm", "constant", "coulomb"])
    assert together["pcm"] == alone
    assert len(set(together.values())) == 4


def test_density_integrates_to_one_and_keeps_its_height_at_a_limit():
    draws = abs(np.random.default_rng(0).standard_normal(4000))
    grid = np.linspace(0.0, 6.0, 600)
    smooth = density(draws, grid, lower=0.0)
    assert np.trapezoid(smooth, grid) == pytest.approx(1.0, abs=0.01)
    assert smooth[0] == pytest.approx(np.sqrt(2 / np.pi), rel=0.12)


def test_interval_is_equal_tailed():
    assert interval(np.arange(101.0)) == pytest.approx((5.0, 95.0))


def test_labels_are_moved_apart_no_further_than_needed():
    moved = spread([0.0, 0.0, 100.0], 10.0)
    assert moved == pytest.approx([-5.0, 5.0, 100.0])
    assert np.diff(spread(np.zeros(7), 3.0)) == pytest.approx(np.full(6, 3.0))


def test_labels():
    assert unit_text("m2 s-2") == "m²/s²"
    assert unit_text("1") == "-"
    assert symbol_text("xi h") == "ξ h"
    assert "\x1b" not in printable(HOSTILE)
    assert len(shortened(HOSTILE, 40)) == 40 and shortened("short", 40) == "short"
    assert "$" not in figure_text("$x$").replace(r"\$", "")
