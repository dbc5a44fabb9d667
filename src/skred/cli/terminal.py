"""Text for terminals that cannot write all characters."""

import codecs
import io
import unicodedata
from typing import TextIO

_PLAIN = {
    "±": "+-",
    "×": "x",
    "·": "*",
    "−": "-",
    "–": "-",
    "—": "-",
    "…": "...",
    "→": "->",
    "≤": "<=",
    "≥": ">=",
    "°": "deg",
    "“": '"',
    "”": '"',
    "‘": "'",
    "’": "'",
}
"""What stands for a character that has no simpler form of its own."""
_HANDLER = "skred.plain"


def write_what_it_can(*streams: TextIO) -> None:
    """Let streams write ``m/s2`` where their encoding has no ``²``, instead of failing.

    Parameters
    ----------
    streams : text streams
        Those that have no encoding, as in a test, stay as they are.
    """
    codecs.register_error(_HANDLER, _plainer)
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)


def _plainer(error: UnicodeError) -> tuple[str, int]:
    """What stands for characters that could not be encoded, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(map(_plain, text)), error.end


def _plain(character: str) -> str:
    """The nearest that ASCII has: a letter without its accent, a digit that is not raised."""
    known = _PLAIN.get(character)
    if known is not None:
        return known
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"
