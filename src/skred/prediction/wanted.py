"""What an engineer asks of a prediction: named places, thresholds, impact pressure, and how often.

Impact pressure is p = 0.5 C_d rho U^2 with the density rho of the flow and the drag coefficient C_d of the
obstacle. The recordings know neither, so both are ranges with the same probability everywhere in them. The
density differs from avalanche to avalanche; the drag coefficient is the obstacle's, one unknown number.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import gamma

from skred.arrays import FloatArray
from skred.errors import InputError

DENSITY_KG_M3 = (100.0, 300.0)
"""Range of the density of flowing dry snow: from the denser fluidised fronts to a dense core."""
DRAG_COEFFICIENT = (1.0, 2.0)
"""Range of the drag coefficient: an assumption, about from a round body across a flow to a flat one."""
FORMULA = "p = 0.5 C_d rho U^2"
SOURCES = (
    "Formula: the drag equation of fluid mechanics.",
    "Measured pressures and speeds: McClung and Schaerer (1985), Characteristics of flowing snow and"
    " avalanche impact pressures, Annals of Glaciology. Small load cells read more than a large plate.",
    "Density: 35 to 100 kg/m3 in the fluidised layer, Issler, Gauer, Schaer and Keller (2020), Inferences on"
    " mixed snow avalanches from field observations, Geosciences 10(1), 2, doi 10.3390/geosciences10010002;"
    " about 300 kg/m3 in a dense core, Johannesson, Gauer, Issler and Lied, eds (2009), The design of"
    " avalanche protection dams, European Commission, EUR 23339.",
    "Drag coefficient: an assumption without a source in avalanches: about that of a round to that of a flat"
    " body across a flow.",
    "Slow wet snow presses considerably more on a mast than such formulas say, and not by its speed: Sovilla,"
    " Kern and Schaer (2010), Slow drag in wet-snow avalanche flow, Journal of Glaciology, doi"
    " 10.3189/002214310793146287.",
)
_KPA = 1e-3
MOST_PLACES = 20
AVALANCHES = 1024
"""Of each population, simulated."""
_FEWEST_BEYOND = 3
"""Of these, those that must do what a return period is told of: run farther, or be faster."""
_NAME = re.compile(r"\w[\w .-]{0,39}")
_LONGEST_YEARS = 100_000.0
_LARGEST_DENSITY, _LARGEST_DRAG, _LARGEST_RATE, _LARGEST = 917.0, 20.0, 1000.0, 1e5


@dataclass(frozen=True)
class Rate:
    """How often avalanches like those recorded start on the track, per year.

    Attributes
    ----------
    mean, sd : float, 1/year
        A gamma distribution; without an sd the rate is exact.
    """

    mean: float
    sd: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no rate."""
        if not 0.0 < self.mean <= _LARGEST_RATE:
            raise InputError(f"--per-year {self.mean:g}: expected above 0, at most {_LARGEST_RATE:g} a year")
        if not 0.0 <= self.sd <= 10.0 * self.mean:
            raise InputError(
                f"--per-year {self.mean:g},{self.sd:g}: expected an SD from 0 to 10 times the rate"
            )

    def drawn(self, uniform: FloatArray) -> FloatArray:
        """Rates from uniform numbers."""
        if self.sd == 0.0:
            return np.full(len(uniform), self.mean)
        shape = (self.mean / self.sd) ** 2
        return np.asarray(gamma.ppf(uniform, shape, scale=self.mean / shape))


