"""An adaptive integrator in time for a front on smooth terrain; shares no code with the package."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

SmoothFunction = Callable[[float], float]


@dataclass(frozen=True)
class TimeRun:
    """Runout [m], and arrival time [s] and speed [m/s] at each place (NaN and 0 where not reached)."""

    runout: float
    arrival_time: np.ndarray
    speed: np.ndarray


def integrate_in_time(
    slope: SmoothFunction,
    curvature: SmoothFunction,
    release: float,
    places: Sequence[float],
    *,
    constant: float = 0.0,
    linear: float = 0.0,
    quadratic: float = 0.0,
    friction: float = 0.0,
    weakening: float = 0.0,
    weakening_speed: float = np.inf,
    end: float = np.inf,
    duration: float = 500.0,
    release_speed: float = 0.0,
) -> TimeRun:
    """Integrate dU/dt along the track until U falls to zero or the track ends."""
    g = 9.81

    def motion(_: float, state: np.ndarray) -> list[float]:
        s, speed = state
        phi = slope(s)
        normal = max(0.0, g * np.cos(phi) + curvature(s) * speed**2)
        retardation = constant + linear * speed + quadratic * speed**2 + friction * normal
        retardation += weakening * g * np.cos(phi) / (1.0 + speed / weakening_speed)
        return [speed, g * np.sin(phi) - retardation]

    def stopped(_: float, state: np.ndarray) -> float:
        return float(state[1])

    def left(_: float, state: np.ndarray) -> float:
        return float(state[0] - end)

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]
    left.terminal = True  # type: ignore[attr-defined]
    events: list[Callable[[float, np.ndarray], float]] = [stopped, left]
    for place in places:
        events.append(lambda _, state, place=place: float(state[0] - place))
    solution = solve_ivp(
        motion,
        (0.0, duration),
        [release, release_speed],
        method="DOP853",
        events=events,
        rtol=1e-11,
        atol=1e-11,
        max_step=0.5,
    )
    assert solution.status == 1, "the front neither stopped nor left the track"
    times = np.array([t[0] if len(t) else np.nan for t in solution.t_events[2:]])
    speeds = np.array([y[0][1] if len(y) else 0.0 for y in solution.y_events[2:]])
    return TimeRun(float(solution.y[0, -1]), times, speeds)
