"""What other packages may offer as mechanisms and laws, and what is refused, with the packages named."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import numpy as np
import pytest
from plugin_cases import SPEC, entries_in, install

from skred.diagnosis.detect.detectability import LIMIT_Z, limit_z
from skred.physics.law import Law, Parameter, SymbolClashError
from skred.physics.mechanisms import Mechanism, mechanisms
from skred.physics.mechanisms.library import Library, built_in, library_of
from skred.physics.mechanisms.placed import direction_of, shapes_of
from skred.physics.mechanisms.spec import Setting
from skred.physics.terrain import Terrain

numbers = count()


class Folder:
    """A folder of packages; each has a module name of its own, since modules are loaded once."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def offer(self, entry: str, code: str) -> str:
        """A package that offers one mechanism; its name."""
        package = f"snow-{next(numbers)}"
        install(self.path, package, SPEC + code, {entry: "MECHANISM"})
        return package

    def library(self) -> Library:
        return library_of(built_in(), entries_in(self.path))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folder:
    monkeypatch.syspath_prepend(tmp_path)
    return Folder(tmp_path)


GOOD = "MECHANISM = mechanism('crust', 'crust_strength', 'b_c')"


def test_a_mechanism_of_another_package_is_in_the_library(folder: Folder) -> None:
    package = folder.offer("crust", GOOD)
    library = folder.library()
    assert list(library.mechanisms) == [*built_in(), "crust"] and library.refused == ()
    assert library.packages["crust"] == package and library.packages["obstacle"] == "skred"


