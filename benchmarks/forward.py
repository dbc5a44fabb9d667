"""How fast the kernel is, beside a plain numba loop and pure Python, and how exact.

    python -m benchmarks.forward [--repeat N] [--json FILE]

Twenty-two fronts with different parameters down Ryggfonn (394 cells), read at LC, CD, b and the runout.
Best of several, all in one run: compare the ratios, the times depend on the machine and its load.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.forward_peers import numba_peer, python_peer
from skred.campaign import find_campaign, read_campaign
from skred.physics.geometry import contributions_of, path_of, sensor_table
from skred.physics.kernel.columns import Column
from skred.physics.kernel.fronts import simulate, simulate_with_jacobian
from skred.physics.kernel.inputs import Contributions
from skred.physics.mechanisms import mechanisms
from skred.physics.reference import read_front
from skred.physics.terrain import Terrain, build_terrain

FloatArray = NDArray[np.float64]
SENSOR_S_M = np.array([1650.0, 1810.0, 1910.0])
SENSORS = sensor_table([*((s, s) for s in SENSOR_S_M), None])
N_RUNS = 22
CHECKED_RUNS = 60
SHORTEST_S = 0.02
"""Least duration of one timing [s]."""


def microseconds(function: Callable[[], Any], n_runs: int, repeat: int) -> float:
    """Best time per trajectory [us]."""
    function()
    start = time.perf_counter()
    function()
    calls = max(1, int(SHORTEST_S / (time.perf_counter() - start)))
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        for _ in range(calls):
            function()
        best = min(best, (time.perf_counter() - start) / calls)
    return best / n_runs * 1e6


def law_of(terrain: Terrain, *names: str) -> Contributions:
    """Contributions of some mechanisms."""
    return contributions_of([mechanisms()[name] for name in names], terrain)


def largest_difference(terrain: Terrain) -> float:
    """Largest relative difference from the plain reference, M2 over the range of its priors."""
    rng = np.random.default_rng(3)
    # Half the runs slippery: over most of the full range fronts stop early.
    strengths = rng.uniform(0.0, [1.5, 0.04], (CHECKED_RUNS, 2))
    strengths[::2] *= 0.2
    releases = rng.uniform(0.0, 400.0, CHECKED_RUNS)
    law = law_of(terrain, "coulomb_friction", "turbulent_drag")
    readings = simulate(strengths, releases, path_of(terrain), law, SENSORS)
    sensors = [*(("point", s, s) for s in SENSOR_S_M), ("runout", 0.0, 0.0)]
    largest = 0.0
    for (mu, drag), release, found in zip(strengths, releases, readings, strict=True):
        table = np.zeros((len(Column), terrain.n_cells))
        table[Column.FRICTION], table[Column.QUADRATIC] = mu, drag
        expected = read_front(terrain, table, release, sensors)
        largest = max(largest, float(np.max(np.abs(found - expected) / np.maximum(expected, 1e-3))))
    return largest


def measure(repeat: int) -> dict[str, float]:
    """Microseconds per trajectory by what was run, and the largest relative difference."""
    track = read_campaign(find_campaign("ryggfonn")).track
    terrain = build_terrain(track.x_m, track.z_m)
    path, rng = path_of(terrain), np.random.default_rng(1)
    coulomb, pcm = law_of(terrain, "coulomb_friction"), law_of(terrain, "coulomb_friction", "turbulent_drag")
    releases = np.zeros(N_RUNS)
    usual = np.column_stack([rng.uniform(0.2, 0.3, N_RUNS), rng.uniform(2e-3, 4e-3, N_RUNS)])
    strong = usual * [1.0, 15.0]
    slippery = rng.uniform(0.1, 0.3, (N_RUNS, 1))
    viscous = law_of(terrain, "coulomb_friction", "turbulent_drag", "viscous_drag")
    with_viscous = np.column_stack([usual, rng.uniform(0.01, 0.05, N_RUNS)])
    ground = (terrain.edge_s_m, terrain.sin_slope, terrain.cos_slope, terrain.curvature)
    peer = (*ground, *(np.ascontiguousarray(column) for column in usual.T), releases, SENSOR_S_M)
    assert np.allclose(simulate(usual, releases, path, pcm, SENSORS), numba_peer(*peer), rtol=1e-10)
    few = (*ground, usual[:2, 0], usual[:2, 1], releases[:2], SENSOR_S_M)

    def kernel(law: Contributions, strengths: FloatArray, run: Any = simulate) -> float:
        n_runs = len(strengths)
        return microseconds(lambda: run(strengths, np.zeros(n_runs), path, law, SENSORS), n_runs, repeat)

    return {
        "kernel": kernel(pcm, usual),
        "kernel, exponents beyond the series": kernel(pcm, strong),
        "kernel, normal force switching (M1)": kernel(coulomb, slippery),
        "kernel, terms in U": kernel(viscous, with_viscous),
        "kernel, terms in U, 16 times as many": kernel(viscous, np.tile(with_viscous, (16, 1))),
        "kernel, 16 times as many": kernel(pcm, np.tile(usual, (16, 1))),
        "kernel with jacobian": kernel(pcm, usual, simulate_with_jacobian),
        "kernel, a single run": kernel(pcm, usual[:1]),
        "plain numba loop": microseconds(lambda: numba_peer(*peer), N_RUNS, repeat),
        "pure Python": microseconds(lambda: python_peer(*few), 2, repeat),
        "largest relative difference": largest_difference(terrain),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeat", type=int, default=20, help="timings of each, the best counts")
    parser.add_argument("--json", type=Path, help="also write the numbers to this file")
    arguments = parser.parse_args()
    found = measure(arguments.repeat)
    table = Table("what", "us per trajectory", "numba loop / it", "Python / it")
    for name, value in found.items():
        if name != "largest relative difference":
            numba, python = found["plain numba loop"] / value, found["pure Python"] / value
            table.add_row(name, f"{value:.2f}", f"{numba:.1f}", f"{python:.0f}")
    console = Console()
    console.print(table)
    console.print(
        f"largest relative difference from the reference: {found['largest relative difference']:.1e}"
    )
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
