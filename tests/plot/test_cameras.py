"""Pictures of cameras hold what the cameras say."""

from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Path3DCollection

import asterism as am
from asterism.plot import plot_coverage, plot_depth, plot_image, plot_lens, plot_rig
from asterism.plot.outlines import outlines
from asterism.plot.style import CYCLE

K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
WALL = am.camera.Polygon(corners=[[0.5, 0, 0], [0.5, 0, 2], [2, 0, 2], [2, 0, 0]], name="wall")
# Seen, seen, occluded by the wall, beside the image, behind the camera, absent.
POINTS = np.array(
    [[0, 1, 1], [-0.5, 1, 1.5], [1, 1, 1], [9, 1, 1], [0, -9, 1], [np.nan] * 3], dtype=float
)


def camera_of(lens=None, **options):
    return am.Camera.look_at((0, -4, 1), (0, 0, 1), K=K, size_px=(1280, 1024), lens=lens, **options)


def filmed(lens=None, name=""):
    camera = camera_of(lens, name=name)
    projection = camera.project(POINTS, [WALL])
    assert projection.reason.tolist() == [0, 0, 7, 6, 2, 1]
    return camera, projection


def dots_of(axes, kind=PathCollection):
    return [c for c in axes.collections if isinstance(c, kind)]


@pytest.mark.parametrize("lens", [None, am.camera.BrownConrady(k1=-0.05)])
def test_points_are_drawn_where_the_camera_sees_them(lens):
    camera, projection = filmed(lens, name="left")
    axes = plot_image(camera, projection)
    seen, occluded = dots_of(axes)
    np.testing.assert_array_equal(seen.get_offsets(), projection.pixels[:2])
    np.testing.assert_array_equal(occluded.get_offsets(), projection.pixels[2:3])
    assert [to_hex(c) for c in seen.get_facecolors()] == [c.lower() for c in CYCLE[:2]]
    assert [to_hex(c) for c in occluded.get_facecolors()] == ["#ffffff"]
    assert [to_hex(c) for c in occluded.get_edgecolors()] == [CYCLE[2].lower()]
    title = axes.get_title(loc="left")
    assert title == "left: 2 seen, 1 occluded, 1 outside, 1 behind, 1 absent"


def test_the_image_has_its_own_frame_and_v_runs_down():
    axes = plot_image(*filmed())
    assert axes.get_xlim() == (-0.5, 1279.5)
    assert axes.get_ylim() == (1023.5, -0.5)
    assert axes.get_aspect() == 1
    assert all(spine.get_visible() for spine in axes.spines.values())
    seen, _ = dots_of(axes)
    left, _ = seen.get_offsets()
    axes.figure.draw_without_rendering()
    corner = axes.transData.transform([[-0.5, -0.5], left])
    assert corner[0, 1] > corner[1, 1]  # the top left corner is above


def test_the_connection_matrix_says_which_lines_and_in_which_colour():
    camera, projection = filmed()
    matrix = np.zeros((6, 6), dtype=int)
    for i, j, colour in ((0, 1, 1), (1, 2, 2), (0, 3, 3), (0, 4, 1), (4, 5, 1)):
        matrix[i, j] = matrix[j, i] = colour
    axes = plot_image(camera, projection, connections=matrix)
    whole, broken = (c for c in axes.collections if isinstance(c, LineCollection))
    p = projection.pixels
    np.testing.assert_array_equal(whole.get_segments(), [[p[0], p[1]]])
    np.testing.assert_array_equal(broken.get_segments(), [[p[1], p[2]]])  # to the occluded one
    assert to_hex(whole.get_colors()[0]) == CYCLE[0].lower()
    assert to_hex(broken.get_colors()[0]) == CYCLE[1].lower()
    assert whole.get_linestyles()[0][1] is None
    assert broken.get_linestyles()[0][1] is not None
    assert broken.get_alpha() < 1


