"""How long one evaluation of the pooled M2 log density takes, three ways.

``python -m benchmarks.logp [--quick] [--json FILE]``. The same PyMC model is evaluated through

* the Ops' numba dispatch, as skred does;
* the same Ops without a dispatch, that is through `perform`. PyTensor's default backend (numba)
  then falls back to object mode for them: that is what a user who wraps the same compiled kernel
  but registers no dispatch gets, and what the bar is for. The C virtual machine, which the user
  can choose instead, is shown too;
* `pytensor.scan` over the cells with the same density Op, under both backends.

Every way must give the same log density, at points that stop early, run off the track and lift off
the ground as well. A call is that of the compiled function with `trust_input`, one raveled vector
in, cycling through a few points near the posterior; the time is the best of several rounds.
"""

# ruff: noqa: E402 I001
import benchmarks.peers.single_thread  # noqa: F401

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytensor
from cyclopts import App, Parameter
from numpy.typing import NDArray
from pymc.pytensorf import join_nonshared_inputs
from rich.console import Console
from rich.table import Table

from models.pcm import LAW
from benchmarks.peers import scan_model
from benchmarks.peers.performed import expect_warnings, performed
from skred.campaign import find_campaign, read_campaign
from skred.inference.pooled.problem import PooledProblem, pooled_problem

FloatArray = NDArray[np.float64]
TOLERANCE = 1e-8
BARS = {"perform": 2.0, "scan": 15.0}
"""How many times faster than each of the others the dispatch has to be."""
OURS = "numba dispatch"


@dataclass(frozen=True)
class Way:
    """One way to evaluate the model.

    Attributes
    ----------
    name : str
    build : callable
        Problem to PyMC model.
    mode : str
        PyTensor's mode.
    without_dispatch : bool
        Whether the Ops are evaluated through `perform`.
    bar : str
        The bar it is measured against, empty where none.
    quick : bool
        Whether it is worth its compile time in a quick run.
    """

    name: str
    build: Callable[[PooledProblem], Any]
    mode: str
    without_dispatch: bool = False
    bar: str = ""
    quick: bool = True


WAYS = (
    Way(OURS, LAW.build, "NUMBA"),
    Way("perform, numba", LAW.build, "NUMBA", True, "perform"),
    Way("perform, C", LAW.build, "CVM", True),
    Way("scan, numba", scan_model.build, "NUMBA", bar="scan"),
    Way("scan, C", scan_model.build, "CVM", quick=False),
)


@dataclass
class Timing:
    """What was measured of one way, with or without the gradient."""

    way: str
    gradient: bool
    compile_s: float
    call_us: float
    largest_difference: float = 0.0
    ratio: float = 1.0
    bar: float | None = None

    @property
    def verdict(self) -> str:
        """Whether the bar is met and the values agree."""
        if not self.largest_difference <= TOLERANCE:
            return "DIFFERS"
        if self.bar is None:
            return ""
        return f"{'met' if self.ratio >= self.bar else 'MISSED'} (>= {self.bar:g})"


def check_points() -> FloatArray:
    """Unconstrained points: around the posterior, and far from it so that every branch is taken."""
    rng = np.random.default_rng(1)
    near = np.log([0.287, 0.00226]) + 0.1 * rng.standard_normal((8, 2))
    far = rng.uniform([-4.0, -10.0], [0.7, -4.0], size=(40, 2))
    return np.vstack([near, far])


def compiled(way: Way, problem: PooledProblem, gradient: bool) -> tuple[Any, float]:
    """Compiled function of the raveled parameters, and the seconds it took, model building included."""
    started = time.perf_counter()
    model = way.build(problem)
    [log_density], raveled = join_nonshared_inputs(
        point=model.initial_point(), outputs=[model.logp()], inputs=model.value_vars
    )
    outputs = [log_density, pytensor.grad(log_density, raveled)] if gradient else [log_density]
    inputs = [raveled]
    if way.without_dispatch:
        inputs, outputs = performed(inputs, outputs)
    function = pytensor.function(inputs, outputs, mode=way.mode)
    function.trust_input = True
    function(check_points()[0])  # numba compiles at the first call
    return function, time.perf_counter() - started


