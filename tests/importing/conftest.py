"""The track of the small campaign as a file."""

from import_cases import track

__all__ = ["track"]