def test_lines_of_one_colour_more_than_there_are_begin_anew():
    camera, projection = filmed()
    matrix = np.zeros((6, 6), dtype=int)
    matrix[0, 1] = matrix[1, 0] = len(CYCLE) + 1
    whole, _ = (
        c
        for c in plot_image(camera, projection, connections=matrix).collections
        if isinstance(c, LineCollection)
    )
    assert to_hex(whole.get_colors()[0]) == CYCLE[0].lower()


def test_colours_and_names_go_with_their_points():
    camera, projection = filmed()
    colours = ["red", "#00ff00", (0.0, 0.0, 1.0), "k", "k", "k"]
    names = ("A", None, "C$", "D", "E", "F")
    axes = plot_image(camera, projection, colours=colours, names=names)
    seen, occluded = dots_of(axes)
    assert [to_hex(c) for c in seen.get_facecolors()] == ["#ff0000", "#00ff00"]
    assert to_hex(occluded.get_edgecolors()[0]) == "#0000ff"
    assert {t.get_text(): t.xy for t in axes.texts} == {
        "A": pytest.approx(projection.pixels[0]),
        "C$": pytest.approx(projection.pixels[2]),
    }
    seen, _ = dots_of(plot_image(camera, projection, colours="red"))
    assert {to_hex(c) for c in seen.get_facecolors()} == {"#ff0000"}


def test_a_surface_is_drawn_with_the_bend_of_the_lens():
    camera, projection = filmed(am.camera.ReportRadial(a1=0.3))
    axes = plot_image(camera, projection, surfaces=[WALL])
    (edge,) = axes.lines
    drawn = np.stack(edge.get_data(), axis=1)
    corners = camera.project(WALL.corners[0]).pixels
    for corner in corners:
        assert np.abs(drawn - corner).sum(axis=1).min() < 1e-9
    chord = corners[0] + np.linspace(0, 1, 33)[:, None] * (corners[1] - corners[0])
    assert np.abs(drawn[:33] - chord).max() > 1


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"connections": np.zeros((5, 5), dtype=int)}, "connections"),
        ({"connections": np.eye(6, k=1, dtype=int)}, "symmetric"),
        ({"connections": -np.ones((6, 6), dtype=int)}, "connections"),
        ({"connections": np.full((6, 6), 0.5)}, "connections"),
        ({"names": ["A"]}, "names"),
        ({"colours": ["red"]}, "colours"),
    ],
)
def test_what_does_not_fit_the_points_is_refused(options, what):
    with pytest.raises(am.ParameterError, match=what):
        plot_image(*filmed(), **options)


def test_a_projection_of_more_than_one_frame_is_refused():
    camera = camera_of()
    with pytest.raises(am.ParameterError, match="one frame"):
        plot_image(camera, camera.project(POINTS[None]))


@pytest.mark.parametrize(
    "lens", [am.camera.ReportRadial(a1=0.3), am.camera.ReportRadial(a1=-0.2), None]
)
def test_the_grid_is_bent_by_the_lens_and_square_without_it(lens):
    camera = camera_of(lens)
    ideal, bent = (c for c in plot_lens(camera).collections if isinstance(c, LineCollection))
    flat = camera_of()
    for line, straight in zip(bent.get_segments(), ideal.get_segments(), strict=True):
        expected = camera.distort(flat.undistort(straight))
        expected = expected[np.isfinite(expected[:, 0])]  # the lens may end before the grid
        np.testing.assert_allclose(line, expected, atol=1e-9)
    # Squares of an eighth of the image's height, that fill it.
    corners = np.array(ideal.get_segments())
    verticals = np.unique(np.round(corners[np.ptp(corners[:, :, 0], axis=1) < 1e-9, 0, 0], 6))
    np.testing.assert_allclose(np.diff(verticals), 128)
    assert (verticals[0], verticals[-1]) == (-0.5, 1279.5)


