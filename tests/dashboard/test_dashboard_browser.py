"""The page in a real Chromium: as a file and served; one event through all views; the net is never asked."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from dashboard_cases import CHROMIUM, EVIL, needs_chromium

QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
EVENT = "19920311"

SELECTED = """event => window.skred.sources().map(s => [Array.from(s.data.event), s.selected.indices])
    .filter(([events]) => events.includes(event))
    .map(([events, rows]) => rows.length > 0 && rows.every(k => events[k] === event))"""

POINT = """() => {
    for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index)) {
      if (!view.el.closest(".view:not([hidden])")) continue;
      for (const one of view.model.renderers ?? []) if (one.data_source?.data.event) {
        const k = 6, data = one.data_source.data, box = view.canvas_view.el.getBoundingClientRect();
        const x = view.frame.x_scale.compute(data.x[k]), y = view.frame.y_scale.compute(data.y[k]);
        return [box.x + x, box.y + y, Array.from(data.event)[k]];
      } } }"""
"""The place of the seventh point of the figure in sight, and its event."""


@pytest.fixture(scope="module")
def page_file(results: Path, tmp_path_factory: Any) -> Path:
    """The offline page of two laws, a hierarchical calibration and a diagnosis."""
    from skred.dashboard.export import export
    from skred.dashboard.reading import read_given

    given = read_given([results / name for name in ("pcm", "coulomb", "hierarchical", "diagnosis")])
    return export(given, tmp_path_factory.mktemp("page") / "page.html")


class Opened:
    """A page, with what it asked for and what it complained of."""

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.requests, self.complaints = page, list[str](), list[str]()
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self._console)
        page.goto(url)
        page.wait_for_selector(".view .panel", timeout=60_000)

    def _console(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def show(self, view: str) -> None:
        set_view = """v => { const s = document.getElementById("view"); s.value = v;
                             s.dispatchEvent(new Event("change")); }"""
        self.page.evaluate(set_view, view)
        ready = """v => { const s = document.body.dataset.shown; return s === v || s.startsWith(v + "-"); }"""
        self.page.wait_for_function(ready, arg=view, timeout=120_000)

    @property
    def views(self) -> list[str]:
        return self.page.eval_on_selector_all(
            "#view option", "all => all.filter(o => !o.disabled).map(o => o.value)"
        )


@contextmanager
def opened(url: str, width: int = 1200) -> Iterator[Opened]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        try:
            yield Opened(browser.new_page(viewport={"width": width, "height": 900}), url)
        finally:
            browser.close()


def test_the_file_asks_for_nothing(page_file: Path) -> None:
    text = page_file.read_text(encoding="utf-8")
    markup = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)""", markup)
    assert "url(" not in markup and "@import" not in markup
    assert not re.findall(r"<script[^>]*\ssrc", text)
    assert "default-src 'none'" in markup and "connect-src 'none'" in markup
    (scripts,) = re.findall(r"script-src ([^;]*);", markup)
    assert all(one.startswith("'sha256-") for one in scripts.split())
    assert len(text) < 5_000_000


@needs_chromium
@pytest.mark.parametrize("width", [390, 1200])
def test_the_file_opens_and_every_view_fits(width: int, page_file: Path) -> None:
    with opened(page_file.as_uri(), width) as page:
        assert len(page.views) == 15
        for view in page.views:
            page.show(view)
            assert page.page.evaluate("document.documentElement.scrollWidth") <= width, view
            assert page.page.locator(".view:not([hidden]) .panel").count() > 0, view
        page.page.wait_for_timeout(500)
        assert page.complaints == []
        assert [one for one in page.requests if not one.startswith(("data:", "blob:"))] == [
            page_file.as_uri()
        ]


@needs_chromium
def test_a_click_on_an_event_highlights_it_everywhere(page_file: Path) -> None:
    with opened(page_file.as_uri()) as page:
        for view in ("pareto_k", "predictive", "candidates"):
            page.show(view)
        page.show("events")
        page.page.click(f"tr[data-event='{EVENT}']:not([data-only]) button")
        assert page.page.evaluate("window.skred.chosen()") == EVENT
        assert page.page.input_value("#event") == EVENT
        assert page.page.locator("tr.chosen").count() == 1
        assert page.page.locator("tr[data-only]:not([hidden])").count() > 4
        for view in ("speed", "held_out", "comparison", "loo_pit"):  # drawn after the choice
            page.show(view)
        marked = page.page.evaluate(SELECTED, EVENT)
        assert len(marked) > 12 and all(marked)
        page.page.click("#none")
        assert not any(page.page.evaluate(SELECTED, EVENT))


@needs_chromium
def test_a_click_on_a_point_chooses_its_event(page_file: Path) -> None:
    with opened(page_file.as_uri()) as page:
        page.show("pareto_k")
        page.page.wait_for_timeout(500)
        x, y, event = page.page.evaluate(POINT)
        page.page.mouse.click(x, y)
        page.page.wait_for_function("window.skred.chosen() !== null", timeout=5000)
        assert page.page.evaluate("window.skred.chosen()") == event
        page.show("events")
        assert page.page.locator("tr.chosen").get_attribute("data-event") == event


