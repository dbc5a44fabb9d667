"""What is expected of a diagnosis: ceilings, classes that cannot be told apart, acceptance criteria.

Ceilings come from linearised design calculations with one true mechanism among 18 and perfect knowledge of
the models; classes are pairs and triples that no estimator separates by more than 2 nats. Both are stated
in advance, in the project's method document (sections 4 and 5.9), and are used nowhere but in scores.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Ceilings = Mapping[str, tuple[float, ...]]
CEILING_SNR = (4.0, 5.0, 7.0, 10.0)
RIGHT_NAME_CEILING = {"sparse": (0.61, 0.69, 0.80, 0.90), "dense": (0.79, 0.87, 0.94, 0.98)}
"""Highest share of right first names at `CEILING_SNR`."""
NAMED_CEILING = {"sparse": (0.15, 0.30, 0.49, 0.71), "dense": (0.32, 0.57, 0.82, 0.91)}
"""Highest share named with a probability of 0.9, at `CEILING_SNR`."""
DETECTION_LIMIT = 2.85
"""Score that one of 18 candidates passes in 1 % of clean campaigns: detection is at most Phi(snr - this)."""

FALSE_ALARM_CRITERIA = {"all": 0.05, "plain": 0.05, "nasty": 0.10}
"""Highest one-sided upper limits of false alarms."""
DETECTION_CRITERIA = {"5.5": 0.85, "7": 0.95}
"""Least detection by signal-to-noise."""
NAMING_CRITERIA = {"dense": (0.80, 0.95), "sparse": (0.65, 0.90)}
"""Least shares of right first names and of right tie sets at a signal-to-noise of 7."""
PLACE_CRITERION_M = 50.0
"""Highest median place error on dense trials."""

SNR_BINS = ((2.0, 4.0), (4.0, 5.5), (5.5, 7.0), (7.0, 9.0), (9.0, 13.0))
AROUND_7 = (6.0, 8.5)
"""Signal-to-noise that counts as 7 in the acceptance criteria."""
AROUND_10 = (8.5, 13.0)
"""Signal-to-noise that counts as 10 in the acceptance criteria."""
SHORT_M = 100.0
"""Longest stretch of drag [m] that cannot be told from an obstacle."""
LIMIT_S = {"sparse": 60.0, "dense": 120.0}
"""Wall time in which a verdict is wanted."""
CPU_LIMIT_S = {"sparse": 30.0, "dense": 60.0}
"""CPU time that a trial may cost."""
IDENTIFY_LIMIT_S = 10.0
LOG_SCORE_FLOOR = 1e-3
"""Least probability that a log score charges for: one trial costs 6.9 nats at most."""
NEAR_M = 100.0
"""How far from the true place a force not in the list may be put."""
CREDIBLE = 1.6449
"""Half of a 90 % interval in standard deviations."""


@dataclass(frozen=True)
class Tie:
    """Mechanisms that recordings cannot tell apart.

    Attributes
    ----------
    ids : tuple of str
    same_stretch : bool
        Only where the stated stretch overlaps the true one.
    short_m : float or None
        Stretches of drag belong only up to this length.
    kind : str or None
        Only in trials of this kind.
    """

    ids: tuple[str, ...]
    same_stretch: bool = False
    short_m: float | None = None
    kind: str | None = None


TIES = (
    Tie(("segment_drag", "segment_friction", "entrainment"), same_stretch=True),
    Tie(("viscous_drag", "turbulent_drag")),
    Tie(("obstacle", "segment_drag", "sensor_bias"), short_m=SHORT_M),
    Tie(("release_offset", "centrifugal"), kind="sparse"),
)
"""Permanent ties, method document section 5.9. Whether a biased sensor's span holds the obstacle is not
checked: neither truth nor verdict says where a sensor stands."""

STRENGTHS = {
    "coulomb_friction": ("mu", "dry_friction"),
    "centrifugal": ("mu", "centrifugal_friction"),
    "turbulent_drag": ("D", "turbulent_drag"),
    "viscous_drag": ("c", "viscous_drag"),
    "constant_retardation": ("b", "retardation"),
    "velocity_weakening": ("mu_s", "weakening_friction"),
    "obstacle": ("height", "obstacle_height"),
    "segment_drag": ("D_f", "segment_drag"),
    "segment_friction": ("b_f", "segment_friction"),
    "entrainment": ("growth", "entrainment_rate"),
    "covariate_friction": ("log friction per standard deviation", "covariate_effect"),
    "sensor_bias": ("log factor", "log_sensor_factor"),
    "release_offset": ("offset", "release_offset"),
    "sensor_place": ("shift", "sensor_shift"),
}
"""The truth's word for a strength and the verdict's, where both mean the same quantity."""


def ceiling(table: Ceilings, kind: str, snr: float) -> float | None:
    """A ceiling at a signal-to-noise; None below 4, where none was calculated; that of 10 above it."""
    if kind not in table or snr < CEILING_SNR[0]:
        return None
    return float(np.interp(snr, CEILING_SNR, table[kind]))


def class_of(name: str) -> str:
    """The class an id is shown under: the first tie that holds it, else itself.

    An obstacle's class takes no stretch of drag here, whatever its length: each id has one class.
    """
    taken: set[str] = set()
    for tie in TIES:
        members = [one for one in tie.ids if one not in taken]
        if name in members:
            return " / ".join(members)
        taken |= set(members)
    return name


def as_plain() -> dict[str, Any]:
    """These standards as plain data, for the scorecard."""
    return {
        "snr_bins": SNR_BINS,
        "snr_around_7": AROUND_7,
        "snr_around_10": AROUND_10,
        "ceiling_snr": CEILING_SNR,
        "ceiling_right_first_name": RIGHT_NAME_CEILING,
        "ceiling_named_at_probability_0_9": NAMED_CEILING,
        "permanent_ties": [
            {
                "ids": tie.ids,
                "same_stretch": tie.same_stretch,
                "drag_at_most_m": tie.short_m,
                "only_kind": tie.kind,
            }
            for tie in TIES
        ],
        "detection_limit_score": DETECTION_LIMIT,
        "bars_false_alarms": FALSE_ALARM_CRITERIA,
        "bars_detection": DETECTION_CRITERIA,
        "bars_naming": NAMING_CRITERIA,
        "bar_place_m": PLACE_CRITERION_M,
        "wall_limit_seconds": LIMIT_S,
        "cpu_limit_seconds": CPU_LIMIT_S,
        "log_score_floor_probability": LOG_SCORE_FLOOR,
        "unlisted_place_within_m": NEAR_M,
    }