def test_barrel_and_pincushion_bend_the_two_ways():
    def corner(lens):
        _, bent = (
            c for c in plot_lens(camera_of(lens)).collections if isinstance(c, LineCollection)
        )
        return np.abs(np.concatenate(bent.get_segments()) - 639.5).max()

    assert corner(am.camera.ReportRadial(a1=0.3)) < 610
    assert corner(am.camera.ReportRadial(a1=-0.2)) > 680


def test_the_title_says_how_far_the_lens_shifts():
    lens = am.camera.BrownConrady(k1=-0.1)
    camera = camera_of(lens, name="c")
    w, h = camera.size_px
    pixels = np.stack(np.meshgrid(np.arange(w), np.arange(h)), axis=-1)
    shift = np.linalg.norm(camera_of().distort(camera.undistort(pixels)) - pixels, axis=2).max()
    said = plot_lens(camera).get_title(loc="left")
    assert said.startswith("c: BrownConrady, shifts points by up to ")
    assert float(said.split()[-2]) == pytest.approx(shift, rel=0.01)
    assert plot_lens(camera_of()).get_title(loc="left") == "no lens"


def test_the_end_of_the_lens_model_is_drawn_where_it_is():
    lens = am.camera.BrownConrady(k1=-0.6)
    camera = camera_of(lens)
    angles = np.linspace(0, 2 * np.pi, 64)
    edge = camera.distort(lens.radius * (1 - 1e-9) * np.stack([np.cos(angles), np.sin(angles)], 1))
    radius = np.linalg.norm(edge - [639.5, 511.5], axis=1).mean()
    axes = plot_lens(camera)
    assert [t.get_text() for t in axes.get_legend().get_texts()] == ["the lens model ends"]
    drawn = [
        path.vertices
        for c in axes.collections
        if to_hex(c.get_edgecolor()[0]) == CYCLE[5].lower()
        for path in c.get_paths()
    ]
    distance = np.linalg.norm(np.concatenate(drawn) - [639.5, 511.5], axis=1)
    np.testing.assert_allclose(distance, radius, atol=2.5)  # as fine as it is sampled
    assert plot_lens(camera_of(am.camera.BrownConrady(k1=-0.01))).get_legend() is None


def test_a_rig_stands_where_its_cameras_do():
    rig = am.Rig.ring(4, radius=3, height=2)
    axes = plot_rig(rig, points=np.append(POINTS, [[np.nan, 0, 0]], axis=0))
    cameras, dots = dots_of(axes, Path3DCollection)
    np.testing.assert_allclose(
        np.stack(cameras._offsets3d, axis=1), [c.center for c in rig], atol=1e-12
    )
    np.testing.assert_array_equal(np.stack(dots._offsets3d, axis=1), POINTS[:5])
    assert [t.get_text().strip() for t in axes.texts] == list(rig.names)
    assert axes.get_title(loc="left") == "4 cameras"


def test_a_pyramid_ends_where_the_corners_of_the_image_look():
    camera = camera_of(name="a")
    axes = plot_rig(am.Rig((camera,)), length=0.5)
    (lines,) = dots_of(axes, Line3DCollection)
    *edges, base = lines._segments3d
    corners = camera.center + 0.5 * (
        camera.rays([[-0.5, -0.5], [1279.5, -0.5], [1279.5, 1023.5], [-0.5, 1023.5]])
        / (camera.rays([[-0.5, -0.5]]) @ camera.axis)
    )
    np.testing.assert_allclose([edge[0] for edge in edges], np.tile(camera.center, (4, 1)))
    np.testing.assert_allclose([edge[1] for edge in edges], corners, atol=1e-12)
    np.testing.assert_allclose((np.asarray(base) - camera.center) @ camera.axis, 0.5)


