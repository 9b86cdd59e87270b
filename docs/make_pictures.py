"""Make the pictures of the docs: ``python docs/make_pictures.py``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import asterism as am
from asterism.plot import plot_coverage, plot_image, plot_lens, plot_rig
from asterism.plot.style import CYCLE


def landing(path: Path, *, dark: bool) -> None:
    """Draw 0.4 s of a walk: unnamed points on the left, their tracks on the right."""
    person = am.simulate.person(activity="walk", frames=140, n_markers=53, seed=1)
    truth = am.simulate.corrupt(person, missing=0.05, clutter=0.05, noise=0.0003, seed=1)
    tracks = am.track(truth.detections, stitch=True)
    d, seen = truth.detections, slice(40, 80)
    places = person.positions()[seen]
    middle = (places.min(axis=(0, 1)) + places.max(axis=(0, 1))) / 2
    K = am.camera.intrinsics(focal_length=1500, principal_point=(1000.0, 1000.0))
    stand = middle + np.array([2.4, -4.4, 0.6])
    camera = am.Camera.look_at(stand, middle, K=K, size_px=(2001, 2001))
    now = d.frame_of == seen.stop - 1
    shown = (d.frame_of >= seen.start) & (d.frame_of < seen.stop)
    pixels = camera.project(d.points).pixels
    ways = camera.project(tracks.positions()[seen]).pixels.swapaxes(0, 1)
    body = camera.project(places).pixels
    ink, paper, line = ("#dfe6f5", "#1e2129", "#56607a") if dark else ("#3a4256", "#fff", "#c3c9d6")
    figure = Figure(figsize=(11, 5.2), dpi=110, facecolor="none")
    titles = "0.4 s of detections", f"{len(tracks)} tracks; false alarms are left out"
    for i, title in enumerate(titles):
        axes = figure.add_axes((0.5 * i, 0.0, 0.5, 0.93))
        if i:
            for a, b in np.argwhere(np.triu(person.connections)):
                axes.plot(*body[-1, [a, b]].T, color=line, linewidth=1.2, zorder=0)
            for k, way in enumerate(ways):
                colour = CYCLE[k % len(CYCLE)]
                axes.plot(*way.T, color=colour, linewidth=1.2, alpha=0.8)
                axes.plot(*way[-1:].T, "o", color=colour, markersize=6, markeredgecolor=paper)
        else:
            axes.plot(*pixels[shown & ~now].T, ".", color=ink, markersize=2, alpha=0.6)
            axes.plot(*pixels[now].T, "o", color=ink, markersize=4.2)
        low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
        axes.set(xlim=(low[0] - 90, high[0] + 90), ylim=(high[1] + 25, low[1] - 25), aspect="equal")
        axes.set_axis_off()
        figure.text(0.5 * i + 0.03, 0.95, title, fontsize=12, color=ink)
    figure.savefig(path)


# A person in the middle of a step towards +x: metres, left is +y.
_BODY = {
    "forehead": (0.10, 0.00, 1.68), "back of head": (-0.09, 0.00, 1.66), "neck": (0.00, 0.00, 1.48),
    "left shoulder": (0.00, 0.19, 1.42), "left elbow": (-0.14, 0.23, 1.14),
    "left wrist": (-0.06, 0.24, 0.90), "right shoulder": (0.00, -0.19, 1.42),
    "right elbow": (0.10, -0.23, 1.13), "right wrist": (0.30, -0.22, 0.98),
    "left hip": (0.00, 0.11, 0.95), "left knee": (0.22, 0.11, 0.55),
    "left ankle": (0.27, 0.10, 0.10), "left toe": (0.45, 0.11, 0.06),
    "right hip": (0.00, -0.11, 0.95), "right knee": (-0.06, -0.11, 0.52),
    "right ankle": (-0.36, -0.10, 0.20), "right toe": (-0.24, -0.11, 0.05),
}  # fmt: skip
# Trunk, left and right in the first three colours.
_LINKS = (
    (("forehead", "back of head"), ("neck", "forehead"), ("neck", "back of head")),
    (
        ("neck", "left shoulder"), ("left shoulder", "left elbow"), ("left elbow", "left wrist"),
        ("left shoulder", "left hip"), ("left hip", "right hip"), ("left hip", "left knee"),
        ("left knee", "left ankle"), ("left ankle", "left toe"),
    ),
    (
        ("neck", "right shoulder"), ("right shoulder", "right elbow"),
        ("right elbow", "right wrist"), ("right shoulder", "right hip"),
        ("right hip", "right knee"), ("right knee", "right ankle"), ("right ankle", "right toe"),
    ),
)  # fmt: skip
_WALL = am.camera.Polygon(
    corners=np.array(
        [[0.7, -0.93, 0.0], [0.7, -0.93, 0.85], [-0.85, -0.93, 0.85], [-0.85, -0.93, 0.0]]
    ),
    name="low wall",
)


def _person() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Give the markers, shape (K, 3), and their connection matrix."""
    names = list(_BODY)
    connections = np.zeros((len(names), len(names)), dtype=int)
    for colour, links in enumerate(_LINKS, 1):
        for a, b in links:
            i, j = names.index(a), names.index(b)
            connections[i, j] = connections[j, i] = colour
    return np.array(list(_BODY.values())), connections