@needs_chromium
@pytest.mark.parametrize("clicks", [["trace", "trace"], ["trace", "rank", "trace"], ["trace", "rank"]])
def test_clicks_while_a_view_is_drawn_show_the_last_once(clicks: list[str], page_file: Path) -> None:
    click = (
        """all => { for (const v of all) document.querySelector(`nav button[data-view="${v}"]`).click(); }"""
    )
    with opened(page_file.as_uri()) as page:
        page.page.evaluate(click, clicks)
        for view in sorted(set(clicks) - {clicks[-1]}) + clicks[-1:]:
            page.page.wait_for_selector(f".view[data-key^='{view}-'] .panel", state="attached")
        page.page.wait_for_function(f"document.body.dataset.shown.startsWith('{clicks[-1]}-')")
        keys = page.page.eval_on_selector_all(".view", "all => all.map(one => one.dataset.key)")
        assert len(keys) == len(set(keys)) == 1 + len(set(clicks))
        visible = page.page.eval_on_selector_all(
            ".view:not([hidden])", "all => all.map(one => one.dataset.key)"
        )
        assert [one.partition("-")[0] for one in visible] == clicks[-1:]
        assert page.page.locator("#wait").is_hidden() and page.complaints == []


@needs_chromium
def test_names_that_attack_do_nothing_where_one_points_at_them(arviz_file: Any, tmp_path: Path) -> None:
    from skred.dashboard.export import export
    from skred.dashboard.reading import read_given

    file = export(read_given([arviz_file("evil", EVIL)]), tmp_path / "evil.html")
    with opened(file.as_uri()) as page:
        for view in page.views:
            page.show(view)
        page.show("pareto_k")
        page.page.wait_for_timeout(500)
        x, y, event = page.page.evaluate(POINT)
        page.page.mouse.move(x, y)
        page.page.wait_for_timeout(500)
        assert page.page.locator(".bk-tooltip-row-value").first.inner_text().strip() == event
        page.page.mouse.click(x, y)
        page.show("events")
        assert page.page.evaluate("window.skred.chosen()") == event
        assert page.page.locator("img").count() == 0
        assert page.page.evaluate("document.body.dataset.attacked") is None
        assert page.complaints == []


@needs_chromium
def test_the_file_runs_no_program_but_its_own(page_file: Path) -> None:
    """Should a name ever get past the escaping: the policy names the programs of the page by digest."""
    attack = f"""() => {{ document.body.insertAdjacentHTML("beforeend", `{EVIL}`);
        const script = document.createElement("script");
        script.textContent = "document.body.dataset.attacked = 2"; document.body.append(script); }}"""
    with opened(page_file.as_uri()) as page:
        page.page.evaluate(attack)
        page.page.wait_for_timeout(300)
        assert page.page.evaluate("document.body.dataset.attacked") is None
        assert len(page.complaints) >= 2 and all("Content Security Policy" in one for one in page.complaints)


@needs_chromium
def test_draws_of_the_chosen_event_can_be_looked_at_one_by_one(page_file: Path) -> None:
    shown = """() => { for (const d of Bokeh.documents) for (const m of d.all_models)
        if (m.name === "skred-draws") return Array.from(m.indices).length; return null; }"""
    with opened(page_file.as_uri()) as page:
        page.show("speed")
        assert page.page.evaluate(shown) == 0
        page.page.select_option("#event", EVENT)
        n = page.page.evaluate(shown)
        assert n > 5
        slider = page.page.locator(".view:not([hidden]) [data-draws]")
        slider.evaluate("s => { s.value = 3; s.dispatchEvent(new Event('input', {bubbles: true})); }")
        assert page.page.evaluate(shown) == 1


@contextmanager
def served(*places: Path) -> Iterator[str]:
    """The command, as a user runs it, until it is interrupted."""
    command = [sys.executable, "-m", "skred.cli", "dashboard", *map(str, places), "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        url = process.stdout.readline().strip()
        try:
            yield url
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=60) == 0
            assert "Traceback" not in process.stderr.read()


@needs_chromium
@pytest.mark.slow
def test_the_server_shows_the_same_beside_a_folder_of_another_version(results: Path, older: Path) -> None:
    with served(results / "hierarchical", results / "diagnosis", older) as url, opened(url, 390) as page:
        assert "another version" in page.page.inner_text(".view .box")
        page.show("pareto_k")
        page.page.select_option("#event", EVENT)
        for view in page.views:
            page.show(view)
            assert page.page.evaluate("document.documentElement.scrollWidth") <= 390, view
            assert "could not be made" not in page.page.inner_text(".view:not([hidden])")
        marked = page.page.evaluate(SELECTED, EVENT)
        assert len(marked) > 12 and all(marked)
        assert page.complaints == []
        elsewhere = [
            one for one in page.requests if not one.startswith((url, "data:", "blob:", "ws://localhost"))
        ]
        assert elsewhere == []


@pytest.mark.slow
def test_the_server_is_for_this_machine_only(results: Path) -> None:
    import socket
    from urllib.parse import urlsplit

    with served(results / "pcm") as url:
        port = urlsplit(url).port
        assert port is not None and urlsplit(url).hostname == "localhost"
        addresses = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
        for address in addresses - {"127.0.0.1"}:
            if not str(address).startswith("127."):
                with pytest.raises(OSError), socket.create_connection((str(address), port), timeout=2):
                    pass


@needs_chromium
@pytest.mark.slow
def test_other_parameters_can_be_asked_of_the_server(arviz_file: Any) -> None:
    with served(arviz_file("many", n_parameters=30)) as url, opened(url) as page:
        page.show("trace")
        assert page.page.locator(".view:not([hidden]) .panel").count() == 12
        page.page.click("details summary")
        page.page.eval_on_selector_all(
            "[data-parameter]", "all => all.forEach((one, k) => { one.checked = k === 20; })"
        )
        page.page.click("[data-again]")
        page.page.wait_for_function("document.querySelectorAll('.view:not([hidden]) .panel').length === 1")
        assert "theta (19)" in page.page.inner_text(".view:not([hidden]) h3")
        assert page.complaints == []
