"""Small skeletons as Vicon writes them, with sizes that a test can compute by hand."""

PARAMETERS = {"Thigh": (400, 400), "Shank": (300, 300), "HalfWidth": (100, 100)}


def model(
    *,
    version: str = "3.2",
    parameters: dict[str, tuple[object, object]] | None = None,
    knee: str = '<JointHinge AXIS="1 0 0" PRE-POSITION="0 -Thigh 0" T="*"/>',
    knee_marker: str = "HalfWidth/2 -Thigh 0",
    more: str = "",
) -> str:
    """Return a pelvis with a thigh and a shank, y up in the segments, z up in the world.

    Markers: LASI and RASI on the pelvis, LKNE on the thigh, LANK on the shank, LMED for the
    calibration alone, LTIB optional.
    """
    sizes = "".join(
        f'<Parameter NAME="{name}" VALUE="{value}" PRIOR="{prior}"/>'
        for name, (value, prior) in (parameters or PARAMETERS).items()
    )
    markers = {
        "LASI": ("Pelvis", "HalfWidth 0 0", "required"),
        "RASI": ("Pelvis", "-HalfWidth 0 0", "required"),
        "LKNE": ("Thigh", knee_marker, "required"),
        "LANK": ("Shank", "0 -Shank 0", "required"),
        "LTIB": ("Shank", "( HalfWidth / 2 ) -Shank/2 0", "optional"),
        "LMED": ("Shank", "'HalfWidth'*sin(0) -Shank 40", "constraint"),
    }
    if version == "2.5":
        listed = "".join(
            f'<Marker NAME="{name}" SEGMENT="{segment}" STATUS="{status}">'
            f'<MarkerTemplate POSITION="{place}"/></Marker>'
            for name, (segment, place, status) in markers.items()
        )
        targets = ""
    else:
        listed = "".join(
            f'<Marker NAME="{name}" STATUS="{status}"/>' for name, (_, _, status) in markers.items()
        )
        targets = "".join(
            f'<TargetLocalPointToWorldPoint MARKER="{name}" SEGMENT="{segment}"'
            f' POSITION="{place}"/>'
            for name, (segment, place, _) in markers.items()
        )
    return (
        f'<?xml version="1.0"?><KinematicModel MODEL="legs" VERSION="{version}">'
        f"<Parameters>{sizes}</Parameters><Skeleton>"
        '<Segment NAME="Pelvis"><JointFree T="* * * * * *"'
        ' PRE-ORIENTATION="0 2.2214414690791831 2.2214414690791831"/>'
        '<Segment NAME="Thigh"><JointBall PRE-POSITION="HalfWidth 0 0" T="* * *"/>'
        f'<Segment NAME="Shank">{knee}</Segment></Segment></Segment></Skeleton>'
        f"<MarkerSet><Markers>{listed}{more}</Markers></MarkerSet>"
        f"<TargetSet><Targets>{targets}</Targets></TargetSet></KinematicModel>"
    )
