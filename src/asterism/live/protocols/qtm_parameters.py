"""Settings of the Qualisys real-time protocol: the XML that `GetParameters` returns."""

from __future__ import annotations

import re
from typing import NamedTuple
from xml.etree import ElementTree

from asterism.live.protocols.packet_error import PacketError

__all__ = ["SECTIONS", "Parameters", "encode_parameters", "read_parameters"]

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
    """

    rate: float
    names: tuple[str, ...]


def encode_parameters(
    sections: tuple[str, ...], version: str, *, names: tuple[str, ...], rate: float
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

    Examples
    --------
    >>> encode_parameters(("6d",), "1.25", names=(), rate=240.0)
    '<QTM_Parameters_Ver_1.25><The_6D><Bodies>0</Bodies></The_6D></QTM_Parameters_Ver_1.25>'
    """
    root = ElementTree.Element(f"QTM_Parameters_Ver_{version}")
    if "general" in sections:
        _general(root, rate)
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
    return ElementTree.tostring(root, encoding="unicode")


def _general(root: ElementTree.Element, rate: float) -> None:
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


def _add(parent: ElementTree.Element, tag: str, text: str) -> None:
    ElementTree.SubElement(parent, tag).text = _NOT_IN_XML.sub("", text)


def read_parameters(text: str) -> Parameters:
    """Read rate and labels from settings.

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
    Parameters(rate=240.0, names=('LASI',))
    """
    # An entity that refers to entities could grow without bound.
    if len(text) > _LONGEST or "<!DOCTYPE" in text:
        raise PacketError("settings that are too long or define entities")
    try:
        root = ElementTree.fromstring(text)
        rate = float(root.findtext("General/Frequency") or 0.0)
    except (ElementTree.ParseError, ValueError) as error:
        raise PacketError(f"settings that cannot be read: {error}") from None
    names = tuple(label.findtext("Name") or "" for label in root.iterfind("The_3D/Label"))
    return Parameters(rate if 0 < rate < 1e6 else 0.0, names)
