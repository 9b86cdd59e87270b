"""The one list of calibration formats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.io.calibrations import anipose, caliscope, flydra, myptv, opencv, qca, rig_toml, xcp
from asterism.records import Registry, record

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from asterism.camera import Rig

__all__ = ["CALIBRATION_FORMATS", "CalibrationFormat"]


@record
class CalibrationFormat:
    """File format of calibrations.

    Parameters
    ----------
    name : str
        Key in `CALIBRATION_FORMATS`.
    extensions : tuple of str
        Suffixes of file names; empty for a folder format.
    description : str
        Description in one line.
    lens : {"any", "BrownConrady", "ViconRadial", "QuadraticCorrection"}
        Lens model that the format can hold.
    read : callable
        Function from a path, and a unit of length or None, to a `Rig`.
    write : callable
        Function from a `Rig` to the content of the file, or to the names and contents of the files
        of a folder.
    sniff : callable or None
        Function of the first bytes of a file: whether they are of this format. None for a format
        that is always a folder.
    sniff_folder : callable or None
        Function of a folder: whether it is of this format. None for a format of single files.
    unit : {"mm", "m"} or None
        Unit of length of all files by definition; None if files state it or differ.
    has_skew, has_k3 : bool
        Whether the format can hold a K with skew, and a `BrownConrady` lens with k3.

    Examples
    --------
    >>> import asterism as am
    >>> am.io.CALIBRATION_FORMATS["xcp"].lens
    'ViconRadial'
    >>> am.io.CALIBRATION_FORMATS["flydra"].is_folder
    True
    """

    name: str
    extensions: tuple[str, ...]
    description: str
    lens: str
    read: Callable[[Path, str | None], Rig]
    write: Callable[[Rig], bytes | dict[str, bytes]]
    sniff: Callable[[bytes], bool] | None = None
    sniff_folder: Callable[[Path], bool] | None = None
    unit: str | None = None
    has_skew: bool = True
    has_k3: bool = True

    @property
    def is_folder(self) -> bool:
        """Whether a rig is written as a folder of files."""
        return not self.extensions


CALIBRATION_FORMATS: dict[str, CalibrationFormat] = Registry(
    (c.name, c)
    for c in (
        CalibrationFormat(
            name="rig",
            extensions=(".toml",),
            description="TOML of Asterism; keeps everything",
            lens="any",
            read=rig_toml.read,
            write=rig_toml.write,
            sniff=rig_toml.sniff,
            unit="m",
        ),
        CalibrationFormat(
            name="caliscope",
            extensions=(".toml",),
            description="camera_array.toml of caliscope",
            lens="BrownConrady",
            read=caliscope.read,
            write=caliscope.write,
            sniff=caliscope.sniff,
            unit="m",
            has_skew=False,
        ),
        CalibrationFormat(
            name="anipose",
            extensions=(".toml",),
            description="TOML of anipose and freemocap",
            lens="BrownConrady",
            read=anipose.read,
            write=anipose.write,
            sniff=anipose.sniff,
            has_skew=False,
        ),
        CalibrationFormat(
            name="opencv",
            extensions=(".yml", ".yaml"),
            description="YAML of OpenCV's FileStorage",
            lens="BrownConrady",
            read=opencv.read,
            write=opencv.write,
            sniff=opencv.sniff,
            has_skew=False,
        ),
        CalibrationFormat(
            name="qca",
            extensions=(".qca.txt", ".qca"),
            description="XML as Qualisys Track Manager exports it",
            lens="BrownConrady",
            read=qca.read,
            write=qca.write,
            sniff=qca.sniff,
            unit="mm",
            has_skew=False,
        ),
        CalibrationFormat(
            name="xcp",
            extensions=(".xcp",),
            description="XML of Vicon",
            lens="ViconRadial",
            read=xcp.read,
            write=xcp.write,
            sniff=xcp.sniff,
            unit="mm",
            has_skew=False,
        ),
        CalibrationFormat(
            name="flydra",
            extensions=(),
            description="folder of flydra and the Multi-Camera Self-Calibration toolbox",
            lens="BrownConrady",
            read=flydra.read,
            write=flydra.write,
            sniff_folder=flydra.sniff_folder,
            has_skew=False,  # beside a lens
            has_k3=False,
        ),
        CalibrationFormat(
            name="myptv",
            extensions=(),
            description="folder of MyPTV's Tsai camera files, or one of them",
            lens="QuadraticCorrection",
            read=myptv.read,
            write=myptv.write,
            sniff=myptv.sniff,
            sniff_folder=myptv.sniff_folder,
        ),
    )
)