def test_a_pyramid_shrinks_to_what_the_lens_reaches():
    camera = camera_of(am.camera.BrownConrady(k1=-0.6))
    assert np.isnan(camera.rays([-0.5, -0.5])).any()
    (lines,) = dots_of(plot_rig(am.Rig((camera,)), length=1.0), Line3DCollection)
    *edges, base = (np.asarray(line) for line in lines._segments3d)
    assert len(edges) == 4
    assert np.isfinite(base).all()
    seen = camera.project(camera.center + 0.999 * (base - camera.center))
    assert seen.visible.all()
    farthest = np.linalg.norm(seen.pixels - [639.5, 511.5], axis=1).min()
    assert farthest > 400  # of the 450 that it reaches


def test_surfaces_are_drawn_by_their_outlines_at_their_moment():
    here = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    there = [[0, 0, 5], [1, 0, 5], [0, 1, 5]]
    moving = am.camera.Polygon(corners=[here, there])
    axes = plot_rig(am.Rig.ring(2, radius=3, height=2), surfaces=[moving], moment=1)
    (line,) = axes.lines
    np.testing.assert_array_equal(np.stack(line.get_data_3d(), axis=1), [*there, there[0]])
    with pytest.raises(am.ParameterError, match="0 to 1"):
        outlines(moving, 2)
    np.testing.assert_array_equal(outlines(WALL, 7)[0], outlines(WALL)[0])


def test_a_mesh_shows_each_edge_once():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    edges = outlines(am.camera.Mesh(vertices=corners, faces=[[0, 1, 2], [0, 2, 3]]))
    pairs = {tuple(sorted(map(tuple, edge))) for edge in edges}
    assert len(edges) == len(pairs) == 5


