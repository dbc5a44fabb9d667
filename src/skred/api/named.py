"""Things by their names: told in one line, and a name that is not there is told with those that are."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Protocol

from skred.errors import UnknownNameError


class Titled(Protocol):
    """What has a title in plain words."""

    @property
    def title(self) -> str:
        """In plain words."""
        ...


class ByName[T: Titled](dict[str, T]):
    """A dict by name.

    Parameters
    ----------
    kind : str
        What they are, one and several: ``law laws``.
    content : mapping
    """

    def __init__(self, kind: str, content: Mapping[str, T]) -> None:
        super().__init__(content)
        self.one, self.several = kind.split()

    def __missing__(self, name: object) -> T:
        """Tell which names there are."""
        raise UnknownNameError(f"no {self.one} named {name!r:.60}; there are: {', '.join(self)}")

    def __repr__(self) -> str:
        """One line."""
        return f"<{len(self)} {self.several}: {', '.join(self)}>"

    def _repr_html_(self) -> str:
        """For notebooks: names and titles."""
        rows = "".join(f"<tr><td>{escape(k)}</td><td>{escape(v.title)}</td></tr>" for k, v in self.items())
        return (
            f"<table><thead><tr><th>{self.one}</th><th>title</th></tr></thead><tbody>{rows}</tbody></table>"
        )
