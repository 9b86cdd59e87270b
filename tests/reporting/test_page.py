"""The report page without a browser: what is in it, what is judged, what is refused."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html
import re

import numpy as np
import pytest

import asterism as am
from asterism.reporting.judgement import judge
from asterism.reporting.page import find_troubles
from asterism.reporting.page.lenses import lens_table, pixels_by
from asterism.reporting.page.packing import residuals
from asterism.reporting.page.thinning import stride_for
from tests.reporting.cases import HOSTILE, positions, spoilt_person, text_of, unpacked


@pytest.fixture(scope="module")
def person():
    return spoilt_person()


def written(tmp_path, tracks, **options):
    am.report(tracks, tmp_path / "page.html", **options)
    return (tmp_path / "page.html").read_bytes()


def straight(n_frames=200, n_markers=4, apart=0.2):
    """Markers that go straight on, side by side, 1 mm a frame; shape (T, K, 3)."""
    t, k = np.arange(n_frames)[:, None], np.arange(n_markers)[None]
    rng = np.random.default_rng(5)
    places = np.stack([0.001 * t + 0 * k, apart * k + 0 * t, 1 + 0 * t * k], axis=-1)
    return places + rng.normal(0, 1e-4, places.shape)


def tracks_of(places, names=(), rate=100.0):
    return am.Tracks.from_dense(np.arange(len(places)) / rate, places, names)


def test_positions_come_back_within_half_a_cell(tmp_path, person):
    _, tracks = person
    header, arrays = unpacked(written(tmp_path, tracks))
    order, starts = tracks.by_track
    assert np.array_equal(arrays["starts"], starts)
    found = positions(header, arrays)[: len(order)]
    off = np.abs(found - tracks.detections.points[order])
    assert (off <= 0.5001 * np.array(header["grid"][1])).all()
    assert max(header["grid"][1]) < 0.0005
    assert np.array_equal(arrays["times"], tracks.detections.times)
    for name, sure in (("Identity", tracks.identity_confidence), ("Link", tracks.confidence)):
        header, arrays = unpacked(written(tmp_path, tracks))
        assert header["confidence"] == f"{name} confidence"
        assert np.abs(arrays["confidence"][: len(order)] / 255 - sure[order]).max() < 0.002
        tracks = dataclasses.replace(tracks, identity_confidence=None)


def test_runs_and_clutter_are_those_of_the_tracks(tmp_path, person):
    _, tracks = person
    _, a = unpacked(written(tmp_path, tracks))
    order, _ = tracks.by_track
    frames = np.concatenate(
        [np.arange(f, f + n) for f, n in zip(a["runFirst"], a["runLength"], strict=True)]
    )
    assert np.array_equal(frames, tracks.detections.frame_of[order])
    whose = np.repeat(a["runTrack"], a["runLength"])
    assert np.array_equal(whose, tracks.labels[order])
    lost = tracks.detections.frame_of[tracks.labels < 0]
    assert np.array_equal(a["clutter"], np.bincount(lost, minlength=tracks.detections.n_frames))


@pytest.mark.parametrize("order", [1, 2])
def test_residuals_are_undone_by_summing(order):
    rng = np.random.default_rng(2)
    begins = np.array([0, 1, 2, 50, 52])
    cells = rng.integers(0, 65536, 80)
    rest = residuals(cells, begins, order).astype(np.int64)
    left = np.where(rest % 2, -(rest + 1) // 2, rest // 2)
    for begin, end in zip(begins, [*begins[1:], 80], strict=True):
        found = np.cumsum(left[begin:end])
        if order == 2 and end - begin > 1:
            found = np.cumsum(np.concatenate([[0], np.cumsum(left[begin + 1 : end])])) + left[begin]
        assert np.array_equal(found % 65536, cells[begin:end])


def test_same_tracks_same_bytes(tmp_path, person):
    truth, tracks = person
    assert written(tmp_path, tracks, truth=truth) == written(tmp_path, tracks, truth=truth)


def test_policy_allows_the_page_itself_and_nothing_else(tmp_path, person):
    page = written(tmp_path, person[1]).decode()
    policy = html.unescape(re.search('Content-Security-Policy" content="([^"]*)"', page)[1])
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["base-uri"] == rules["form-action"] == "'none'"
    assert "unsafe" not in policy
    assert "http" not in policy
    scripts = re.findall("<script>(.*?)</script>", page, re.S)
    styles = re.findall("<style>(.*?)</style>", page, re.S)
    assert len(scripts) == len(styles) == 1
    for rule, text in (("script-src", scripts[0]), ("style-src", styles[0])):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules[rule] == f"'sha256-{digest}'"
    assert not re.search(r"<[^>]+ (style|on\w+)=", page.replace(scripts[0], ""))
    assert "Permission is hereby granted" in scripts[0]  # three.js's notice


def test_names_from_files_stay_text(tmp_path):
    names = HOSTILE
    places = straight(n_markers=len(names))
    for k in range(len(names)):
        places[20 + 25 * k : 40 + 25 * k, k] = np.nan  # so that each is in a list
    tracks = tracks_of(places, names)
    page = written(
        tmp_path, tracks, truth=tracks, title=HOSTILE[0], summary=[(HOSTILE[1], HOSTILE[2])]
    ).decode()
    assert page.count("<script") == page.count("</script>") == 2
    assert "<img" not in page
    assert "\u2028" not in page.split("<script>")[1]
    for name in names:
        assert f"<bdi>{html.escape(name)}</bdi>" in page


def test_damaged_names_do_not_stop_the_page(tmp_path):
    assert b"?" in written(tmp_path, tracks_of(straight(30), ["\ud800", "b", "b", "\x00"]))


def test_figures_are_those_of_the_tracks(tmp_path, person):
    truth, tracks = person
    page = written(tmp_path, tracks, truth=truth).decode()
    facts = dict(re.findall('data-fact="([a-z]+)">([^<]*)<', page))
    labelled = tracks.labels >= 0
    assert facts["tracks"] == str(np.count_nonzero(tracks.lengths))
    assert facts["labelled"] == f"{100 * labelled.mean():.1f} %"
    assert facts["clutter"] == f"{(~labelled).sum():,}"
    assert facts["places"] == "✓ 0"
    seen = [np.flatnonzero(np.isfinite(c)) for c in tracks.positions()[:, :, 0].T]
    assert facts["gaps"] == f"{sum((np.diff(f) > 1).sum() for f in seen):,}"
    scores = {html.unescape(k): v for k, v in re.findall('data-score="([^"]+)">([^<]*)<', page)}
    e = am.evaluate(tracks, truth)
    assert scores["IDF1"] == f"{e.idf1:.4f}"
    assert scores["Switches"] == f"{e.switches:,}"
    assert scores["Wrong labels"] == f"{e.wrong_percent:.3f} %"
    assert scores["Missed"] == f"{e.missed:,}"


def test_judgement_counts_as_the_evaluation_does(person):
    truth, tracks = person
    labels = tracks.labels.copy()
    order, starts = tracks.by_track
    for t in range(40, 70):  # two markers change their tracks for a while
        i, j = (order[starts[k] : starts[k + 1]] for k in (3, 8))
        i, j = (m[tracks.detections.frame_of[m] == t] for m in (i, j))
        labels[i], labels[j] = 8, 3
    swapped = dataclasses.replace(tracks, labels=labels)
    judged, e = judge(swapped, truth), am.evaluate(swapped, truth)
    n_labelled = (swapped.labels >= 0).sum()
    assert 100 * (judged.verdicts == 1).sum() / n_labelled == pytest.approx(e.wrong_percent)
    assert (judged.verdicts == 2).sum() == e.missed
    assert e.wrong_percent > 0
    found = [f for f in find_troubles(swapped, judged) if f.kind == "wrong marker"]
    assert (found[0].frame, found[0].count) == (40, 2)
    assert found[0].reason.startswith("2 tracks change to another marker at 0.40 s; ")
    n_switches = sum(f.count for f in find_troubles(swapped, judged) if f.kind == "switch")
    assert n_switches == e.switches >= 4


def test_detections_that_only_the_truth_has_are_told(tmp_path, person):
    truth, tracks = person
    d = tracks.detections
    kept = np.ones(d.n_points, dtype=bool)
    kept[np.flatnonzero(truth.labels >= 0)[:7]] = False
    fewer = am.Detections(
        times=d.times,
        offsets=np.concatenate([[0], np.cumsum(kept)])[d.offsets],
        points=d.points[kept],
    )
    page = written(tmp_path, am.Tracks(detections=fewer, labels=tracks.labels[kept]), truth=truth)
    assert "7 points of markers are in the truth only" in text_of(page)


def test_another_result_is_not_called_the_truth(tmp_path, person):
    truth, tracks = person
    text = text_of(written(tmp_path, tracks, truth=truth))
    assert "Comparison with the truth" in text
    other = dataclasses.replace(truth, confidence=(truth.labels >= 0).astype(float))
    page = written(tmp_path, tracks, truth=other)
    assert unpacked(page)[0]["against"] == "other result"
    text = text_of(re.sub(rb"(?s)<(script|style).*?</\1>", b"", page))
    assert "Comparison with the other result" in text
    assert "differs from the other result" in text
    assert "truth" not in text


def test_two_tracks_that_change_places_are_found():
    places = straight(apart=0.05)
    places[120:, [1, 2]] = places[120:, [2, 1]]
    found = find_troubles(tracks_of(places, ["a", "b", "c", "d"]))
    assert [(f.kind, f.track, f.frame) for f in found] == [("likely swap", 2, 120)]
    assert "where b was predicted" in found[0].reason


def test_a_pair_that_changes_places_often_is_listed_once():
    places = straight(apart=0.05)
    for t in (60, 90, 120):
        places[t:, [1, 2]] = places[t:, [2, 1]]
    found = find_troubles(tracks_of(places))
    assert [(f.kind, f.frame) for f in found] == [("likely swap", 60)]
    assert "3 times in total" in found[0].reason


def test_a_jump_is_found_once_and_nothing_else():
    places = straight()
    places[77:, 2, 2] += 0.1
    found = find_troubles(tracks_of(places))
    assert [(f.kind, f.track, f.frame) for f in found] == [("jump", 2, 77)]
    assert find_troubles(tracks_of(straight())) == []


def test_gaps_and_ends_are_found_with_their_reasons():
    places = straight()
    places[50:80, 0] = np.nan
    places[:120, 1] = np.nan
    places[150:, 2] = np.nan
    places[90:93, 3] = np.nan  # too short for a finding
    found = find_troubles(tracks_of(places))
    by_place = {(f.kind, f.track): f for f in found}
    assert len(by_place) == len(found) == 3
    assert by_place["long gap", 0].frame == 80
    assert "0.31 s (30 frames)" in by_place["long gap", 0].reason
    assert by_place["begun midway", 1].frame == 120
    assert by_place["ends early", 2].frame == 149


def test_tracks_that_begin_together_are_one_entry():
    places = straight(n_markers=40)
    for k in range(2, 40):
        places[: 120 + k % 6, k] = np.nan
    places[100:120, :2] = np.nan
    found = {f.kind: f for f in find_troubles(tracks_of(places))}
    assert set(found) == {"begun midway", "long gap"}
    begun = found["begun midway"]
    assert (begun.count, begun.frame, begun.weight) == (38, 120, 38 * 3.0)
    assert begun.reason.startswith("38 tracks begin at 1.20 s; ")
    assert found["long gap"].reason.startswith("2 tracks continue after a gap at 1.20 s; ")


def uncertain(*parts, n_markers=4, n_frames=200):
    """Tracks with some decisions, (track, first, last, probability, alternatives) each."""
    decisions = tuple(
        am.model.Decision(
            kind="identity", track=track, first=first, last=last, n_detections=last - first + 1,
            probability=p, alternatives=tuple(
                am.model.Alternative(track=k, probability=q) for k, q in others
            ),
        )
        for track, first, last, p, others in parts
    )  # fmt: skip
    tracks = tracks_of(straight(n_frames, n_markers), ["RTOE", "RMT1", "LTOE", "LMT1"])
    sure = np.ones(len(tracks.labels))
    for each in decisions:
        frame = tracks.detections.frame_of
        own = (tracks.labels == each.track) & (frame >= each.first) & (frame <= each.last)
        sure[own] = each.probability
    return dataclasses.replace(tracks, identity_confidence=sure, decisions=decisions)


def places_on(page):
    """Attributes and words of the entries of the first list."""
    listed = re.search('<ol id="places".*?</ol>', page, re.S)[0]
    return [
        (dict(re.findall('data-([a-z]+)="([^"]*)"', button)), text_of(button.encode()))
        for button in re.findall("<button.*?</button>", listed, re.S)
    ]


def test_places_are_in_words_the_worst_first(tmp_path):
    tracks = uncertain(
        (2, 20, 29, 0.35, [(3, 0.65)]),
        (0, 54, 181, 0.38, [(None, 0.07), (1, 0.54), (3, 0.01)]),
        (2, 190, 191, 0.79, [(3, 0.2)]),  # less than half a wrong point, near the first place
    )
    page = written(tmp_path, tracks).decode()
    (first, words), (second, _) = places_on(page)
    sentence = " ".join(words.split("0.54\xa0s")[1].replace("\xa0", " ").split())
    assert sentence == (
        "RTOE , frames 54 to 181: 38 %, or RMT1 54 %, unknown marker 7 %; "
        "1 more part, also of LTOE; about 80 wrong points"
    )
    assert (first["track"], first["frame"], first["last"]) == ("0", "54", "181")
    assert first["tracks"] == "0 1"
    assert second["tracks"] == "2 3"
    assert 'data-severity="many"><dt>places to check, about 86 wrong points</dt>' in page
    assert 'data-fact="places">▲ 2<' in page
    cards = page.split('class="cards"')[1]
    assert cards.index('data-fact="places"') < cards.index('data-fact="tracks"')


def test_a_subject_that_walks_out_and_in_is_one_place_each_time():
    from asterism.reporting.places import places_of

    parts = [
        (k, first + 3 * k, first + length - 2 * k, 0.35, [(None, 0.65)])
        for first, length in ((100, 100), (300, 150))
        for k in range(4)
    ]
    tracks = uncertain(*parts, n_frames=600)
    # A gap of a second between them does not make both one place.
    joins = tuple(
        am.model.Decision(
            kind="join", track=k, first=200 - 2 * k, last=300 + 3 * k, n_detections=0,
            probability=0.6,
        )
        for k in range(4)
    )  # fmt: skip
    tracks = dataclasses.replace(tracks, decisions=tracks.decisions + joins)
    second, first = places_of(tracks)
    assert (first.first, first.last) == (100, 200)
    assert (second.first, second.last) == (194, 450)  # with the joins that lead to it
    assert sorted(first.tracks) == sorted(second.tracks) == [0, 1, 2, 3]
    apart = [(0, 100, 200, 0.35, []), (1, 190, 290, 0.35, []), (2, 100, 130, 0.35, [])]
    assert len(places_of(uncertain(*apart, n_frames=600))) == 3  # not long, or not at one time
    names = uncertain(*parts[:4], n_frames=600)
    of_names = tuple(dataclasses.replace(each, kind="name") for each in names.decisions)
    names = dataclasses.replace(names, decisions=of_names, identity_confidence=None)
    assert len(places_of(names)) == 4


def test_a_single_uncertain_detection_is_part_of_the_nearest_place():
    from asterism.reporting.places import places_of

    large = [(0, 100, 120, 0.35, []), (0, 300, 320, 0.35, [])]
    small = [(1, 60, 60, 0.3, []), (2, 280, 280, 0.3, []), (3, 200, 200, 0.3, [])]
    first, second = places_of(uncertain(*large, *small, n_frames=600))
    assert (first.tracks, first.first, first.last) == ((0, 1), 60, 120)
    assert (second.tracks, second.first, second.last) == ((0, 2), 280, 320)
    assert first.expected_wrong == pytest.approx(0.65 * 21 + 0.7)
    assert places_of(uncertain(*small, n_frames=600)) == ()


def test_a_single_detection_that_is_almost_surely_wrong_is_a_place():
    from asterism.reporting.places import places_of

    (place,) = places_of(uncertain((1, 60, 60, 0.15, []), (2, 280, 280, 0.25, []), n_frames=600))
    assert place.tracks == (1,)


def test_parts_that_are_probably_right_are_no_place_of_their_own():
    from asterism.reporting.places import places_of

    wrong, probable = (0, 100, 120, 0.65, []), [(1, 60, 90, 0.75, []), (2, 300, 399, 0.75, [])]
    (place,) = places_of(uncertain(wrong, *probable, n_frames=600))
    assert set(place.tracks) == {0, 1}
    assert (place.first, place.last) == (60, 120)


def test_severity_is_a_word_and_a_sign(tmp_path):
    few = written(tmp_path, uncertain((0, 20, 24, 0.35, [(1, 0.65)]))).decode()
    assert 'data-severity="some"><dt>place to check, about 3 wrong points</dt>' in few
    assert 'data-fact="places">△ 1<' in few
    assert (
        'data-severity="clear"><dt>places to check</dt>' in written(tmp_path, uncertain()).decode()
    )
    unknown = written(tmp_path, tracks_of(straight())).decode()
    assert 'data-severity="none"' in unknown
    assert 'data-fact="places">–<' in unknown
    assert "Not known: the tracks have no probabilities of identity." in text_of(unknown.encode())


def test_places_of_a_file_follow_from_its_identity_confidence(tmp_path):
    tracks = uncertain((0, 20, 29, 0.35, [(1, 0.65)]), (3, 100, 139, 0.3, []))
    of_file = dataclasses.replace(tracks, decisions=())
    found = [place for place, _ in places_on(written(tmp_path, of_file).decode())]
    assert [(p["track"], p["frame"], p["last"]) for p in found] == [
        ("3", "100", "139"), ("0", "20", "29"),
    ]  # fmt: skip


def test_method_and_figures_are_folded(tmp_path, person):
    _, tracks = person
    page = written(tmp_path, tracks, made="Made so.", summary=[("method", "of mine")]).decode()
    folded = re.search("<details[^>]*><summary>How it was made</summary>(.*?)</details>", page)[1]
    for text in ("Made so.", "of mine", "Figures reported by the method", *list(tracks.info)[-1:]):
        assert text in folded
        assert text not in page.replace(folded, "").split("<script")[0]


def test_segments_are_the_rigid_clusters(tmp_path):
    truth = am.simulate.person(frames=60, seed=1)
    clusters = am.tracking.learn_bonds(truth).clusters
    segments = unpacked(written(tmp_path, truth))[1]["segments"]
    for n, cluster in enumerate(clusters):
        assert np.flatnonzero(segments == n).tolist() == sorted(cluster)


def test_strays_do_not_enlarge_the_subject():
    from asterism.reporting.page.subject import subject_of

    rng = np.random.default_rng(4)
    way = np.cumsum(rng.normal(0, 0.01, (300, 1, 3)), axis=0)
    body = rng.uniform(-1, 1, (40, 3)) * [0.3, 0.3, 0.9] + way
    alone = subject_of(tracks_of(body))
    stray = np.full((300, 2, 3), 30.0)
    stray[:, 1] = -20.0
    brief = np.full((300, 1, 3), 8.0)
    brief[40:] = np.nan
    found = subject_of(tracks_of(np.concatenate([body, stray, brief], axis=1)))
    assert np.ptp(alone.points, axis=0).max() > 1.7
    assert np.allclose(np.ptp(found.points, axis=0), np.ptp(alone.points, axis=0), atol=0.05)
    assert np.allclose(np.ptp(found.course, axis=0), np.ptp(alone.course, axis=0), atol=0.05)


def test_connections_are_those_that_keep_their_distance():
    from asterism.reporting.connections import connections_of

    rng = np.random.default_rng(3)
    body = rng.normal(0, 0.1, (5, 3))
    way = np.cumsum(rng.normal(0, 0.01, (300, 1, 3)), axis=0)
    loose = np.cumsum(rng.normal(0, 0.1, (300, 3, 3)), axis=0) + 1
    found = connections_of(tracks_of(np.concatenate([body + way, loose], axis=1)))
    assert len(found.pairs) >= 4
    assert found.pairs.max() < 5
    assert str(len(found.pairs)) in found.about


def test_lens_tables_are_as_exact_as_they_say():
    K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
    for lens in (am.camera.BrownConrady(k1=-0.3, p1=0.002), am.camera.ReportRadial(a1=0.3), None):
        camera = am.Camera.look_at((3, 1, 2), (0, 0, 1), K=K, size_px=(1280, 1024), lens=lens)
        table, bounds, error = lens_table(camera)
        if lens is None:
            assert table.size == 0
            continue
        rng = np.random.default_rng(4)
        pixels = rng.uniform([0, 0], [1279, 1023], (2000, 2))
        places = camera.undistort(pixels)
        places = places[np.isfinite(places).all(axis=1)]
        off = np.linalg.norm(
            pixels_by(camera, table, bounds, places) - camera.distort(places), axis=1
        )
        # At the very edge of what the lens reaches the table has an end.
        assert np.isfinite(off).mean() > 0.97
        assert np.nanmax(off) <= 1.1 * error + 0.01
        assert error < 1


@pytest.mark.parametrize(
    ("places", "axis"),
    [([0.0, 0.0, 1.0], "z"), ([0.0, 0.0, -0.7], "y"), ([0.0, 0.5, -0.7], "z")],
)
def test_up_follows_from_the_lowest_points(tmp_path, places, axis):
    lowest = np.array(places)
    tall = np.linspace(0, 1.7, 9)[:, None] * [0.1, 1.0, 0.1]
    page = written(tmp_path, tracks_of(np.tile(lowest + tall, (20, 1, 1))))
    if axis == "z" and places[2] == 1.0:
        axis = "y"  # z = 1 is no ground either
    assert unpacked(page)[0]["up"] == axis
    assert f"The {axis} axis is taken to point up" in text_of(page)


def test_up_follows_from_the_cameras_or_the_option(tmp_path, person):
    _, tracks = person
    K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
    cameras = [
        am.Camera.look_at(p, (0, 1, 0), K=K, size_px=(1280, 1024), up=(0, 1, 0), name=str(n))
        for n, p in enumerate([(3, 2, 0), (0, 2, 3), (-3, 2, 1)])
    ]
    assert unpacked(written(tmp_path, tracks, rig=am.Rig(tuple(cameras))))[0]["up"] == "y"
    assert unpacked(written(tmp_path, tracks, up="x"))[0]["up"] == "x"


def test_up_is_y_in_the_captures_of_programs_with_y_up(tmp_path):
    tracks = tracks_of(straight())
    capture = am.Capture(
        times=tracks.detections.times,
        offsets=tracks.detections.offsets,
        points=tracks.detections.points,
        path=tmp_path / "capture.csv",
        format="motive",
        channels=tracks.labels,
        labels=tracks.labels,
    )
    assert capture.format in am.io.CAPTURE_FORMATS  # a key that readers set
    page = written(tmp_path, dataclasses.replace(tracks, detections=capture))
    assert unpacked(page)[0]["up"] == "y"
    assert "The y axis points up, as in most files of this format." in text_of(page)


def test_long_captures_are_thinned_and_say_so(tmp_path, monkeypatch):
    monkeypatch.setattr("asterism.reporting.page.thinning.MOST_POINTS", 300)
    assert stride_for(300) == 1
    assert stride_for(301) == 2
    tracks = tracks_of(straight(200))
    page = written(tmp_path, tracks, truth=tracks)
    _, arrays = unpacked(page)
    assert np.array_equal(arrays["frames"], np.arange(0, 200, 3))
    assert np.allclose(arrays["times"], tracks.detections.times[::3])
    assert "Every third frame is shown (67 of 200)" in text_of(page)
    assert 'data-fact="tracks">4<' in page.decode()


def test_all_frames_about_the_worst_places_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("asterism.reporting.page.thinning.MOST_POINTS", 2000)
    tracks = uncertain((0, 400, 405, 0.3, []), (1, 900, 901, 0.35, []), n_frames=1500)
    page = written(tmp_path, tracks)
    _, arrays = unpacked(page)
    around = set(range(350, 455))  # half a second; the share of a page has no room for the second
    assert set(arrays["frames"].tolist()) == set(range(0, 1500, 3)) | around
    first, second = (place for place, _ in places_on(page.decode()))
    assert arrays["frames"][int(first["frame"])] == 400
    assert arrays["frames"][int(second["frame"])] == 900
    assert "Every third frame and all about the worst places" in text_of(page)


def test_far_clutter_is_counted_not_drawn(tmp_path):
    places = straight(50)
    d = am.Detections.from_frames(
        np.arange(50) / 100, [*places[:-1], np.append(places[-1], [[1e6, 0, 0]], axis=0)]
    )
    tracks = am.Tracks(detections=d, labels=np.append(np.tile(np.arange(4), 50), -1))
    page = written(tmp_path, tracks)
    assert max(unpacked(page)[0]["grid"][1]) < 1e-4
    assert "1 points of clutter are too far" in text_of(page)


def test_a_film_of_fifty_three_markers_is_small(tmp_path):
    scene = am.simulate.person(frames=600, seed=1)
    truth = am.simulate.corrupt(scene, missing=0.05, clutter=0.05, noise=0.0005, seed=1)
    K = am.camera.intrinsics(focal_length=900, principal_point=(639.5, 511.5))
    ring = am.Rig.ring(8, radius=4, height=2.5)
    rig = am.Rig(
        tuple(
            dataclasses.replace(c, K=K, lens=am.camera.BrownConrady(k1=-0.2)) for c in ring.cameras
        )
    )
    tracks = dataclasses.replace(
        truth, confidence=np.random.default_rng(1).random(len(truth.labels))
    )
    assert truth.n_tracks == 53
    assert len(written(tmp_path, tracks, truth=truth, rig=rig)) <= 1_000_000


def test_what_makes_no_sense_is_refused(tmp_path, person):
    _, tracks = person
    flat = tracks_of(straight()[:, :, :2])
    rig = am.Rig.ring(3, radius=4, height=2)
    for bad, match in (
        (lambda: am.report(tracks.detections, tmp_path / "a.html"), "tracks"),
        (lambda: am.report(flat, tmp_path / "a.html", rig=rig), "rig"),
        (lambda: am.report(tracks, tmp_path / "a.html", up="w"), "up"),
        (lambda: am.report(tracks, tmp_path / "a.html", truth=flat), "truth|detections"),
        (lambda: am.report(tracks, tmp_path / "a.html", truth=3), "truth"),
    ):
        with pytest.raises(am.ParameterError, match=match):
            bad()
    with pytest.raises(am.FormatError):
        am.report(tracks, tmp_path / "nowhere" / "a.html")
    assert list(tmp_path.iterdir()) == []


def test_the_page_opens_where_the_capture_does(tmp_path):
    # Usual are five points; a quarter of the frames is empty, then stray points come.
    counts = [0] * 30 + [1] * 10 + [2] * 10 + [3] + [5] * 60
    frames = [np.arange(3.0 * n).reshape(n, 3) for n in counts]
    d = am.Detections.from_frames(np.arange(len(counts)) / 100, frames)
    labels = np.concatenate([np.arange(n) for n in counts])
    tracks = am.Tracks(detections=d, labels=labels)
    assert unpacked(written(tmp_path, tracks))[0]["opens"] == 50
    nothing = am.Detections.from_frames([0, 0.01], [np.empty((0, 3))] * 2)
    empty = am.Tracks(detections=nothing, labels=[])
    assert unpacked(written(tmp_path, empty))[0]["opens"] == 0


def test_uncertain_names_and_changes_of_marker_are_listed(tmp_path):
    truth = am.simulate.person(frames=60, seed=1)
    naming = am.name_tracks(truth, am.learn_marker_set(truth))
    p, other = naming.probabilities.copy(), list(naming.alternatives)
    q = naming.alternative_probabilities.copy()
    p[3], q[3], other[3] = 0.6, 0.4, "LKNE"
    change = am.tracking.NameChange(track=5, first=20, last=40, usual="C7", name=truth.names[5])
    unsure = dataclasses.replace(
        naming,
        probabilities=p,
        alternatives=tuple(other),
        alternative_probabilities=q,
        changes=(change,),
    )
    found = {f.kind: f for f in find_troubles(naming.tracks, None, unsure)}
    ((place, words),) = places_on(written(tmp_path, naming.tracks, naming=unsure).decode())
    assert place["kind"] == "name"
    assert int(place["track"]) == naming.tracks.names.index(truth.names[3])
    assert f"{truth.names[3]} , frames 0 to 59: 60 %, or LKNE 40 %" in words.replace("\xa0", " ")
    assert (found["changed marker"].track, found["changed marker"].frame) == (5, 20)
    assert "frames 20 to 40: the track was on C7" in found["changed marker"].reason
