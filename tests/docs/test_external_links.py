"""The program that asks other hosts for what the pages link to, on a host of this test's own."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest
from page_links import ROOT, is_external, links_of, text_of

ANSWERS = {"/there": 200, "/gone": 404, "/moved": 301, "/people-only": 403, "/broken": 500}


class Host(BaseHTTPRequestHandler):
    """Answers as its addresses say."""

    def do_GET(self) -> None:
        code = ANSWERS[self.path]
        self.send_response(code)
        if code == 301:
            self.send_header("Location", "/there")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture
def host() -> Iterator[str]:
    server = HTTPServer(("127.0.0.1", 0), Host)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import external_links

    return external_links


def test_it_says_which_links_are_gone(
    host: str, program: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    links = " ".join(f"[a link]({host}{path})." for path in ANSWERS)
    (tmp_path / "README.md").write_text(links, encoding="utf-8")
    assert program.main(program.external_links(tmp_path).items()) == 1
    assert capsys.readouterr().out.splitlines() == [
        f"{host}/broken: HTTP 500 (README.md)",
        f"{host}/gone: HTTP 404 (README.md)",
        f"{host}/people-only: tells programs nothing, look yourself (README.md)",
    ]
    (tmp_path / "README.md").write_text(f"{host}/there and <{host}/people-only>", encoding="utf-8")
    assert program.main(program.external_links(tmp_path).items()) == 0


def test_a_host_that_is_not_there_is_told(program: Any) -> None:
    assert "refused" in program.answer("http://127.0.0.1:9/").lower()


def test_it_asks_for_every_link_of_the_pages(program: Any) -> None:
    asked = program.external_links(ROOT)
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for link in filter(is_external, links_of(text_of(page))):
            assert str(page.relative_to(ROOT)) in asked[link]
    assert len(asked) > 20
