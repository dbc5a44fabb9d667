"""Pages in a browser: Debian's Chromium, driven by playwright."""

import shutil

import pytest
from diagnosis_report_cases import documents
from page_checks import check_page
from report_cases import as_saved, calibration, ranked_comparison, ryggfonn

from skred.physics.laws import load_law
from skred.report.calibration.figures import save_model_figures
from skred.report.comparison.laws import save_comparison_figures
from skred.report.comparison.page import render_comparison
from skred.report.diagnosis.report import render_diagnosis, save_diagnosis_figures


@pytest.fixture(scope="package")
def pages(tmp_path_factory):
    """A diagnosis and a comparison with all their figures, as files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("skred.report.shared.style.DPI", 40)
        folder = tmp_path_factory.mktemp("pages")
        document, tree = documents("two")
        diagnosis = render_diagnosis(document, tree, save_diagnosis_figures(document, tree, folder))
        compared, problem, law = ranked_comparison(), ryggfonn(), load_law("pcm")
        figures = save_comparison_figures(compared, folder)
        drawn = save_model_figures(as_saved(calibration(problem, law), law, problem), folder, "m0")
        figures |= {f"pcm/{name}": one for name, one in drawn.items()}
        comparison_page = render_comparison(compared, figures)
    files = {"diagnosis": diagnosis, "comparison": comparison_page}
    for name, html in files.items():
        check_page(html)
        (folder / f"{name}.html").write_text(html, encoding="utf-8")
    return folder


@pytest.fixture(scope="package")
def browser():
    """Chromium without a window; skipped where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("there is no Chromium")
    arguments = [
        "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
        "--disable-sync",
    ]  # fmt: skip
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=arguments)
        yield opened
        opened.close()


@pytest.fixture
def opened(browser, pages):
    """Opens a page; fails on what it says to the console, and on every request it makes."""
    told, contexts = [], []

    def of(name, **options):
        context = browser.new_context(**{"viewport": {"width": 1200, "height": 900}, **options})
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: told.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: told.append(str(error)))
        page.on(
            "request",
            lambda one: told.append(one.url) if not one.url.startswith(("file:", "data:")) else None,
        )
        page.goto((pages / f"{name}.html").as_uri())
        return page

    yield of
    for context in contexts:
        context.close()
    assert told == [], "a broken policy is an error of the console as well"