def seconds_per_call(function: Callable[[FloatArray], Any], points: FloatArray, rounds: int) -> float:
    """Best mean time over the points."""
    cycle = [point.copy() for point in points]
    started = time.perf_counter()
    for point in cycle:
        function(point)
    # Enough repetitions for 20 ms a round, so that the clock does not matter.
    repeats = max(1, int(0.02 / (time.perf_counter() - started)))
    best = np.inf
    for _ in range(rounds):
        started = time.perf_counter()
        for _ in range(repeats):
            for point in cycle:
                function(point)
        best = min(best, (time.perf_counter() - started) / (repeats * len(cycle)))
    return float(best)


def flat(values: list[Any]) -> FloatArray:
    """Value and gradient in one row."""
    return np.concatenate([np.ravel(value) for value in values])


def largest_difference(values: FloatArray, reference: FloatArray, gradient: bool) -> float:
    """Largest relative difference (absolute below 1) of the log density, and of the gradient if any.

    The gradient is compared near the posterior only: at the kinks, where the front just reaches a
    sensor, it is whatever one-sided derivative the implementation took.
    """
    if gradient:
        values, reference = values[:8], reference[:8]
    return float(np.max(np.abs(values - reference) / np.maximum(1.0, np.abs(reference))))


def measure(problem: PooledProblem, gradient: bool, quick: bool) -> list[Timing]:
    """Time every way."""
    rounds = 5 if quick else 25
    points = check_points()
    timings: list[Timing] = []
    reference = np.empty(0)
    for way in [way for way in WAYS if way.quick or not quick]:
        function, compile_s = compiled(way, problem, gradient)
        values = np.array([flat(function(point.copy())) for point in points])
        if not timings:
            reference = values
        timing = Timing(way.name, gradient, compile_s, 1e6 * seconds_per_call(function, points[:8], rounds))
        timing.largest_difference = largest_difference(values, reference, gradient)
        timings.append(timing)
        timing.ratio = timing.call_us / timings[0].call_us
        # The bars are for the log density, the quantity that Metropolis asks for.
        timing.bar = BARS.get(way.bar) if not gradient else None
    return timings


def table_of(timings: list[Timing]) -> Table:
    """Table for people."""
    table = Table(title="One evaluation of the pooled M2 log density", title_justify="left")
    for name in ("way", "gradient"):
        table.add_column(name)
    for name in ("us per call", "times ours", "compile s", "difference", "bar"):
        table.add_column(name, justify="right")
    for timing in timings:
        table.add_row(
            timing.way,
            "with" if timing.gradient else "",
            f"{timing.call_us:.2f}",
            f"{timing.ratio:.1f}",
            f"{timing.compile_s:.1f}",
            f"{timing.largest_difference:.1e}",
            timing.verdict,
            end_section=timing.way == timings[-1].way,
        )
    return table


app = App(result_action="return_value")


@app.default
def main(*, quick: bool = False, json_file: Annotated[Path | None, Parameter(name="--json")] = None) -> int:
    """Time the pooled M2 log density.

    Parameters
    ----------
    quick
        Fewer rounds, and without `scan` on the C virtual machine, which takes a minute to compile.
    json_file
        Write the figures here.
    """
    expect_warnings()
    problem = pooled_problem(read_campaign(find_campaign("ryggfonn")))
    timings = measure(problem, False, quick) + measure(problem, True, quick)
    Console(width=100).print(table_of(timings))
    if json_file is not None:
        packages = ("pytensor", "pymc", "numba", "numpy")
        record = {
            "versions": {name: version(name) for name in packages},
            "timings": [asdict(timing) for timing in timings],
        }
        json_file.write_text(json.dumps(record, indent=1) + "\n")
    return 0 if all("MISSED" not in t.verdict and "DIFFERS" not in t.verdict for t in timings) else 1


if __name__ == "__main__":
    raise SystemExit(app())
