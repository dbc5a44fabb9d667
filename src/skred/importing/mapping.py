"""The mapping file: what a person declared about a table, so that the next one imports without questions."""

import re
import shlex
import tomllib
from collections.abc import Mapping as Map
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from skred.campaign.cells import LARGEST_NUMBER
from skred.campaign.problems import shown
from skred.campaign.tables import MOST_ROWS
from skred.errors import InputError
from skred.importing.delimited import ENCODINGS
from skred.importing.sources import open_source
from skred.importing.units import OF_KIND

FILE = "import.toml"
"""The mapping file beside an imported campaign."""
LARGEST_BYTES = 200_000
_DEEP_KEY = re.compile(r"""(?:[\w"'-]{1,50}[ \t]*\.[ \t]*){50}""")

Place = Literal["s", "x", "altitude", "reference"]
"""Arc length, horizontal distance, elevation on the track, arc length from the reference."""
Finite = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0, le=LARGEST_NUMBER)]
Word = Annotated[str, Field(min_length=1, max_length=200)]
Silence = Literal["missing", "not_reached"]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class Describing(_Part):
    """Keys of campaign.toml that the files do not hold."""

    name: Word | None = None
    description: str | None = None
    source: str | None = None
    origin: Literal["measured", "simulated"] | None = None
    reference_s_m: Finite | None = None


class Writing(_Part):
    """How a table is written."""

    encoding: Literal[ENCODINGS] | None = None  # type: ignore[valid-type]
    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    thousands: Literal[".", ",", "'", " "] | None = None
    header_row: Annotated[int, Field(ge=1, le=MOST_ROWS)] | None = None

    @model_validator(mode="after")
    def _different(self) -> Self:
        if self.decimal is not None and self.decimal in (self.thousands, self.separator):
            if self.decimal == self.thousands:
                raise ValueError("decimal and thousands are the same sign")
        return self


class TableWriting(Writing):
    """How wide tables are written; of workbooks also which sheets are tables, ``*`` for all."""

    sheet: Word | Annotated[list[Word], Field(min_length=1)] | None = None

    @property
    def sheets(self) -> tuple[str, ...]:
        """The sheets that were named; empty where none was."""
        return (
            () if self.sheet is None else (self.sheet,) if isinstance(self.sheet, str) else tuple(self.sheet)
        )


class TrackWriting(Writing):
    """Where the track is, and how it is written."""

    sheet: Word | None = None
    file: Word | None = None
    x: Word | None = None
    z: Word | None = None


class Cells(_Part):
    """What cells without a number say of a velocity."""

    blank: Silence | None = None
    dash: Silence | None = None
    words: dict[Word, Silence] = Field(default_factory=dict)


class Velocity(_Part):
    """What holds for every velocity that does not say otherwise."""

    unit: Literal["m/s", "km/h"] | None = None
    place: Place | None = None
    relative_sd: NotNegative | None = None
    absolute_sd: NotNegative | None = None


class Runout(_Part):
    """What holds for every runout that does not say otherwise."""

    unit: Literal["m", "km"] | None = None
    place: Place | None = None
    bounds: Literal["runout", "altitude"] | None = None
    relative_sd: NotNegative | None = None
    absolute_sd: NotNegative | None = None


class Release(_Part):
    """Where avalanches start."""

    s_m: Finite | None = None
    place: Place | None = None


Kind = Literal["event", "release", "release_sd", "front_velocity", "runout", "sd", "covariate", "ignore"]
_KEYS: dict[str, frozenset[str]] = {
    "event": frozenset(),
    "release": frozenset({"place"}),
    "release_sd": frozenset(),
    "front_velocity": frozenset(
        {"sensor", "at", "from_", "to", "place", "place_sd_m", "unit", "bound", "relative_sd", "absolute_sd"}
    ),
    "runout": frozenset({"sensor", "place", "unit", "bound", "relative_sd", "absolute_sd"}),
    "sd": frozenset({"of", "unit"}),
    "covariate": frozenset({"name"}),
    "ignore": frozenset(),
}


class Column(_Part):
    """What one column of a wide table is.

    Attributes
    ----------
    is_ : str
        Its kind (``is`` in the file).
    sensor : str or None
        Id of the sensor; by default the column's name without its unit.
    at, from_, to : float or None
        Place of a point sensor, or of the two ends of a span, as `place` says, m.
    place : {"s", "x", "altitude", "reference"} or None
    place_sd_m : float or None
        How well the place is known, along the track, m.
    unit : {"m/s", "km/h", "m", "km"} or None
        Of a column of standard deviations: their own, which need not be that of the readings.
    bound : {"at_least", "at_most"} or None
        Where plain numbers of the column are bounds. Columns of one sensor make one reading together: two
        bounds an interval.
    relative_sd, absolute_sd : float or None
        Of a reading: a share of its value, and m/s or m along the track.
    of : str or None
        Of a column of standard deviations: the sensor.
    name : str or None
        Of a covariate: its name in events.csv, ending in a unit where it holds numbers.
    """

    is_: Annotated[Kind, Field(alias="is")]
    sensor: Word | None = None
    at: Finite | None = None
    from_: Annotated[Finite | None, Field(alias="from")] = None
    to: Finite | None = None
    place: Place | None = None
    place_sd_m: NotNegative | None = None
    unit: Literal["m/s", "km/h", "m", "km"] | None = None
    bound: Literal["at_least", "at_most"] | None = None
    relative_sd: NotNegative | None = None
    absolute_sd: NotNegative | None = None
    of: Word | None = None
    name: Word | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = self.model_fields_set - {"is_"}
        stray = sorted(one.rstrip("_") for one in given - _KEYS[self.is_])
        if stray:
            raise ValueError(f"a column that is '{self.is_}' has no {', '.join(stray)}")
        if self.is_ == "sd" and self.of is None:
            raise ValueError("a column of standard deviations needs 'of', the sensor's id")
        if self.at is not None and (self.from_ is not None or self.to is not None):
            raise ValueError("give either 'at' or 'from' and 'to'")
        if (self.from_ is None) != (self.to is None):
            raise ValueError("a span needs both 'from' and 'to'")
        units = OF_KIND.get(self.is_, ())
        if self.unit is not None and self.unit not in units:
            raise ValueError(f"the unit of '{self.is_}' is one of {', '.join(units)}")
        return self