def lenses(path: Path) -> None:
    """Draw a square grid through the two kinds of radial distortion."""
    K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
    figure = Figure(figsize=(11, 4.6), dpi=110, layout="constrained")
    kinds = (("barrel", 0.3), ("pincushion", -0.12))
    for axes, (name, a1) in zip(figure.subplots(1, 2), kinds, strict=True):
        camera = am.Camera.look_at(
            (0, -4, 1), (0, 0, 1), K=K, size_px=(1280, 1024), lens=am.camera.ReportRadial(a1=a1)
        )
        plot_lens(camera, ax=axes)
        axes.set_title(f"{name}: a₁ = {a1:g}", fontsize=11, loc="left")
    figure.savefig(path)


def film(path: Path) -> None:
    """Draw a person in two cameras, one of which looks over a low wall."""
    points, connections = _person()
    figure = Figure(figsize=(11, 4.9), dpi=110, layout="constrained")
    K = am.camera.intrinsics(focal_length=1500, principal_point=(639.5, 511.5))
    places = (("in front", (3.0, 1.6, 1.5)), ("behind the wall", (0.9, -3.2, 1.3)))
    for axes, (name, place) in zip(figure.subplots(1, 2), places, strict=True):
        camera = am.Camera.look_at(
            place, (0, 0, 0.85), K=K, size_px=(1280, 1024), name=name,
            lens=am.camera.BrownConrady(k1=-0.2),
        )  # fmt: skip
        seen = camera.project(points, [_WALL])
        plot_image(
            camera, seen, connections=connections, colours="#333333", surfaces=[_WALL], ax=axes
        )
    figure.savefig(path)


def rig(path: Path) -> None:
    """Draw eight cameras about a person and a wall, and what the wall takes from their sight."""
    points, _ = _person()
    cameras = am.Rig.ring(8, radius=3.2, height=2.0, target=(0, 0, 0.8))
    figure = Figure(figsize=(12, 4.9), dpi=110)
    # 3-D axes leave wide margins, which are let run out of their half.
    solid = figure.add_axes((-0.05, -0.1, 0.58, 1.2), projection="3d")
    plot_rig(cameras, points=points, surfaces=[_WALL], ax=solid)
    solid.set_title("")
    level = am.camera.volume_grid((-3, -3, 0.4), (3, 3, 0.4), 0.06)
    flat = figure.add_axes((0.61, 0.11, 0.36, 0.8))
    plot_coverage(cameras.coverage(level, [_WALL]), ax=flat)
    flat.set_title("how many cameras see a place 0.4 m above the ground", fontsize=11, loc="left")
    figure.savefig(path)


# Of each scene: options, the frame that is shown, how many frames before it leave a trail.
SCENES: dict[str, tuple[dict[str, Any], int, int]] = {
    "cube": ({}, 60, 12),
    "crossing": ({}, 20, 8),
    "wander": ({"frames": 100}, 80, 25),
    "walk": ({"frames": 60}, 50, 8),
    "attracted": ({"frames": 60}, 20, 6),
    "smooth": ({"n_markers": 40, "frames": 60}, 50, 10),
    "dense": ({"frames": 60}, 50, 6),
    "swarm": ({"frames": 700}, 470, 40),
    "person": ({"activity": "run"}, 130, 0),
    "two_people": ({"activity": "hug"}, 330, 0),
    "fingers": ({}, 60, 0),
    "juggler": ({"frames": 400}, 250, 30),
}


def scenes(path: Path) -> None:
    """Draw every scene: one moment of it, the way that led there, and what occludes."""
    figure = Figure(figsize=(13, 10.5), dpi=90, layout="constrained")
    for i, (name, (options, t, trail)) in enumerate(SCENES.items()):
        truth = am.simulate.SCENES[name].make(seed=2, **options)
        places = truth.positions()
        shown = places[max(0, t - trail) : t + 1]
        middle = (np.nanmin(shown, axis=(0, 1)) + np.nanmax(shown, axis=(0, 1))) / 2
        size = float(np.ptp(shown.reshape(-1, 3), axis=0).max()) + 0.05
        stand = middle + size * np.array([2.2, -2.6, 0.9])
        K = am.camera.intrinsics(focal_length=2000, principal_point=(1000.0, 1000.0))
        camera = am.Camera.look_at(stand, middle, K=K, size_px=(2001, 2001))
        surfaces = [s.during(np.array([t])) for s in truth.surfaces]
        ways = camera.project(shown).pixels
        axes = figure.add_subplot(3, 4, i + 1)
        for k in range(truth.n_tracks * bool(trail)):
            axes.plot(*ways[:, k].T, color="#BBBBBB", linewidth=0.8, zorder=0)
        plot_image(
            camera,
            camera.project(places[t], surfaces),
            connections=truth.connections,
            colours=[CYCLE[(c - 1) % len(CYCLE)] for c in truth.colours],
            surfaces=surfaces,
            ax=axes,
        )
        low, high = np.nanmin(ways, axis=(0, 1)), np.nanmax(ways, axis=(0, 1))
        (u, v), half = (low + high) / 2, 0.6 * float((high - low).max())
        axes.set(xlim=(u - half, u + half), ylim=(v + half, v - half))
        axes.set_axis_off()
        axes.set_title(name.replace("_", " "), fontsize=11, loc="left")
    figure.savefig(path)


if __name__ == "__main__":
    images = Path(__file__).parent / "images"
    images.mkdir(exist_ok=True)
    for picture in (lenses, film, rig, scenes):
        picture(images / f"{picture.__name__}.png")
    landing(images / "landing_light.png", dark=False)
    landing(images / "landing_dark.png", dark=True)