REFUSED = {
    "no such module": ("crust", "import a_module_that_is_not_there", "ModuleNotFoundError", "a_module_that"),
    "not Python": ("crust", "MECHANISM = (", "SyntaxError"),
    "fails as it is loaded": ("crust", "1 / 0", "ZeroDivisionError"),
    "an error of many lines": ("crust", "raise RuntimeError('first\\nsecond')", "RuntimeError: first"),
    "no such name": ("crust", "", "MECHANISM"),
    "something else": ("crust", "MECHANISM = 'crust'", "expected a Mechanism, found str"),
    "another name": ("crust", "MECHANISM = mechanism('rind', 'c', 'b_c')", "'rind'", "'crust'"),
    "reserved": ("nothing", "MECHANISM = mechanism('nothing', 'c', 'b_c')", "reserved"),
    "reserved too": ("unlisted", "MECHANISM = mechanism('unlisted', 'c', 'b_c')", "reserved"),
    "capitals": ("Crust", "MECHANISM = mechanism('Crust', 'c', 'b_c')", "'Crust'", "small letters"),
    "a name with a space": ("crust", "MECHANISM = mechanism('crust', 'a c', 'b_c')", "small letters"),
    "a name of a spread": (
        "crust",
        "MECHANISM = mechanism('crust', 'dry_friction_spread', 'b_c')",
        "spreads",
    ),
    "no prior": ("crust", GOOD.replace("'b_c'", "'b_c', added=dict(scale=0.0)"), "prior scales"),
    "no added": ("crust", GOOD + "\nobject.__setattr__(MECHANISM, 'added', None)", "`added`"),
    "twice": (
        "crust",
        GOOD.replace("'b_c'", "'b_c', added=dict(joins=lambda base: True)"),
        "lacking('crust')",
    ),
    "joins fails": ("crust", GOOD.replace("'b_c'", "'b_c', added=dict(joins=lambda base: 1 / 0)"), "`joins`"),
    "a column alone": ("crust", GOOD.replace("'b_c'", "'b_c', column=Column.CONSTANT"), "without a profile"),
    "no twin": ("crust", GOOD.replace("'b_c'", "'b_c', same_term_as='rind'"), "'rind'"),
    "its own twin": ("crust", GOOD.replace("'b_c'", "'b_c', same_term_as='crust'"), "'crust'"),
    "a twin's twin": ("crust", GOOD.replace("'b_c'", "'b_c', same_term_as='entrainment'"), "'segment_drag'"),
    "an id of skred": ("obstacle", "MECHANISM = mechanism('obstacle', 'c', 'b_c')", "id 'obstacle'", "skred"),
    "a name of skred": (
        "crust",
        "MECHANISM = mechanism('crust', 'dry_friction', 'b_c')",
        "'dry_friction'",
        "skred",
    ),
    "a symbol of skred": (
        "crust",
        "MECHANISM = mechanism('crust', 'c', 'D_f')",
        "'D_f'",
        "'segment_drag'",
        "skred",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_used_is_told_in_one_line_and_the_rest_works(what: str, folder: Folder) -> None:
    entry, code, *expected = REFUSED[what]
    package = folder.offer(entry, code)
    good = folder.offer("rime", "MECHANISM = mechanism('rime', 'rime_strength', 'b_r')")
    library = folder.library()
    (refused,) = library.refused
    line = str(refused)
    assert "\n" not in line and (refused.id, refused.package) == (entry, package) and repr(entry) in line
    for word in (package, *expected):
        assert word in line
    assert set(library.mechanisms) == {*built_in(), "rime"} and library.packages["rime"] == good
    assert all(library.mechanisms[name] is one for name, one in built_in().items())


@pytest.mark.parametrize(
    ("second", "word"),
    [
        ("mechanism('crust', 'other', 'o')", "id 'crust'"),
        ("mechanism('rime', 'crust_strength', 'o')", "name 'crust_strength'"),
        ("mechanism('rime', 'other', 'b_c')", "symbol 'b_c'"),
    ],
)
def test_of_two_that_clash_the_first_stays_and_both_packages_are_named(
    second: str, word: str, folder: Folder
) -> None:
    first = folder.offer("crust", GOOD)
    other = folder.offer("crust" if "'crust'," in second else "rime", f"MECHANISM = {second}")
    library = folder.library()
    (refused,) = library.refused
    assert refused.package == other and word in str(refused) and first in str(refused)
    assert library.packages["crust"] == first


@pytest.fixture(scope="module")
def setting() -> Setting:
    terrain = Terrain(10.0 * np.arange(101.0), np.full(100, 0.5), np.full(100, 0.75**0.5), np.zeros(100))
    return Setting(
        terrain, ("coulomb_friction",), (300.0, 800.0), ("a", "b"), (True, True),
        {"t_degC": np.array([-1.0, 0.0, 1.0])}, 3, np.full(101, 20.0),
    )  # fmt: skip


def loaded(folder: Folder, name: str, more: str) -> Mechanism:
    folder.offer(name, f"MECHANISM = mechanism({name!r}, 'p', 'q', {more})")
    return folder.library().mechanisms[name]


def test_a_covariate_that_is_lacking_is_no_error(folder: Folder, setting: Setting) -> None:
    shape = "shapes=lambda setting: (Shape(covariate='t_degC'),), needs=('t_degC',)"
    warm = loaded(folder, "warm", f"BoundTo.COVARIATE, added=dict({shape})")
    assert [one.covariate for one in shapes_of(warm, setting)] == ["t_degC"]
    lacking = Setting(**{**vars(setting), "covariates": {}})
    assert shapes_of(warm, lacking) == ()


CHANGES = "added=dict(direction=lambda setting, shape: Direction("
WRONG = {
    "no place": ("BoundTo.PLACE", "not bound to place"),
    "a place too many": ("BoundTo.TRACK, added=dict(shapes=stretches)", "bound to place"),
    "an end alone": (
        "BoundTo.TRACK, added=dict(shapes=lambda s: (Shape(s_to_m=9.0),))",
        "to begin somewhere",
    ),
    "no stretch": (
        "BoundTo.PLACE, added=dict(shapes=lambda s: (Shape(s_from_m=9.0, s_to_m=9.0),))",
        "begin above its end",
    ),
    "no such sensor": ("BoundTo.SENSOR, added=dict(shapes=lambda s: (Shape(sensor='z'),))", "sensor 'z'"),
    "no covariate": (
        "BoundTo.COVARIATE, added=dict(shapes=lambda s: (Shape(covariate='z'),))",
        "covariate 'z'",
    ),
    "it fails": ("added=dict(shapes=lambda s: s.covariates['z'])", "z"),
    "a profile too short": (
        f"{CHANGES}(Column.LINEAR,), everywhere(setting.terrain)[None, 1:]))",
        "profiles: expected finite numbers of shape (1, 100)",
    ),
    "readings too many": (f"{CHANGES}log_readings=everywhere(setting.terrain)))", "of shape (2,)"),
    "no number": (f"{CHANGES}release=float('nan')))", "release"),
    "no speed": ("added=dict(direction=along_the_track(Column.WEAKENING, everywhere))", "weakening_speed"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_goes_wrong_on_a_campaign_is_told(what: str, folder: Folder, setting: Setting) -> None:
    more, word = WRONG[what]
    wrong = loaded(folder, f"wrong_{next(numbers)}", more)
    with pytest.raises((ValueError, KeyError)) as told:
        for shape in shapes_of(wrong, setting):
            direction_of(wrong, setting, shape)
    assert word in str(told.value)


def test_a_law_in_which_a_symbol_stands_for_two_things() -> None:
    drag, friction = mechanisms()["turbulent_drag"], mechanisms()["coulomb_friction"]
    both = dict(id="two", title="", build=len, reference="")
    parameters = (Parameter("dry_friction", "mu", "1"), Parameter("drag_length", "D", "m"))
    with pytest.raises(SymbolClashError, match="symbol 'D' is used twice, by 'turbulent_drag' and by 'two'"):
        Law(mechanisms=(friction, drag), parameters=parameters, **both)
    with pytest.raises(SymbolClashError, match="name 'turbulent_drag'"):
        Law(mechanisms=(drag, drag), parameters=(Parameter("a", "a", "1"), Parameter("b", "b", "1")), **both)


def test_the_limit_of_detection_follows_the_library() -> None:
    """A longer list has to stand out more; with the 13 that the number was calculated for it is that."""
    n = len(built_in())
    assert limit_z(13) == pytest.approx(LIMIT_Z, abs=1e-12)
    assert LIMIT_Z < limit_z(n) < limit_z(2 * n) < LIMIT_Z + 0.3
