"""How long `skred diagnose` takes by the clock, loading packages included: to its verdict, and to its report.

``python -m benchmarks.diagnose_time [--json FILE]`` runs the command on the 22 avalanches of Ryggfonn, one
base law after the other, and on dense campaigns of the development seeds, each with the base law that its
trial asks about. Asked: 60 s for 22 sparse events, 120 s for 15 events with 40 gates, on two cores. First
each law is run once and not counted, so that everything is compiled. Both cores must be free.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from skred.campaign import find_campaign, read_campaign, write_campaign
from skred.simulator.draw import draw_trial

app = cyclopts.App(help=__doc__)
LAWS = ("coulomb", "pcm", "constant", "voellmy")
DENSE = ((1701, "nothing"), (1702, "obstacle"), (1703, "turbulent_drag"), (1704, "sensor_bias"))
"""Seeds of dense trials, and what they hide."""


def timed(name: str, campaign: Path | str, law: str, out: Path) -> dict[str, Any]:
    """Seconds of one diagnosis, and what it says."""
    command = ["diagnose", str(campaign), "--base-model", law, "--out", str(out), "--force"]
    started, clock = time.monotonic(), time.time()
    subprocess.run([sys.executable, "-m", "skred.cli", *command], check=True, capture_output=True)
    seconds = time.monotonic() - started
    file = out / "verdict.json"  # written first, before report and figures
    verdict, told = json.loads(file.read_text(encoding="utf-8")), file.stat().st_mtime - clock
    found = read_campaign(find_campaign(str(campaign)))
    row = {
        "campaign": name,
        "events": found.n_events,
        "sensors": len(found.sensors),
        "base_model": law,
        "seconds": seconds,
        "verdict_seconds": told,
        "stages": verdict["seconds"],
        "verdict": verdict["verdict"],
    }
    print(
        f"{name} {law}: {row['events']} events, {row['sensors']} sensors, verdict after {told:.1f} s,"
        f" all after {seconds:.1f} s, {row['verdict']}"
    )
    return row


@app.default
def main(
    *, out: Annotated[Path | None, cyclopts.Parameter(name="--json", help="File for the figures.")] = None
) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory(prefix="diagnose-") as scratch:
        folder = Path(scratch)
        for law in LAWS:
            timed("not counted: Ryggfonn", "ryggfonn", law, folder / "report")
        rows = [timed("Ryggfonn", "ryggfonn", law, folder / "report") for law in LAWS]
        for seed, hidden in DENSE:
            trial, campaign = draw_trial(seed, kind="dense", hidden=hidden), folder / f"dense-{seed}"
            write_campaign(trial.campaign, campaign)
            law = trial.truth["base_model"]
            rows.append(timed(f"dense, {hidden}", campaign, law, folder / "report"))
    if out is not None:
        out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    app()