@pytest.mark.parametrize("ends", [[[0, 0, 1], [0, 0.3, 2]], [[1, 2, 3], [1, 2, 3]]])
def test_the_outlines_of_a_capsule_lie_on_it(ends):
    a, b = np.array(ends, dtype=float)
    for line in outlines(am.camera.Capsule(ends=ends, radius=0.2)):
        along = np.clip((line - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
        distance = np.linalg.norm(line - a - along[:, None] * (b - a), axis=1)
        np.testing.assert_allclose(distance, 0.2)
        np.testing.assert_allclose(line[0], line[-1], atol=1e-12)


def test_what_given_axes_show_stays_in_sight():
    scene = am.simulate.cube(seed=1, frames=20)
    axes = am.plot.plot_trajectories(scene)
    before = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    assert plot_rig(am.Rig.ring(3, radius=2, height=5, target=(9, 0, 0)), ax=axes) is axes
    after = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    assert (after[:, 0] <= before[:, 0]).all()
    assert (after[:, 1] >= before[:, 1]).all()
    assert after[0, 1] > 11


@pytest.fixture(scope="module")
def coverage():
    rig = am.Rig.ring(3, radius=2.5, height=2, focal_px=1800)
    return rig.coverage(am.camera.volume_grid((-2, -1, 0), (2, 1.5, 2), 0.5))


def test_a_level_of_the_coverage(coverage):
    axes = plot_coverage(coverage, height=1.1)
    (mesh,) = (c for c in axes.collections if isinstance(c, QuadMesh))
    n = coverage.n_cameras[:, :, 2]
    np.testing.assert_array_equal(mesh.get_array(), n.T)
    # The middle of a cell is its place; each count has a different colour.
    np.testing.assert_array_equal(mesh.get_coordinates()[0, 0], [-2.25, -1.25])
    np.testing.assert_array_equal(mesh.get_coordinates()[-1, -1], [2.25, 1.75])
    colours = [to_hex(mesh.to_rgba(k)) for k in range(4)]
    assert len(set(colours)) == 4
    assert len({to_hex(mesh.to_rgba(k + 0.3)) for k in (2, 2.1)}) == 1
    assert axes.get_title(loc="left").startswith("z = 1 m: ")
    share = float(axes.get_title(loc="left").split()[4])
    assert share == pytest.approx(100 * (n >= 2).mean(), abs=0.1)


def test_cells_under_two_cameras_are_hatched(coverage):
    axes = plot_coverage(coverage, height=1)
    (hatched,) = (
        c for c in axes.collections if isinstance(c, PolyCollection) and c.get_hatch() == "////"
    )
    boxes = [path.get_extents() for path in hatched.get_paths()]
    x, y = coverage.points[:, :, 2, 0], coverage.points[:, :, 2, 1]
    is_hatched = np.zeros(x.shape, dtype=bool)
    for box in boxes:
        is_hatched |= (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
    np.testing.assert_array_equal(is_hatched, coverage.n_cameras[:, :, 2] < 2)
    assert is_hatched.any()
    assert not is_hatched.all()


def test_the_error_is_in_millimetres(coverage):
    axes = plot_coverage(coverage, what="error")
    (mesh,) = (c for c in axes.collections if isinstance(c, QuadMesh))
    error = 1e3 * coverage.error[:, :, 2].T  # the middle level
    np.testing.assert_array_equal(mesh.get_array().mask, np.isnan(error))
    np.testing.assert_array_equal(mesh.get_array().compressed(), error[~np.isnan(error)])
    assert f"median error {np.nanmedian(error):.3g} mm" in axes.get_title(loc="left")


def test_what_is_no_level_of_a_grid_is_refused(coverage):
    rig = am.Rig.ring(3, radius=2.5, height=2)
    with pytest.raises(am.ParameterError, match="volume_grid"):
        plot_coverage(rig.coverage(np.zeros((5, 3))))
    with pytest.raises(am.ParameterError, match="even grid"):
        plot_coverage(rig.coverage(np.random.default_rng(1).normal(size=(2, 3, 4, 3))))
    with pytest.raises(am.ParameterError, match="from 0 to 2 m"):
        plot_coverage(coverage, height=1000)
    with pytest.raises(am.ParameterError, match="what"):
        plot_coverage(coverage, what="depth")


@pytest.mark.parametrize("what", ["cameras", "error"])
@pytest.mark.parametrize("place", [(0.0, 0.0, 1.0), (50.0, 0.0, 1.0)])
def test_one_cell_is_a_level_too(what, place):
    rig = am.Rig.ring(3, radius=2.5, height=2)
    axes = plot_coverage(rig.coverage(am.camera.volume_grid(place, place, 0.5)), what=what)
    axes.figure.draw_without_rendering()


def test_the_depth_of_an_image_pixel_by_pixel():
    depth = np.full((3, 4), np.inf)
    depth[1, 2], depth[2, 0] = 2.0, 5.0
    axes = plot_depth(depth)
    (image,) = axes.images
    shown = image.get_array()
    np.testing.assert_array_equal(shown.mask, np.isinf(depth))
    np.testing.assert_array_equal(shown.compressed(), [2.0, 5.0])
    assert tuple(image.get_extent()) == (-0.5, 3.5, 2.5, -0.5)
    assert axes.get_title(loc="left") == "16.7 % of the pixels see something"
    assert len(axes.figure.axes) == 2
    assert len(plot_depth(np.full((2, 2), np.inf)).figure.axes) == 1  # no bar of nothing
    for wrong in (np.zeros(3), np.zeros((0, 4))):
        with pytest.raises(am.ParameterError, match="depth"):
            plot_depth(wrong)


def test_given_axes_are_drawn_on_and_given_back_and_exported(coverage):
    camera, projection = filmed(name="$x^$")
    figure = Figure(layout="constrained")
    flat = figure.subplots(2, 2).ravel()
    assert plot_image(camera, projection, ax=flat[0]) is flat[0]
    assert plot_lens(camera, ax=flat[1]) is flat[1]
    assert plot_coverage(coverage, ax=flat[2]) is flat[2]
    assert plot_depth(np.ones((3, 4)), ax=flat[3]) is flat[3]
    figure.savefig(io.BytesIO(), format="pdf")
    solid = Figure().add_subplot(projection="3d")
    rig = am.Rig((camera,))
    assert plot_rig(rig, coverage=coverage, surfaces=[WALL], ax=solid) is solid
    solid.figure.savefig(io.BytesIO(), format="svg")
