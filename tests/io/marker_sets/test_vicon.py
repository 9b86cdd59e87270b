"""Marker sets of Vicon: distances computed by hand, damaged files, and real templates."""

from __future__ import annotations

import re

import numpy as np
import pytest

import asterism as am
from asterism.io.marker_sets.expressions import evaluate, fields
from asterism.metrics import name_scores
from tests.io.marker_sets.models import PARAMETERS, model
from tests.paths import ROOT

SETS = ROOT.parent / "shared" / "markersets"
real = pytest.mark.skipif(not SETS.is_dir(), reason="needs the marker sets beside the project")


@pytest.fixture
def read(tmp_path):
    def _read(text, name="a.vst"):
        (tmp_path / name).write_text(text)
        return am.io.read_marker_set(tmp_path / name)

    return _read


def distance(made, first, second, table="distances"):
    return getattr(made, table)[made.names.index(first), made.names.index(second)]


@pytest.mark.parametrize("version", ["2.5", "3.2"])
def test_distances_and_places(read, version):
    made = read(model(version=version))
    assert made.names == ("LASI", "RASI", "LKNE", "LANK", "LTIB", "LMED")
    assert made.segments == ("Pelvis", "Pelvis", "Thigh", "Shank", "Shank", "Shank")
    # Within a segment: exact, whatever the posture. ASI to ASI twice 0.1 m, ANK to TIB the root of
    # 0.05² + 0.15², ANK to MED 0.04 m.
    assert distance(made, "LASI", "RASI") == pytest.approx(0.2)
    assert distance(made, "LANK", "LTIB") == pytest.approx(np.hypot(0.05, 0.15))
    assert distance(made, "LANK", "LMED") == pytest.approx(0.04)
    assert distance(made, "LANK", "LTIB", "movements") == pytest.approx(0, abs=1e-9)
    # LKNE lies on the axis of the knee, so that the shank turns without change of the distance.
    assert distance(made, "LKNE", "LANK") == pytest.approx(np.hypot(0.05, 0.3))
    assert distance(made, "LKNE", "LANK", "movements") == pytest.approx(0, abs=1e-9)
    # LASI lies at the hip joint: 0.7 m from LANK while the leg is straight, else less.
    assert 0.66 < distance(made, "LASI", "LANK") < 0.7
    assert 0.005 < distance(made, "LASI", "LANK", "movements") < 0.04
    assert distance(made, "LASI", "LKNE") == pytest.approx(np.hypot(0.05, 0.4))
    assert distance(made, "RASI", "LKNE", "movements") > 0.01
    # The root turns y up into z up, and x into -x.
    assert made.up == "z"
    np.testing.assert_allclose(made.places[0], [-0.1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(made.places[2], [-0.15, 0, -0.4], atol=1e-9)
    np.testing.assert_allclose(made.places[3], [-0.1, 0, -0.7], atol=1e-9)
    assert made.presences.tolist() == [1, 1, 1, 1, 0.5, 0]
    assert np.isfinite(made.heights).all()


def test_the_same_bytes(read):
    assert read(model()).to_toml() == read(model()).to_toml()


def test_a_calibrated_subject_varies_less(read):
    template = read(model())
    sizes = PARAMETERS | {"Shank": (330, 300)}
    subject = read(model(parameters=sizes), "a.vsk")
    assert distance(subject, "LANK", "LTIB") == pytest.approx(np.hypot(0.05, 0.165))
    off = ~np.eye(6, dtype=bool)
    assert (subject.variations < template.variations)[off].all()


def test_a_fixed_joint_is_rigid(read):
    made = read(model(knee='<JointDummy PRE-POSITION="0 -Thigh 0"/>'))
    assert distance(made, "LASI", "LANK") == pytest.approx(0.7)
    assert distance(made, "LASI", "LANK", "movements") == pytest.approx(0, abs=1e-9)


def test_arms_in_a_t_pose_hang(read):
    arms = "".join(
        f'<Segment NAME="{side}Collar"><JointBall PRE-POSITION="0 0 500"/>'
        f'<Segment NAME="{side}Upper"><JointBall PRE-POSITION="0 {sign}150 0"/>'
        f'<Segment NAME="{side}Fore"><JointHinge AXIS="0 0 1" PRE-POSITION="0 {sign}280 0"/>'
        "</Segment></Segment></Segment>"
        for side, sign in (("L", ""), ("R", "-"))
    )
    markers = "".join(
        f'<Marker NAME="{side}{name}" SEGMENT="{side}{segment}" POSITION="0 {sign}{y} 0"/>'
        for side, sign in (("L", ""), ("R", "-"))
        for name, segment, y in (
            ("SHO", "Collar", 150),
            ("ELB", "Upper", 280),
            ("WRI", "Fore", 250),
        )
    )
    made = read(
        '<KinematicModel><Skeleton><Segment NAME="Trunk"><JointFree/>'
        f"{arms}</Segment></Skeleton><MarkerSet><Markers>{markers}</Markers></MarkerSet>"
        "</KinematicModel>"
    )
    place = dict(zip(made.names, made.places, strict=True))
    np.testing.assert_allclose(place["LSHO"], [0, 0.15, 0.5], atol=1e-9)
    down = np.radians(80)  # from 150 mm beside the middle, 280 mm along the upper arm
    expected = [0, 0.15 + 0.28 * np.cos(down), 0.5 - 0.28 * np.sin(down)]
    np.testing.assert_allclose(place["LELB"], expected, atol=1e-9)
    np.testing.assert_allclose(place["RWRI"], place["LWRI"] * [1, -1, 1], atol=1e-9)
    assert place["LWRI"][2] < 0


@pytest.mark.parametrize(
    ("text", "value"),
    [("2", 2), ("-A/2", -1.5), ("( 0.5 * A ) - 48.5", -47), ("2*(A+'B c')-1", 15), ("- -A", 3),
     ("sqrt(A*A)+cos( 0 )", 4), ("1.5e2", 150), ("8/2/2", 2), ("8-2-2", 4)],
)  # fmt: skip
def test_expressions(text, value):
    assert evaluate(text, {"A": 3.0, "B c": 5.0}.__getitem__) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    ["", "1 2", "(1", "1)", "*2", "2*", "__import__('os')", "a.b", "1/0", "sqrt(-1)", "9" * 2000,
     "(" * 30 + "1" + ")" * 30],
)  # fmt: skip
def test_what_is_no_expression(text):
    with pytest.raises((ValueError, ArithmeticError)):
        evaluate(text, lambda name: 1.0 if name == "a" else 1 / 0)


def test_fields_of_a_vector():
    assert fields("0  -'a b'/2\n( A + B )") == ["0", "-'a b'/2", "( A + B )"]


CASES = {
    "empty": ("", "line 1"),
    "cut": (model()[:900], "XML"),
    "calibration": ("<Cameras/>", "<KinematicModel>"),
    "entities": ("<!DOCTYPE l [<!ENTITY a 'b'>]><KinematicModel>&a;</KinematicModel>", "structure"),
    "deep": ('<KinematicModel><Skeleton>' + '<Segment NAME="a">' * 100_000, "structure"),
    "no markers": ("<KinematicModel/>", "markers with a segment"),
    "unknown name": (model(knee_marker="0 Foo 0"), "marker LKNE.*parameter 'Foo'|parameter 'Foo'"),
    "itself": (model(parameters=PARAMETERS | {"Thigh": ("Thigh", "")}), "refers to itself"),
    "two numbers": (model(knee_marker="0 0"), "marker LKNE, POSITION: expected 3 numbers"),
    "far": (model(knee_marker="0 0 20000"), "up to 10000"),
    "huge": (model(knee_marker="0 1e308*1e308 0"), "finite"),
    "joint": (model(knee="<JointMagic/>"), "segment Shank: expected one of JointFree"),
    "no joint": (model(knee=""), "segment Shank"),
    "axis": (model(knee='<JointHinge AXIS="0 0 0"/>'), "segment Shank, AXIS"),
    "no segment": (model(more='<Marker NAME="X" SEGMENT="Hat" POSITION="0 0 0"/>'), "SEGMENT.*Hat"),
    "twice": (model(more='<Marker NAME="LASI"/>'), "each name once"),
    "status": (model(more='<Marker NAME="X" STATUS="maybe"/>'), "STATUS.*maybe"),
    "nameless": (model(more="<Marker/>"), "a NAME"),
    "many": (model(more="".join(f'<Marker NAME="m{i}"/>' for i in range(600))), "at most 500"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_damaged_files(read, case):
    text, expected = CASES[case]
    with pytest.raises(am.FormatError) as caught:
        read(text)
    message = str(caught.value)
    assert "a.vst: " in message
    assert re.search(expected, message), message


def test_content_decides(read):
    assert read(model(), "set.toml").names[0] == "LASI"
    toml = read(model()).to_toml()
    assert read(toml, "set.txt").names[0] == "LASI"


@pytest.mark.data
@real
@pytest.mark.parametrize(
    ("model_file", "capture"),
    [("59993_Frame/59993_Frame_SM.vsk", "59993_Frame/59993_Frame_Static.c3d"),
     ("ROM/Sample_SM.vsk", "ROM/Sample_Static.c3d"),
     ("Sample_2/RoboSM.vsk", "Sample_2/RoboStatic.c3d")],
)  # fmt: skip
def test_real_subjects(model_file, capture):
    folder = SETS / "cadop__pyCGM"
    made = am.io.read_marker_set(folder / model_file)
    truth = am.read(folder / capture).tracks
    own = [name.rpartition(":")[2] if name else None for name in truth.names]
    learnt = am.learn_marker_set(truth)
    # Rigid: two markers of the pelvis, and a marker of the thigh to the knee.
    for first, second in (("LASI", "RASI"), ("LASI", "LPSI"), ("LTHI", "LKNE")):
        difference = distance(made, first, second) - distance(learnt, first, second)
        assert abs(difference) < 0.005, (first, second)
    named = am.name_tracks(truth, made)
    # The file does not determine which marker of a wrist is which.
    wrong = {a for a, b in zip(own, named.markers, strict=True) if a and b and a != b}
    assert wrong <= {"LWRA", "LWRB", "RWRA", "RWRB"}


@pytest.mark.data
@real
@pytest.mark.parametrize("subject", ["HC031A/Straight/HC031A06.c3d", "HC036A/Turn/HC036A23.c3d"])
def test_real_template_names_gait(subject):
    made = am.io.read_marker_set(SETS / "pyCGM2__pyCGM2" / "pyCGM2-FullBody_CGM1_medial.vst")
    truth = am.read(SETS / "mcgillmotionlab__biomechzoo" / subject).tracks
    truth = truth.select([k for k, name in enumerate(truth.names) if name in made.names])
    naming = am.name_tracks(truth, made)
    wrong = [(a, b) for a, b in zip(truth.names, naming.markers, strict=True) if b and a != b]
    assert not wrong
    own = name_scores(naming.tracks.labels, truth.labels, naming.tracks.names, truth.names)
    assert own.swapped_sides_percent == 0
    assert own.name_f1 >= 0.97
