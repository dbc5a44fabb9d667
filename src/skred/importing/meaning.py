"""What the name of a column says. Only what can hardly be meant otherwise; the rest is asked about."""

import re
from collections.abc import Iterable

from skred.campaign.cells import LONGEST_WORD, has_unit
from skred.importing.mapping import Column
from skred.importing.units import METRES, base_and_unit, unit_of

_COVARIATE_UNITS = {
    "m3": "m3", "m³": "m3", "m^3": "m3", "m2": "m2", "m²": "m2", "m": "m", "km": "km", "cm": "cm", "mm": "mm",
    "°c": "degC", "degc": "degC", "° c": "degC", "c": "degC", "%": "percent", "kg/m3": "kg_m3",
    "kg/m³": "kg_m3", "kg m-3": "kg_m3", "kpa": "kPa", "pa": "Pa", "°": "deg", "h": "h", "s": "s",
    "kg": "kg",
}  # fmt: skip
_EVENT = (
    "event",
    "avalanche",
    "avalanche id",
    "event id",
    "id",
    "date",
    "lawine",
    "ereignis",
    "datum",
    "dato",
)
_WHERE = (
    r"(?:[ -]?(?:altitude|elevation|height|distance|length|position|point|place|höhe|länge|strecke|weite)"
    rf"|[ -](?:s|x|z|horizontal|along|track|from|reference|min|max|{METRES}))"
)
"""One more word on how a place is given."""
_RUNOUT = re.compile(rf"(?:run[- ]?out|auslauf|stopp?(?:ed)?(?: at)?|utløp|arr[eê]t){_WHERE}*", re.IGNORECASE)
_RELEASE = re.compile(r"release|anriss|start(ing)?( point)?|d[eé]part|utløsning", re.IGNORECASE)
_BOUND_WORDS = {
    "at_least": re.compile(r"[\s_]*(at least|at_least|>=|≥|mindestens|minst)[\s_]*", re.IGNORECASE),
    "at_most": re.compile(r"[\s_]*(at most|at_most|<=|≤|höchstens)[\s_]*", re.IGNORECASE),
}
"""Only what can be nothing but a bound: "max runout" mostly is the runout itself."""
_ALTITUDE = re.compile(r"altitude|elevation|height|m ?a\.? ?s\.? ?l\.?|masl|höhe|h\.? ?ü\.? ?m\.?|moh", re.I)
_SD = re.compile(r"(?:sd|σ|std|sigma)[\s_]+(?P<a>.+)|(?P<b>.+?)[\s_]+(?:sd|σ|std|sigma)", re.IGNORECASE)


def recognised(name: str, cells: Iterable[str], sensors: Iterable[str] = ()) -> Column | None:
    """What a column probably is, by its name; None where that is not clear.

    Parameters
    ----------
    name : str
    cells : iterable of str
        Only used to tell a covariate of words from one of numbers.
    sensors : iterable of str
        Ids that a column of standard deviations may name.
    """
    base, unit = base_and_unit(name)
    word = base.casefold().replace("_", " ")
    if word in _EVENT:
        return Column(is_="event")
    for_sensor = _SD.fullmatch(base)
    if for_sensor is not None:
        of = for_sensor.group("a") or for_sensor.group("b")
        known = {sensor.casefold(): sensor for sensor in sensors}
        if of.casefold() in known:
            return Column(is_="sd", of=known[of.casefold()])
    speed = unit_of("front_velocity", name)
    if speed:
        return Column.model_validate({"is": "front_velocity", "sensor": base, "unit": speed})
    place = place_in(name)
    if name in ("release_s_m", "release_sd_m"):
        return Column.model_validate(
            {"is": "release", "place": "s"} if name[8:] == "s_m" else {"is": "release_sd"}
        )
    if (
        _RELEASE.match(word)
        and not has_unit(name.removesuffix("_m"))
        and unit.casefold() in ("", "m", "m a.s.l.")
    ):
        if re.fullmatch(rf"({_RELEASE.pattern})([ _](s|x|z|m|altitude|elevation|höhe))*", word, re.I):
            return Column.model_validate({"is": "release"} | place)
    bound = next((key for key, words in _BOUND_WORDS.items() if words.search(base)), None)
    if _RUNOUT.fullmatch(word if bound is None else _BOUND_WORDS[bound].sub(" ", word).strip()):
        extra = {"bound": bound} if bound else {}
        return Column.model_validate({"is": "runout", "sensor": "runout"} | place | extra)
    return _covariate(name, base, unit, cells)


def says_where(words: str) -> bool:
    """Whether words behind a sensor's id, the blank before them included, only say how its place is given."""
    return re.fullmatch(f"{_WHERE}+", words, re.IGNORECASE) is not None


def place_in(name: str) -> dict[str, str]:
    """How a name says that its places are given, as ``{"place": ...}``; empty where it does not."""
    if _ALTITUDE.search(name) or re.search(r"[_ ]z([_ \[(]|$)", name):
        return {"place": "altitude"}
    if re.search(r"[_ ]s([_ \[(]|$)", name):
        return {"place": "s"}
    if re.search(r"[_ ]x([_ \[(]|$)|horizontal", name):
        return {"place": "x"}
    return {}


def _covariate(name: str, base: str, unit: str, cells: Iterable[str]) -> Column | None:
    """A property of the avalanche, where its name has a unit or its cells are words."""
    known = _COVARIATE_UNITS.get(unit.casefold())
    if has_unit(name):
        new = name
    elif known is not None:
        new = f"{_plain(base)}_{known}"
    elif unit == "" and not any(map(_is_like_a_number, cells)) and not has_unit(_plain(name)):
        new = _plain(name)
    else:
        return None
    # With its unit in words, a name can become longer than one may be: then a person gives it another.
    return Column(is_="covariate", name=new) if len(new) <= LONGEST_WORD else None


def _is_like_a_number(text: str) -> bool:
    """Whether a cell holds digits and no letters."""
    return any(one.isdigit() for one in text) and not any(one.isalpha() for one in text)


def _plain(name: str) -> str:
    """A name as the format's columns have theirs: small letters and underscores."""
    return re.sub(r"\W+", "_", name.strip().lower()).strip("_") or "covariate"