class OneTable(Writing):
    """What one of several wide tables has otherwise: how it is written, and what its columns are."""

    columns: dict[str, Column] = Field(default_factory=dict)


class Mapping(_Part):
    """Everything that can be declared about the tables of an import."""

    format: Literal[1] = 1
    campaign: Describing = Field(default_factory=Describing)
    table: TableWriting = Field(default_factory=TableWriting)
    tables: dict[str, OneTable] = Field(default_factory=dict)
    track: TrackWriting = Field(default_factory=TrackWriting)
    cells: Cells = Field(default_factory=Cells)
    velocity: Velocity = Field(default_factory=Velocity)
    runout: Runout = Field(default_factory=Runout)
    release: Release = Field(default_factory=Release)
    columns: dict[str, Column] = Field(default_factory=dict)

    def with_values(self, values: Map[tuple[str, ...], Any]) -> "Mapping":
        """The mapping with some keys declared, or declared otherwise.

        Parameters
        ----------
        values : mapping
            From keys, such as ``("cells", "blank")``, to values. A column's may be text,
            ``front_velocity at=1650 unit=km/h``.

        Raises
        ------
        InputError
            If a key or its value is not known.
        """
        content = self.content()
        for key, value in values.items():
            place = content
            for part in key[:-1]:
                place = place.setdefault(part, {})
                if not isinstance(place, dict):
                    raise InputError(f"--set {'.'.join(key)}: no such key")
            place[key[-1]] = meaning(key[-1], value) if "columns" in key[:-1] else value
        return _validated(content, "the options")

    def writing(self, table: str) -> Writing:
        """How a wide table is written: as all are, but for what is declared of this one."""
        own = self.tables.get(table, OneTable()).model_dump(exclude_none=True, exclude={"columns"})
        return self.table.model_copy(update=own)

    def columns_of(self, table: str) -> dict[str, Column]:
        """What is declared of the columns of a wide table."""
        return {**self.columns, **self.tables.get(table, OneTable()).columns}

    def content(self) -> dict[str, Any]:
        """What is declared, as a mapping file holds it."""
        return self.model_dump(by_alias=True, exclude_none=True, exclude_defaults=True)


def meaning(column: str, value: Any) -> Any:
    """A column's meaning from words: its kind, then ``key=value`` as often as needed.

    Raises
    ------
    InputError
        If the words are of another form.
    """
    if not isinstance(value, str):
        return value
    form = "expected a kind and key=value, such as 'front_velocity at=1650 unit=km/h'"
    try:
        kind, *rest = shlex.split(value)
    except ValueError:
        raise InputError(f"column '{shown(column)}', '{shown(value)}': {form}") from None
    if not all("=" in word for word in rest):
        raise InputError(f"column '{shown(column)}', '{shown(value)}': {form}")
    return {"is": kind, **dict(word.split("=", 1) for word in rest)}


def read_mapping(file: Path) -> Mapping:
    """Read a mapping file.

    Raises
    ------
    CampaignError, InputError
        If it cannot be read, is not TOML, or holds keys or values that are not known; names them.
    """
    source = open_source(file)
    try:
        text = source.content.decode("utf-8-sig")
        if len(text) > LARGEST_BYTES or _DEEP_KEY.search(text):
            raise ValueError("longer or deeper than a mapping file is")
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{source.name}: not a mapping file ({shown(str(error), 200)}); correct it"
        ) from None
    return _validated(content, source.name)


def _validated(content: dict[str, Any], where: str) -> Mapping:
    """Check keys and values."""
    try:
        return Mapping.model_validate(content)
    except ValidationError as error:
        raise InputError("\n".join(_told(details, where) for details in error.errors())) from None


def _told(details: Any, where: str) -> str:
    """What pydantic found, in one line."""
    key = shown(".".join(str(part) for part in details["loc"]), 200)
    if details["type"] == "extra_forbidden":
        return f"{where}, key {key}: no such key; correct its name or remove it"
    found = details["input"]
    told = "" if isinstance(found, dict) else f"found '{shown(str(found))}': "
    message = str(details["msg"]).removeprefix("Value error, ")
    return f"{where}, key {key}: {told}{message[:1].lower()}{message[1:]}; correct it"


def split_column(text: str, names: Sequence[str]) -> tuple[str, str]:
    """A ``NAME=MEANING`` of the command line, for names that may themselves hold an equals sign.

    Raises
    ------
    InputError
        If no column has that name.
    """
    fitting = [name for name in names if text.startswith(f"{name}=")]
    if not fitting:
        listed = ", ".join(f"'{shown(name)}'" for name in names)
        raise InputError(f"--column '{shown(text)}': no column of that name; there are: {listed}")
    name = max(fitting, key=len)
    return name, text[len(name) + 1 :]
