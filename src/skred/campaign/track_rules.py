"""The rules of a track by itself: enough points, downhill, and ground that there is on Earth."""

from collections.abc import Sequence
from math import atan2, degrees, hypot

from skred.campaign.problems import Problem
from skred.campaign.tables import Row

TRACK = "track.csv"
FEWEST_TRACK_POINTS = 3
LOWEST_M, HIGHEST_M = -500.0, 9000.0
"""Between which heights tracks lie: below the shore of the Dead Sea, and above Mount Everest, is no slope."""
STEEPEST_DEG = 80.0
"""Steepest stretch between neighbouring points that is read: steeper ones are slips, or falls."""
_ROUNDED_DEG = 0.05
"""How much steeper a stretch of 80 degrees may come out where coordinates are rounded."""


def track_problems(rows: Sequence[Row], *, may_be_level: bool = False) -> list[Problem]:
    """Check that a track has enough points, in downhill order; a level one moves no front from rest."""
    if len(rows) < FEWEST_TRACK_POINTS:
        message = f"the track has {len(rows)} points; give at least {FEWEST_TRACK_POINTS}"
        return [Problem(TRACK, None, None, None, message)]
    problems = [problem for row in rows for problem in _height_problems(row)]
    wrong = {problem.row for problem in problems}
    points = [row for row in rows if row.has("x_m", "z_m")]
    s_m = 0.0
    for before, row in zip(points, points[1:], strict=False):
        step = row.number("x_m") - before.number("x_m"), row.number("z_m") - before.number("z_m")
        if step[0] <= 0 or s_m + hypot(*step) == s_m:
            message = (
                f"x_m must be greater than in row {before.line} ({before.number('x_m'):g}); "
                "order the points downhill and remove those that appear twice"
            )
            problems.append(_at(row, "x_m", message))
        elif not wrong & {before.line, row.line}:
            problems += _jump_problems(before, row, *step)
        s_m += hypot(*step)
    fall = points[0].number("z_m") - points[-1].number("z_m") if points else 1.0
    if not wrong & {point.line for point in points} and (fall < 0 or (fall == 0 and not may_be_level)):
        start = f"{points[0].number('z_m'):g} m"
        message = f"the track ends no lower than it starts ({start}); order the points downhill"
        problems.append(_at(points[-1], "z_m", message))
    return problems


def _height_problems(row: Row) -> list[Problem]:
    """Check that a point lies where there is ground."""
    if not row.has("z_m") or LOWEST_M <= row.number("z_m") <= HIGHEST_M:
        return []
    message = f"expected an elevation of {LOWEST_M:g} to {HIGHEST_M:g} m; correct it, or write it in metres"
    return [_at(row, "z_m", message)]


def _jump_problems(before: Row, row: Row, dx_m: float, dz_m: float) -> list[Problem]:
    """Check that a stretch is one that a front can follow."""
    steep = degrees(atan2(abs(dz_m), dx_m))
    if steep <= STEEPEST_DEG + _ROUNDED_DEG:
        return []
    way = "rises" if dz_m > 0 else "falls"
    message = (
        f"the track {way} {abs(dz_m):.4g} m over {dx_m:.4g} m from row {before.line}, at {steep:.1f} degrees;"
        f" expected at most {STEEPEST_DEG:g}: correct a height or a distance, or leave the point out"
    )
    return [_at(row, "z_m", message)]


def _at(row: Row, column: str, message: str) -> Problem:
    """Return a problem with a cell that could be read."""
    return Problem(TRACK, row.line, column, repr(row.number(column)), message)
