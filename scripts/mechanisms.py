"""Write docs/mechanisms.md: every mechanism that is built in, as ``skred mechanisms ID`` shows it.

``python scripts/mechanisms.py``.
"""

from __future__ import annotations

from pathlib import Path

from skred.physics.laws import installed_laws
from skred.physics.mechanisms.entrainment import DOUBLED
from skred.physics.mechanisms.library import built_in
from skred.physics.mechanisms.obstacle import COSTS, HALF_WIDTH_M, LOSS
from skred.report.mechanisms import mechanism_document, mechanism_rows
from skred.report.shared.labels import unit_text

PAGE = Path(__file__).resolve().parent.parent / "docs" / "mechanisms.md"
HEAD = """# The mechanisms

What `skred diagnose` can name, written by `python scripts/mechanisms.py` from the library. `skred
mechanisms ID` shows the same in the terminal, with mechanisms of [your own](own-mechanism.md) beside
them.

A front of speed U at place s obeys dU²/(2 ds) = g sin(phi) plus the terms of the base law plus the term
of the mechanism. phi is the angle by which the track falls, positive downhill; kappa = -d(phi)/ds is
positive where the track is concave; s grows downhill. What a mechanism adds is *beside* the terms of the
base law and not in their place: with mu in the base law, friction that falls with speed is mu + mu_s at
rest and mu at high speed.

- **`obstacle`**: *climb* is 1 over the w = {width:.0f} m above its crown s_o, *descent* over the
  {width:.0f} m below it, both 0 elsewhere. A front that passes gets back what the climb took, and its U²
  is multiplied by exp(-l h), with l = {losses} 1/m; or it gets nothing back, and every front loses
  J = g h. h is the coefficient in all of them.
- **`entrainment`**: e is the growth of the mass with the way, (1/m)(dm/ds), at the beginning of the
  stretch. Where it is constant the term is that of `segment_drag`. Where every metre adds as much snow,
  it falls with m_1/m, and the mass doubles over the stretch (m_2/m_1 = {growth:g}).
- **`covariate_friction`**: x is standardised over the campaign's avalanches (mean 0, sd 1), so beta is
  the logarithm of a factor on mu per standard deviation: 0.1 is 11 % more. Where the law has no mu it is
  a factor on b.
- **`sensor_bias`**: a is the logarithm of a factor as well. **`release_offset`** and **`sensor_place`**: a
  positive r or d_s is further down the track.

| id | what it is | adds | coefficient |
| --- | --- | --- | --- |
"""


def page() -> str:
    """The page's text."""
    laws, _ = installed_laws()
    documents = [mechanism_document(one, laws) for one in built_in().values()]
    documents.sort(key=lambda one: (one["group"] == "instrument", one["id"]))
    losses = " or ".join(f"{cost:g}" for name, cost in COSTS if name == LOSS)
    text = HEAD.format(width=HALF_WIDTH_M, losses=losses, growth=DOUBLED)
    for one in documents:
        strength = one["strength"]
        symbol = f"{strength['symbol']} [{unit_text(strength['unit'])}]"
        text += f"| [`{one['id']}`](#{one['id']}) | {one['title']} | {_cell(one['equation'])} | {symbol} |\n"
    for one in documents:
        text += f"\n## {one['id']}\n\n{one['title'][0].upper()}{one['title'][1:]}.\n\n| | |\n| --- | --- |\n"
        rows = mechanism_rows(one, len(laws))
        text += "".join(f"| {name} | {_cell(words)} |\n" for name, words in rows.items() if name != "package")
    return text


def _cell(words: str) -> str:
    return words.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
