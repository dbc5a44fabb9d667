"""Write docs/thresholds.md: every number that diagnosis and calibration were given by hand, with its reason.

``python scripts/thresholds.py`` reads the source and imports nothing of it. Where numbers have no reason it
lists them and ends with 1; their rows of the page have a gap then. ``--count`` prints how many numbers and
lines of code each package has instead. ``--source`` names another tree to count, such as an older one.

A number is what a module assigns to a name in capitals: a number, numbers in a tuple or a table, or a call
with numbers in it. Its reason is the string that follows, or the comment beside it or above it.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cyclopts

ROOT = Path(__file__).resolve().parent.parent
SOURCE, PAGE = ROOT / "src" / "skred", ROOT / "docs" / "thresholds.md"
LISTED = ("diagnosis", "inference")
_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*")
_NUMBERING = ("int", "range")
"""What makes keys and indices of the numbers that it is given."""
_UNIT_OF_NAME = {"_M": "m", "_DEG": "°", "_NATS": "nats"}
_UNIT_IN_WORDS = re.compile(r"\[([^\]]+)\]|^(Nats)\b|\bin (nats)\b")
HEAD = """# Every threshold and setting, with its reason

Written by `python scripts/thresholds.py` from the source: every number that the diagnosis and the
calibrations below it were given by hand. [The method](method.md) says which few of them decide a verdict.
Most of the others say how finely something is computed. Left out are numbers that mathematics fixes, and
tables that hold words too: the [error models](laws-and-likelihoods.md), and the three kinds of
[model discrepancy](method.md).

A name that begins with `_` is private to its module. Names in one row share a reason, in their order.

| name | value | unit | reason | where |
| --- | --- | --- | --- | --- |
"""


@dataclass(frozen=True)
class Constant:
    """One assignment of numbers to names in capitals.

    Attributes
    ----------
    names : tuple of str
    value : str
        As the source has it.
    reason : str
        Empty if none is given.
    module : str
        Such as ``skred.inference.gate``.
    line : int
        Where in the module.
    """

    names: tuple[str, ...]
    value: str
    reason: str
    module: str
    line: int

    @property
    def unit(self) -> str:
        """As the name or the reason says it; empty if neither does."""
        for ending, unit in _UNIT_OF_NAME.items():
            if all(name.endswith(ending) for name in self.names):
                return unit
        said = _UNIT_IN_WORDS.search(self.reason)
        return next(filter(None, said.groups())).lower() if said else ""

    @property
    def row(self) -> str:
        """Its row of the table."""
        names = ", ".join(f"`{name}`" for name in self.names)
        reason = self.reason.replace("``", "`").replace("|", "\\|")
        return f"| {names} | `{self.value}` | {self.unit} | {reason} | `{self.module}` |\n"


def modules(folder: Path) -> list[Path]:
    """All modules in a folder and below, by name."""
    return sorted(folder.rglob("*.py"))


def constants(source: Path, file: Path) -> list[Constant]:
    """The constants of a module of the package whose folder is `source`."""
    text = file.read_text(encoding="utf-8")
    body, lines = ast.parse(text).body, text.splitlines()
    module = ".".join((source.name, *file.relative_to(source).with_suffix("").parts)).removesuffix(
        ".__init__"
    )
    found, mathematical = list[Constant](), {"math"}
    for statement, following in zip(body, [*body[1:], None], strict=True):
        names, value = _assigned(statement)
        if value is None or not names:
            continue
        if _is_mathematical(value, mathematical):
            mathematical.update(names)
        elif _has_numbers(value):
            reason = " ".join((_string(following) or _comment(lines, statement)).split())
            found.append(Constant(names, _written(value), reason, module, statement.lineno))
    return found


def _assigned(statement: ast.stmt) -> tuple[tuple[str, ...], ast.expr | None]:
    """The names in capitals that a statement assigns to, and what it assigns."""
    if isinstance(statement, ast.Assign):
        target: ast.expr = statement.targets[0]
    elif isinstance(statement, ast.AnnAssign):
        target = statement.target
    else:
        return (), None
    parts = target.elts if isinstance(target, ast.Tuple) else [target]
    names = tuple(part.id for part in parts if isinstance(part, ast.Name) and _NAME.fullmatch(part.id))
    return (names, statement.value) if len(names) == len(parts) else ((), None)


def _is_mathematical(value: ast.expr, names: set[str]) -> bool:
    """Whether an expression is made of mathematical names and literals, as the square root of two is."""
    used = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
    return bool(used) and used <= names


def _has_numbers(value: ast.expr) -> bool:
    """Whether an expression holds numbers and no words: words describe a model or a file, keys apart."""
    literals = [node.value for node in _counted(value) if isinstance(node, ast.Constant)]
    numbers = [one for one in literals if isinstance(one, int | float) and not isinstance(one, bool)]
    return bool(numbers) and not any(isinstance(one, str) for one in literals)


def _counted(node: ast.AST) -> Iterator[ast.AST]:
    """A node and all in it but keys, indices, and what is made to number things."""
    yield node
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _NUMBERING:
        return
    skipped = (
        node.keys if isinstance(node, ast.Dict) else [node.slice] if isinstance(node, ast.Subscript) else []
    )
    for child in ast.iter_child_nodes(node):
        if not any(child is one for one in skipped):
            yield from _counted(child)


def _written(value: ast.expr) -> str:
    """An expression as it is read best; the names of a tuple's parts stand without parentheses too."""
    text = ast.unparse(value)
    return text[1:-1] if isinstance(value, ast.Tuple) and len(value.elts) > 1 else text


