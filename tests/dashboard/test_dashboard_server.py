"""The server answers this machine, by its own name only."""

from __future__ import annotations

import http.client
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import pytest

from skred.dashboard.reading import read_given

PATHS = ("/", "/metadata", "/autoload.js?bokeh-autoload-element=x")


@contextmanager
def asked(port: int, host: str, path: str) -> Iterator[http.client.HTTPResponse]:
    """The answer to a request that says which host it means."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", host)
    connection.endheaders()
    try:
        yield connection.getresponse()
    finally:
        connection.close()


def answers(place: Path, hosts: list[str]) -> dict[tuple[str, str], tuple[int, str]]:
    """What a server says to each host and path: status and text."""
    from skred.dashboard.serve import start

    server, _ = start(read_given([place]))
    found = {}

    def ask() -> None:
        try:
            for host in hosts:
                for path in PATHS:
                    with asked(server.port, host.format(port=server.port), path) as reply:
                        found[host, path] = (reply.status, reply.read().decode("utf-8", "replace"))
        finally:
            server.io_loop.add_callback(server.io_loop.stop)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        server.io_loop.start()
    finally:
        thread.join(timeout=120)
        server.stop()
    return found


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_request_by_another_name_is_refused(results: Path) -> None:
    """A page elsewhere can have its name resolved to this machine, and so read what is served to it."""
    ours = ["localhost", "localhost:{port}", "127.0.0.1:{port}", "LOCALHOST"]
    others = [
        "evil.example",
        "evil.example:{port}",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "a]b",
    ]
    found = answers(results / "pcm", ours + others)
    for (host, path), (status, text) in found.items():
        assert status == (200 if host in ours else 403), (host, path)
        assert ("19920311" in text) == (host in ours and path == "/"), (host, path)
    assert len(found) == len(PATHS) * len(ours + others)
    page = found["localhost", "/"][1]
    for said in ("object-src 'none'", "base-uri 'none'", "form-action 'none'"):
        assert said in page
