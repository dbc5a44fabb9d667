"""What a table leaves open, and the words that would settle it."""

import json
import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass

from skred.campaign.problems import shown
from skred.errors import InputError


@dataclass(frozen=True)
class Question:
    """Something that must be declared or asked about.

    Attributes
    ----------
    key : tuple of str
        Where the answer belongs in the mapping file, such as ``("cells", "blank")``.
    where : str
        File, and column or row.
    text : str
        What was found, and what is to be decided.
    choices : tuple of str
        The answers there are; empty for any.
    example : str
        An answer that shows the form.
    option : str
        The option that takes the answer; ``--set KEY`` where there is none of its own.
    """

    key: tuple[str, ...]
    where: str
    text: str
    choices: tuple[str, ...] = ()
    example: str = ""
    option: str = ""

    @property
    def option_line(self) -> str:
        """What to add to the command."""
        answer = self.example or "|".join(self.choices)
        if self.key[0] == "columns":
            return f'--column "{shown(self.key[1], 200)}={answer}"'
        if self.key[:2] == ("cells", "words"):
            return f'--word "{shown(self.key[2], 200)}={answer}"'
        if self.option:
            return f"{self.option} {answer}"
        return set_option(self.key, answer)

    @property
    def mapping_line(self) -> str:
        """What to add to the mapping file."""
        *table, key = self.key
        answer = self.example.strip('"') or "|".join(self.choices)
        if self.key[0] == "columns":
            return f'[columns] "{shown(key, 200)}" = {inline_table(answer)}'
        value = answer if re.fullmatch(r"-?\d+(\.\d+)?", answer) else f'"{answer}"'
        return f"[{dotted(table)}] {dotted((key,))} = {value}"

    def __str__(self) -> str:
        """Where and what, and below it how to answer."""
        return (
            f"{self.where}: {self.text}\n      add {self.option_line}\n      or, in a mapping file, "
            f"{self.mapping_line}"
        )


def dotted(key: Iterable[str]) -> str:
    """A key of several parts as TOML has it; parts that are no plain words are quoted."""
    parts = (shown(part, 200) for part in key)
    return ".".join(
        part if re.fullmatch(r"[A-Za-z0-9_-]+", part) else json.dumps(part, ensure_ascii=False)
        for part in parts
    )


def set_option(key: Iterable[str], answer: str) -> str:
    """The option that declares a key of the mapping file, as a shell takes it."""
    text = f"{dotted(key)}={answer}"
    return f"--set {shlex.quote(text) if '"' in dotted(key) else text}"


def inline_table(meaning: str) -> str:
    """A column's meaning in a mapping file: ``release place=x`` as ``{is = "release", place = "x"}``."""
    kind, *keys = shlex.split(meaning)
    pairs = [("is", kind), *(tuple(key.split("=", 1)) for key in keys)]
    return "{" + ", ".join(f'{key} = "{value}"' for key, value in pairs) + "}"


class Unclear(InputError):
    """A table that cannot be understood without an answer; carries every question of this step.

    Parameters
    ----------
    questions : iterable of Question
        At least one.
    """

    def __init__(self, questions: Iterable[Question]) -> None:
        unique = {question.key: question for question in reversed(list(questions))}
        self.questions = tuple(reversed(unique.values()))
        super().__init__(self.questions)

    def __str__(self) -> str:
        """The questions, each with its answer's form."""
        count = len(self.questions)
        head = f"{count} {'thing is' if count == 1 else 'things are'} not clear from the files:"
        return "\n  ".join([head, *map(str, self.questions)])
