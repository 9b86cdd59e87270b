"""``asterism methods`` and ``asterism scenes``: lists of methods, scenes and their options."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, print_json, print_table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from asterism.cli.options import Option


_Scene = Annotated[
    str | None, typer.Argument(metavar="SCENE", help="Scene whose options are listed.")
]


def methods(json: Json = False) -> None:
    """List the methods and their options.

    `asterism track --method NAME --option NAME=VALUE` uses them.

    For example:

        asterism methods

        asterism methods --json
    """
    import asterism as am
    from asterism.cli.options import record_options
    from asterism.tracking.choose import AUTO

    _show(
        {
            AUTO: (
                "selects a method and stitching by measured properties of the capture.",
                {},
            )
        }
        | {
            name: (_first_line(method), record_options(method))
            for name, method in am.tracking.METHODS.items()
        },
        json,
    )


def scenes(scene: _Scene = None, json: Json = False) -> None:
    """List the scenes of `asterism simulate`, or the options of one scene.

    `asterism simulate SCENE --option NAME=VALUE` sets an option.

    For example:

        asterism scenes

        asterism scenes person
    """
    import asterism as am
    from asterism.checks import check_fields
    from asterism.cli.options import scene_options

    known = am.simulate.SCENES
    if scene is not None:
        check_fields("SCENE", [scene], known)
    if scene is None and not json:
        print_table([(name, s.about) for name, s in known.items()])
        return
    chosen = known if scene is None else {scene: known[scene]}
    _show({name: (s.about, scene_options(s.make)) for name, s in chosen.items()}, json)


def _show(things: Mapping[str, tuple[str, Mapping[str, Option]]], json: bool) -> None:
    if json:
        print_json({name: _plain(about, options) for name, (about, options) in things.items()})
        return
    for i, (name, (about, options)) in enumerate(things.items()):
        rows = [(f"  {o.name}", o.type_text, str(o.default), o.about) for o in options.values()]
        title = ("\n" if i else "") + f"{name}: {about}"
        if rows:
            print_table(rows, ("  option", "type", "default", "meaning"), title=title)
        else:
            print_table([("  no options",)], title=title)


def _plain(about: str, options: Mapping[str, Option]) -> dict[str, Any]:
    return {
        "about": about,
        "options": {
            o.name: {"type": o.type_text, "default": o.default, "about": o.about}
            for o in options.values()
        },
    }


def _first_line(documented: object) -> str:
    return inspect.cleandoc(documented.__doc__ or "").split("\n", 1)[0]
