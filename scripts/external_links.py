"""Ask every other host that the pages link to whether it has them: ``python scripts/external_links.py``.

It needs a network, so no test runs it on the real links. Exit code 1: some are not there.
"""

from __future__ import annotations

import re
import sys
import urllib.error
import urllib.request
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
READ = ("README.md", "CHANGELOG.md", "docs/*.md", "docs/notebooks/*.py", "benchmarks/*.md", "studies/*.md")
LINK = re.compile(r"https?://[^\s)>\]\"'`]+")
NO_ANSWER = {401, 403, 405, 429}
"""What hosts say to programs of pages that people can see."""
SECONDS = 20


def external_links(root: Path) -> dict[str, list[str]]:
    """Every link to another host, with the pages that have it."""
    found: dict[str, list[str]] = {}
    for page in sorted(file for pattern in READ for file in root.glob(pattern)):
        for link in sorted(set(LINK.findall(page.read_text(encoding="utf-8")))):
            found.setdefault(link.rstrip(".,;:"), []).append(str(page.relative_to(root)))
    return found


def answer(link: str) -> str | None:
    """What is wrong with a link; None if nothing is."""
    request = urllib.request.Request(link, headers={"User-Agent": "Mozilla/5.0 (link check)"})
    try:
        with urllib.request.urlopen(request, timeout=SECONDS):
            return None
    except urllib.error.HTTPError as error:
        return "tells programs nothing, look yourself" if error.code in NO_ANSWER else f"HTTP {error.code}"
    except OSError as error:
        return str(getattr(error, "reason", error))


def main(links: Iterable[tuple[str, list[str]]]) -> int:
    """Print what is wrong."""
    gone = 0
    for link, pages in links:
        said = answer(link)
        if said is not None:
            gone += "look yourself" not in said
            print(f"{link}: {said} ({', '.join(pages)})")
    return 1 if gone else 0


if __name__ == "__main__":
    sys.exit(main(external_links(ROOT).items()))
