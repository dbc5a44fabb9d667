"""The dark counterpart of a colour: its lightness turned over, its hue kept, no contrast lost.

Colours are those of CSS, ``#rrggbb``. Lightness is that of Oklab (Ottosson, 2020): equal steps look equal.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from skred.arrays import FloatArray

PAPER, DARK_PAPER = "#ffffff", "#14171a"
"""What figures and pages stand on, in light and in dark."""
_ENOUGH = 4.6
"""Contrast that a dark counterpart keeps of what the light one has; 4.5 is asked of text (WCAG AA)."""
_BOLDER = 0.7
"""Below 1 what is pale stands out more on dark paper than on white, where eyes tell it apart less well."""
_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def contrast(one: str, other: str) -> float:
    """Contrast of two colours, 1 to 21, as WCAG 2 defines it."""
    high, low = sorted((_luminance(_linear(colour)) for colour in (one, other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@cache
def dark(colour: str) -> str:
    """What stands for a colour on dark paper.

    White becomes the dark paper and black nearly white. Where a colour would have less contrast against its
    paper than before, up to what text needs, it is made lighter.
    """
    lightness, *hue = _lab(_linear(colour))
    bottom, _, _ = _lab(_linear(DARK_PAPER))
    if lightness > 0.9995:
        return DARK_PAPER
    wanted = min(contrast(colour, PAPER), _ENOUGH)
    for turned in np.arange(bottom + (1.0 - lightness) ** _BOLDER * (0.97 - bottom), 1.0, 0.01):
        found = _hex(np.array([turned, *hue]))
        if contrast(found, DARK_PAPER) >= wanted:
            return found
    return "#ffffff"


def _linear(colour: str) -> FloatArray:
    """Linear red, green and blue of a colour, 0 to 1."""
    parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.asarray(np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4))


def _luminance(linear: FloatArray) -> float:
    return float(linear @ np.array([0.2126, 0.7152, 0.0722]))


def _lab(linear: FloatArray) -> FloatArray:
    return np.asarray(_TO_LAB @ np.cbrt(_TO_CONES @ linear))


def _hex(lab: FloatArray) -> str:
    """The colour closest to an Oklab one; paler where screens cannot show it."""
    for chroma in np.linspace(1.0, 0.0, 21):
        cones = np.linalg.solve(_TO_LAB, lab * np.array([1.0, chroma, chroma])) ** 3
        linear = np.linalg.solve(_TO_CONES, cones)
        if linear.min() > -0.005 and linear.max() < 1.005:
            break
    linear = np.clip(linear, 0.0, 1.0)
    parts = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in parts)
