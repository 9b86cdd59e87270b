"""Options derived from dataclasses and functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import pytest

import asterism as am
from asterism.batch.page import flat
from asterism.cli.options import nested, parsed, record_options, scene_options
from asterism.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class Base:
    """A base.

    Parameters
    ----------
    first, second : int
        Two numbers,
        on two lines.
    third : {"a", "b"}
        A choice.

    Examples
    --------
    third : nothing
        Not a parameter.
    """

    first: int = 1
    second: int = 2
    third: Literal["a", "b"] = "a"


@dataclass(frozen=True, kw_only=True)
class Derived(Base):
    """A method.

    Parameters
    ----------
    first, second : int
        See `Base`.
    fourth : float or None
        Its own.
    """

    fourth: float | None = None
    fifth: bool = False
    sixth: str = ""
    name: ClassVar[str] = "derived"


def test_fields_types_defaults_and_texts():
    options = record_options(Derived)
    assert list(options) == ["first", "second", "third", "fourth", "fifth", "sixth"]
    assert options["second"].about == "Two numbers, on two lines."
    assert options["third"].about == "A choice."
    assert options["third"].type_text == "a|b"
    assert options["fourth"].about == "Its own."
    assert options["fourth"].type_text == "float | None"
    assert options["first"].default == 1


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("first=3", 3),
        ("first=-3", -3),
        (" first = 3 ", 3),
        ("third=b", "b"),
        ("fourth=1e-3", 1e-3),
        ("fourth=none", None),
        ("fifth=true", True),
        ("fifth=no", False),
        ("sixth=a=b", "a=b"),
        ("sixth=", ""),
    ],
)
def test_values(text, value):
    (found,) = parsed("--option", "it", [text], record_options(Derived)).values()
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    "text", ["first=1.5", "first=", "third=c", "fourth=x", "fifth=2", "seventh=1", "first", "=1"]
)
def test_refused_values(text):
    with pytest.raises(ParameterError):
        parsed("--option", "it", [text], record_options(Derived))


def test_the_last_of_one_name_counts_and_dashes_will_do():
    options = record_options(am.tracking.METHODS["gnn"])
    assert parsed(
        "--option", "gnn", ["lifecycle.delete-odds=5", "lifecycle.delete_odds=7"], options
    ) == {"lifecycle.delete_odds": 7.0}


def test_rigid_bodies_are_options_of_the_methods_that_have_them():
    having = {
        name for name in am.tracking.METHODS if "rigid" in record_options(am.tracking.METHODS[name])
    }
    assert having == set(am.tracking.METHODS) - {"mcmcda"}
    options = record_options(am.tracking.METHODS["gnn"])

    def made(*texts):
        given = parsed("--option", "gnn", texts, options)
        return am.tracking.method_by_name("gnn", **nested(given, options))

    rigid = am.tracking.Rigidity(max_gap=30)
    assert made("rigid=yes") == am.GNN(rigid=am.tracking.Rigidity())
    assert made("rigid=no") == made() == am.GNN()
    assert made("rigid.max-gap=30") == am.GNN(rigid=rigid)
    assert made("rigid=yes", "rigid.max-gap=30") == am.GNN(rigid=rigid)
    with pytest.raises(ParameterError, match=r"rigid: expected true, as rigid.max_gap is given"):
        made("rigid=no", "rigid.max_gap=30")
    assert flat(nested({"rigid.max_gap": 3, "a": 1}, options)) == {"rigid.max_gap": 3, "a": 1}


@pytest.mark.parametrize("name", am.tracking.METHODS)
def test_every_method_explains_every_option(name):
    for option in record_options(am.tracking.METHODS[name]).values():
        assert option.about
        assert not option.about.startswith("See ")
        text = "none" if option.default is None else str(option.default)
        assert option.parse(text) == option.default


@pytest.mark.parametrize("name", am.simulate.SCENES)
def test_every_scene_takes_its_own_defaults(name):
    options = scene_options(am.simulate.SCENES[name].make)
    values = {option.name: option.parse(str(option.default)) for option in options.values()}
    assert am.simulate.SCENES[name].make(**values).n_tracks > 0