def _string(statement: ast.stmt | None) -> str:
    """The string that a statement is; empty if it is none."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return statement.value.value if isinstance(statement.value.value, str) else ""
    return ""


def _comment(lines: list[str], statement: ast.stmt) -> str:
    """The comment beside a statement's end, or the lines of comment above it."""
    end = statement.end_lineno or statement.lineno
    beside = lines[end - 1][statement.end_col_offset or 0 :].strip()
    if beside.startswith("#"):
        return beside.lstrip("# ")
    above = list[str]()
    for line in reversed(lines[: statement.lineno - 1]):
        if not line.startswith("#"):
            break
        above.insert(0, line.lstrip("# "))
    return " ".join(above)


def all_constants(source: Path = SOURCE, packages: tuple[str, ...] = LISTED) -> list[Constant]:
    """The constants of some packages, module by module."""
    files = [file for name in packages for file in modules(source / name)]
    return [one for file in files for one in constants(source, file)]


def unexplained(found: list[Constant]) -> list[str]:
    """Those without a reason, and where they are."""
    return [
        f"{one.module}:{one.line}: {', '.join(one.names)} = {one.value}" for one in found if not one.reason
    ]


def page(found: list[Constant]) -> str:
    """The whole page."""
    return HEAD + "".join(one.row for one in found)


def lines_of_code(file: Path) -> int:
    """Lines of a module that hold code: not blank, not only a comment, not in a string that stands alone."""
    text = file.read_text(encoding="utf-8")
    counted = {
        k for k, line in enumerate(text.splitlines(), start=1) if line.strip() and line.strip()[0] != "#"
    }
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.stmt) and _string(node):
            counted -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(counted)


def counts(source: Path) -> str:
    """Files, lines, lines of code and constants of each package, and of all."""
    packages = {one.name: modules(one) for one in sorted(source.iterdir()) if one.is_dir()}
    packages = {name: files for name, files in packages.items() if files}
    packages["(beside them)"] = sorted(source.glob("*.py"))
    rows = list[tuple[str, int, int, int, int]]()
    for name, files in packages.items():
        lines = sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)
        numbers = sum(len(one.names) for file in files for one in constants(source, file))
        rows.append((name, len(files), lines, sum(map(lines_of_code, files)), numbers))
    totals = [sum(column) for column in list(zip(*rows, strict=True))[1:]]
    head = "| package | files | lines | lines of code | constants |\n| --- | ---: | ---: | ---: | ---: |\n"
    return head + "".join(f"| {' | '.join(map(str, row))} |\n" for row in [*rows, ("all", *totals)])


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    count: Annotated[bool, cyclopts.Parameter(help="Print counts by package; write nothing.")] = False,
    source: Annotated[Path, cyclopts.Parameter(help="Folder of the package to count.")] = SOURCE,
) -> None:
    """Write the page, or count."""
    if count:
        print(counts(source), end="")
        return
    found = all_constants()
    PAGE.write_text(page(found), encoding="utf-8")
    if missing := unexplained(found):
        sys.exit("\n".join([*missing, f"{len(missing)} without a reason: add a string below, or a comment"]))


if __name__ == "__main__":
    app()