@dataclass(frozen=True)
class Wanted:
    """Named places, thresholds and frequency.

    Attributes
    ----------
    places : tuple of (str, float)
        Names with arc lengths [m]; empty for the campaign's own sensors of speed and its reference.
    speeds_m_s, pressures_kpa : tuple of float
        Thresholds whose probability of exceedance is wanted.
    density_kg_m3, drag_coefficient : (float, float)
        Lowest and highest; in between all are as likely.
    rate : Rate or None
    return_periods_years : tuple of float
        Times in which a runout is reached once on average; they need a rate.
    """

    places: tuple[tuple[str, float], ...] = ()
    speeds_m_s: tuple[float, ...] = (10.0, 20.0, 30.0)
    pressures_kpa: tuple[float, ...] = ()
    density_kg_m3: tuple[float, float] = DENSITY_KG_M3
    drag_coefficient: tuple[float, float] = DRAG_COEFFICIENT
    rate: Rate | None = field(default=None)
    return_periods_years: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        names = [name for name, _ in self.places]
        for name in names:
            if not _NAME.fullmatch(name):
                raise InputError(
                    f"--at {name[:60]!r}: expected a name of at most 40 letters, digits, spaces, dots, dashes"
                )
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"--at {twice[0]}: given twice; each place needs a name of its own")
        if len(names) > MOST_PLACES:
            raise InputError(f"--at: at most {MOST_PLACES} places, found {len(names)}")
        for option, values in (("--speed", self.speeds_m_s), ("--pressure", self.pressures_kpa)):
            for value in values:
                if not 0.0 <= value <= _LARGEST:
                    raise InputError(f"{option} {value:g}: expected a number from 0 to {_LARGEST:g}")
        self._check_periods()
        _check_range("--density", self.density_kg_m3, _LARGEST_DENSITY)
        _check_range("--drag-coefficient", self.drag_coefficient, _LARGEST_DRAG)

    def _check_periods(self) -> None:
        """Refuse times that are none, and times without a frequency."""
        for years in self.return_periods_years:
            if not 0.0 < years <= _LONGEST_YEARS:
                raise InputError(
                    f"--return-period {years:g}: expected years, above 0 and at most {_LONGEST_YEARS:g}"
                )
        if self.return_periods_years and self.rate is None:
            raise InputError("--return-period: needs --per-year, how often avalanches start")
        if len(self.return_periods_years) > MOST_PLACES:
            raise InputError(
                f"--return-period: at most {MOST_PLACES}, found {len(self.return_periods_years)}"
            )

    def check_on(
        self, length_m: float, avalanches: int = AVALANCHES, *, highest_release_m: float = 0.0
    ) -> None:
        """Refuse places that no avalanche can come to, and return periods that a simulation cannot tell.

        Raises
        ------
        InputError
            If a place lies outside the track or above every release, or a time is too long.
        """
        for name, s_m in self.places:
            if not 0.0 <= s_m <= length_m:
                raise InputError(f"--at {name}={s_m:g}: expected a place on the track, 0 to {length_m:.1f} m")
            if s_m < highest_release_m:
                raise InputError(
                    f"--at {name}={s_m:g}: lies above every release, of which the highest is at"
                    f" s = {highest_release_m:.1f} m; no avalanche comes there: choose a place further down,"
                    " or a --release above it (s counts from the first point of the track, downhill)"
                )
        rarest = max(self.return_periods_years, default=0.0)
        if self.rate is not None and rarest > (longest := longest_years(self.rate.mean, avalanches)):
            raise InputError(
                f"--return-period {rarest:g}: with {self.rate.mean:g} avalanches a year, such runouts are"
                f" rarer than the simulation can tell; at most {longest:.0f} years"
            )

    def as_dict(self) -> dict[str, Any]:
        """What was asked for besides places, as plain data."""
        rate = None
        if self.rate is not None:
            kind = "gamma" if self.rate.sd else "exact"
            rate = {"per_year": self.rate.mean, "sd_per_year": self.rate.sd, "distribution": kind}
        return {
            "pressure": {
                "formula": FORMULA,
                "density_kg_m3": list(self.density_kg_m3),
                "drag_coefficient": list(self.drag_coefficient),
                "distribution": "uniform over each range",
                "sources": list(SOURCES),
            },
            "rate": rate,
        }


def longest_years(per_year: float, avalanches: int) -> float:
    """The longest return period [years] that a simulation of so many avalanches of a population can tell."""
    return avalanches / (_FEWEST_BEYOND * per_year)


def _check_range(option: str, limits: tuple[float, float], largest: float) -> None:
    low, high = limits
    if not 0.0 < low <= high <= largest:
        raise InputError(f"{option} {low:g},{high:g}: expected LOW,HIGH, 0 < LOW <= HIGH <= {largest:g}")


def impact_pressure_kpa(speed_m_s: Any, density_kg_m3: Any, drag_coefficient: Any) -> Any:
    """Impact pressure [kPa] p = 0.5 C_d rho U^2 of snow on an obstacle, the drag equation.

    Parameters
    ----------
    speed_m_s, density_kg_m3, drag_coefficient : float or array
    """
    return _KPA * 0.5 * drag_coefficient * density_kg_m3 * np.square(speed_m_s)


def numbers_of(option: str, text: str, most: int) -> tuple[float, ...]:
    """Numbers separated by commas, as many as there may be.

    Raises
    ------
    InputError
        If they are not finite numbers, or too many.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if not 1 <= len(values) <= most or not all(math.isfinite(value) for value in values):
        raise InputError(
            f"{option} {text[:60]}: expected {'a number, or two with a comma' if most == 2 else 'a number'}"
        )
    return values


def place_of(text: str) -> tuple[str, float]:
    """Name and place [m] of ``NAME=S``.

    Raises
    ------
    InputError
        If it is something else.
    """
    name, equals, place = text.rpartition("=")
    if not equals or not name.strip():
        raise InputError(f"--at {text[:60]}: expected NAME=S, as house=1830: a name and its place in m")
    return name.strip(), numbers_of(f"--at {name.strip()[:40]}:", place, 1)[0]


def release_of(text: str) -> tuple[float, float]:
    """Place [m] and weight of ``S`` or ``S:WEIGHT``.

    Raises
    ------
    InputError
        If it is something else.
    """
    place, colon, weight = text.partition(":")
    try:
        return float(place), float(weight) if colon else 1.0
    except ValueError:
        raise InputError(f"--release {text[:60]}: expected S or S:WEIGHT, as 120 or 120:2 (m)") from None
