"""``skred track``: a track from a terrain model and a line.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, Quiet
from skred.cli.output import show_table, write_json
from skred.errors import InputError

Dem = Annotated[Path | None, Parameter(help="Terrain model: a GeoTIFF, or an ESRI ASCII grid (.asc).")]
Line = Annotated[
    Path | None,
    Parameter(help="Line along the track: .shp, .geojson, .gpkg or .gpx; turned where it goes uphill."),
]
Avaframe = Annotated[
    Path | None,
    Parameter(
        help="An Inputs folder of AvaFrame, for terrain model, line and release areas; --dem or --line wins."
    ),
]
Table = Annotated[
    Path, Parameter(help="The table to write, such as track.csv; a .json and a .png are written beside it.")
]
Layer = Annotated[str | None, Parameter(help="Layer of the line's file, where several hold lines.")]
FeatureName = Annotated[str | None, Parameter(help="Number or name of the line, where there are several.")]
Crs = Annotated[
    str | None, Parameter(help="Reference system of the terrain, where its file has none: EPSG:32632.")
]
Step = Annotated[
    float | None,
    Parameter(
        validator=validators.Number(gte=0.1, lte=1000.0),
        help="Horizontal distance of the track's points, m; by default the side of a cell.",
    ),
]
WrittenSmoothing = Annotated[
    float,
    Parameter(
        validator=validators.Number(gte=0.0, lte=1000.0),
        help="Smoothing length of what is written, m; commands that read it smooth by 10 m once more.",
    ),
]
Extend = Annotated[
    float,
    Parameter(
        validator=validators.Number(gte=0.0, lte=20_000.0),
        help="Horizontal length to go on along the fall line from the end of the line, m.",
    ),
]
Replace = Annotated[bool, Parameter(name="--force", negative="", help="Replace files that are there.")]


def track(
    *,
    out: Table,
    dem: Dem = None,
    line: Line = None,
    avaframe: Avaframe = None,
    layer: Layer = None,
    feature: FeatureName = None,
    crs: Crs = None,
    step: Step = None,
    smoothing: WrittenSmoothing = 5.0,
    extend: Extend = 0.0,
    force: Replace = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make a track from a terrain model and a line on the map."""
    from skred.extras import require
    from skred.tracks.avaframe import find_inputs
    from skred.tracks.files import require_free

    require_free(out, force=force)
    releases: tuple[Path, ...] = ()
    if avaframe is not None:
        found = find_inputs(avaframe, dem, line)
        dem, line, releases = found.dem, found.line, found.releases
    if dem is None or line is None:
        raise InputError(
            "expected --dem with a terrain model and --line with a line, or --avaframe with a folder"
        )
    require("gis")

    from skred.tracks.build import Wanted, make_track

    wanted = Wanted(dem, line, layer, feature, crs, step, smoothing, extend, releases)
    document = make_track(wanted)
    _write(document, out, force)
    _show(document, out, as_json=as_json, quiet=quiet)
    return DONE


def _write(document: dict[str, object], out: Path, force: bool) -> None:
    """Write table, document and figure."""
    from skred.output import write_json as write_document
    from skred.output import write_text
    from skred.report.shared.style import write_png
    from skred.report.track.figures import track_figure
    from skred.tracks.files import track_files, track_table

    with track_files(out, force=force) as file:
        write_text(file, track_table(document))
        write_document(file.with_suffix(".json"), document)
        write_png(track_figure(document), file.with_suffix(".png"))


def _show(document: dict[str, object], out: Path, *, as_json: bool, quiet: bool) -> None:
    """Tell what was made; the points are in the files."""
    from skred.report.track.figures import track_shape_table
    from skred.tracks.statement import track_statement

    if as_json:
        write_json({name: value for name, value in document.items() if name != "profile"})
    elif not quiet:
        show_table(track_shape_table(document), track_statement(document), out)
