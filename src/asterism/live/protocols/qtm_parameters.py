"""Settings of the Qualisys real-time protocol: the XML that `GetParameters` returns."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

from asterism.errors import FormatError
from asterism.io.calibrations import qca
from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from asterism.camera import Rig

__all__ = ["SECTIONS", "Parameters", "encode_parameters", "read_calibration", "read_parameters"]

SECTIONS = (
    "general",
    "3d",
    "6d",
    "analog",
    "force",
    "image",
    "gazevector",
    "eyetracker",
    "skeleton",
    "skeleton:global",
    "calibration",
)
"""Lower-case names of the sections that clients may ask for."""
_COLOUR = "16777215"  # white: three bytes, red lowest
_LONGEST = 4 * 2**20  # characters
_NOT_IN_XML = re.compile("[^\\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Parameters(NamedTuple):
    """What a source needs of the settings.

    Attributes
    ----------
    rate : float
        Frame rate of the measurement, Hz; 0 if it is not stated.
    names : tuple of str
        Labels in the order of the component of labelled markers.
    cameras : tuple of str
        Serial numbers of the cameras in the order of the component of image points.
    """

    rate: float
    names: tuple[str, ...]
    cameras: tuple[str, ...] = ()


def encode_parameters(
    sections: tuple[str, ...],
    version: str,
    *,
    names: tuple[str, ...],
    rate: float,
    rig: Rig | None = None,
) -> str:
    """Return the settings as XML.

    Parameters
    ----------
    sections : tuple of str
        Sections that were asked for, some of `SECTIONS`. Those that a server of markers does not
        have (analog, force …) are left out, as by a Qualisys system without such devices.
    version : str
        Version of the protocol, which names the root element.
    names : tuple of str
        Labels of the markers.
    rate : float
        Frame rate, Hz.
    rig : Rig, optional
        Cameras, whose names are sent as serial numbers. Without it there is no calibration.

    Examples
    --------
    >>> encode_parameters(("6d",), "1.25", names=(), rate=240.0)
    '<QTM_Parameters_Ver_1.25><The_6D><Bodies>0</Bodies></The_6D></QTM_Parameters_Ver_1.25>'
    """
    root = ElementTree.Element(f"QTM_Parameters_Ver_{version}")
    if "general" in sections:
        _general(root, rate, rig)
    if "3d" in sections:
        part = ElementTree.SubElement(root, "The_3D")
        _add(part, "AxisUpwards", "+Z")
        _add(part, "CalibrationTime", "")
        _add(part, "Labels", str(len(names)))
        for name in names:
            label = ElementTree.SubElement(part, "Label")
            _add(label, "Name", name)
            _add(label, "RGBColor", _COLOUR)
            _add(label, "Trajectory_Type", "Measured")
        ElementTree.SubElement(part, "Bones")
    if "6d" in sections:
        part = ElementTree.SubElement(root, "The_6D")
        _add(part, "Bodies", "0")
    if "calibration" in sections and rig is not None:
        root.append(qca.encode(rig))
    return ElementTree.tostring(root, encoding="unicode")


def _general(root: ElementTree.Element, rate: float, rig: Rig | None) -> None:
    part = ElementTree.SubElement(root, "General")
    _add(part, "Frequency", str(round(rate)))
    _add(part, "Capture_Time", "0.000000")
    for trigger in ("External_Trigger", "Trigger_NO", "Trigger_NC", "Trigger_Software"):
        _add(part, f"Start_On_{trigger}", "false")
    base = ElementTree.SubElement(part, "External_Time_Base")
    for tag, text in {
        "Enabled": "false",
        "Signal_Source": "Control port",
        "Signal_Mode": "Periodic",
        "Frequency_Multiplier": "1",
        "Frequency_Divisor": "1",
        "Frequency_Tolerance": "1000",
        "Nominal_Frequency": "None",
        "Signal_Edge": "Negative",
        "Signal_Shutter_Delay": "0",
        "Non_Periodic_Timeout": "10.000000",
    }.items():
        _add(base, tag, text)
    stamp = ElementTree.SubElement(part, "External_Timestamp")
    for tag, text in {"Enabled": "false", "Type": "SMPTE", "Frequency": "30"}.items():
        _add(stamp, tag, text)
    for kind in ("Processing_Actions", "RealTime_Processing_Actions", "Reprocessing_Actions"):
        actions = ElementTree.SubElement(part, kind)
        _add(actions, "PreProcessing2D", "false")
        _add(actions, "Tracking", "3D")
        own = () if kind.startswith("Real") else ("TwinSystemMerge", "SplineFill")
        for tag in (*own, "AIM", "Track6DOF", "ForceData", "GazeVector", "SkeletonSolve"):
            _add(actions, tag, "false")
        exports = ("ExportTSV", "ExportC3D", "ExportMatlabFile", "ExportAviFile")
        for tag in () if kind.startswith("Real") else exports:
            _add(actions, tag, "false")
    ElementTree.SubElement(
        part, "EulerAngles", {"First": "Roll", "Second": "Pitch", "Third": "Yaw"}
    )
    for i, camera in enumerate(rig or ()):
        found = ElementTree.SubElement(part, "Camera")
        for tag, text in {"ID": str(i + 1), "Model": "Asterism", "Serial": camera.name}.items():
            _add(found, tag, text)
        _add(found, "Mode", "Marker")


def _add(parent: ElementTree.Element, tag: str, text: str) -> None:
    ElementTree.SubElement(parent, tag).text = _NOT_IN_XML.sub("", text)


def read_parameters(text: str) -> Parameters:
    """Read rate, labels and cameras from settings.

    Parameters
    ----------
    text : str
        XML with the sections General and 3D.

    Raises
    ------
    PacketError
        If it is not XML, is too long or defines entities.

    Examples
    --------
    >>> read_parameters(encode_parameters(("general", "3d"), "1.25", names=("LASI",), rate=240.0))
    Parameters(rate=240.0, names=('LASI',), cameras=())
    """
    root = _root(text)
    try:
        rate = float(root.findtext("General/Frequency") or 0.0)
    except ValueError as error:
        raise PacketError(f"settings that cannot be read: {error}") from None
    names = tuple(label.findtext("Name") or "" for label in root.iterfind("The_3D/Label"))
    cameras = tuple(each.findtext("Serial") or "" for each in root.iterfind("General/Camera"))
    return Parameters(rate if 0 < rate < 1e6 else 0.0, names, cameras)


def read_calibration(text: str) -> Rig:
    """Read the calibrated cameras from settings.

    Parameters
    ----------
    text : str
        XML with the section Calibration.

    Raises
    ------
    PacketError
        If it is not XML, or has no calibrated camera.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(2, radius=3, height=2)
    >>> text = encode_parameters(("calibration",), "1.25", names=(), rate=240.0, rig=rig)
    >>> read_calibration(text).names
    ('cam1', 'cam2')
    """
    calibration = _root(text).find("calibration")
    if calibration is None:
        raise PacketError("settings without a calibration")
    try:
        return qca.from_element(Path("calibration"), calibration)
    except FormatError as error:
        raise PacketError(str(error)) from None


def _root(text: str) -> ElementTree.Element:
    # An entity that refers to entities could grow without bound.
    if len(text) > _LONGEST or "<!DOCTYPE" in text:
        raise PacketError("settings that are too long or define entities")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise PacketError(f"settings that cannot be read: {error}") from None
