"""The generative model: motion, sensor and population in one, read from and written to TOML."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from asterism.checks import check_fields
from asterism.errors import FormatError, ParameterError
from asterism.model.interacting_motions import InteractingMotions
from asterism.model.linear_motion import LinearMotion
from asterism.model.motion import DWNA, DWPA, Motion, RandomWalk
from asterism.model.population import Population
from asterism.model.sensor import Sensor
from asterism.model.toml_file import read_toml, write_toml
from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["MOTIONS", "TrackingModel"]

MOTIONS: dict[str, type[Motion]] = {
    motion.kind: motion for motion in (DWNA, RandomWalk, DWPA, LinearMotion, InteractingMotions)
}
"""Every motion by its name in a model file: the one place to register a new one."""


@record
class TrackingModel:
    """How detections come about; every method searches its posterior.

    Parameters
    ----------
    motion : Motion
        How a marker moves.
    sensor : Sensor
        What is seen of it, and what else is seen.
    population : Population
        How markers come and go.

    Examples
    --------
    >>> from asterism import DWNA, Population, Sensor
    >>> model = TrackingModel(
    ...     motion=DWNA(acceleration_sigma=30),
    ...     sensor=Sensor(noise_sigma=3e-4, p_detection=0.95, clutter_density=0.1),
    ...     population=Population(
    ...         birth_density=0.01, p_disappear=1e-3, max_speed=8, max_gap=10))
    >>> TrackingModel.from_dict(model.to_dict()) == model
    True
    """

    motion: Motion
    sensor: Sensor
    population: Population

    def __repr__(self) -> str:
        sensor, population = self.sensor, self.population
        return (
            f"TrackingModel(noise {1e3 * sensor.noise_sigma:.3g} mm, P_d {sensor.p_detection:.4g}, "
            f"clutter {sensor.clutter_density:.3g}/m^D, gaps ≤ {population.max_gap} frames, "
            f"speeds ≤ {population.max_speed:.3g} m/s, {self.motion!r})"
        )

    def __post_init__(self) -> None:
        for name, kind in (("motion", Motion), ("sensor", Sensor), ("population", Population)):
            if not isinstance(getattr(self, name), kind):
                raise ParameterError(name, f"a {kind.__name__}", repr(getattr(self, name)))

    def velocity_sigma(self, n_axes: int) -> float:
        """Prior standard deviation of a velocity coordinate, m/s.

        Where the motion model leaves it open: that of velocities spread evenly over the ball of
        radius v̄, ``v̄ / √(D + 2)``.

        Parameters
        ----------
        n_axes : int
            D, 2 or 3.
        """
        own = getattr(self.motion.modes[0], "velocity_sigma", None)
        return float(own) if own else self.population.max_speed / (n_axes + 2) ** 0.5

    def initial_covariance(self, n_axes: int) -> NDArray[np.float64]:
        """Covariance of one axis' state after a first detection, shape (n, n)."""
        return self.motion.modes[0].initial_covariance(
            self.sensor.noise_sigma, self.velocity_sigma(n_axes)
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Give the model as nested plain values, as it stands in a TOML file."""
        return {name: _to_plain(getattr(self, name)) for name in _TABLES}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make a model from nested plain values; the inverse of `to_dict`.

        Raises
        ------
        ParameterError
            At an unknown, missing or impossible value.
        """
        if not isinstance(values, dict):
            raise ParameterError("model", "a table", repr(values))
        check_fields("model", map(str, values), _TABLES)
        return cls(
            motion=_motion("model.motion", values.get("motion")),
            sensor=_part("model.sensor", Sensor, values.get("sensor")),
            population=_part("model.population", Population, values.get("population")),
        )

    def to_toml(self, path: str | Path | None = None) -> str:
        """Give the model as TOML text, and write it to `path` where one is given.

        Parameters
        ----------
        path : path, optional
            File to write; replaced as a whole.

        Returns
        -------
        str
            The text.
        """
        return write_toml(self.to_dict(), path)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a model from a TOML file.

        Raises
        ------
        FormatError
            If the file is not TOML or does not hold a model.
        """
        content = read_toml(path, "a model file")
        try:
            return cls.from_dict(content)
        except ParameterError as error:
            raise FormatError(
                Path(path), error.name, error.expected, error.got, error.hint
            ) from error


_TABLES = ("motion", "sensor", "population")


def _to_plain(part: Any) -> dict[str, Any]:
    """Give a part of the model as TOML can hold it."""
    values: dict[str, Any] = {"kind": part.kind} if isinstance(part, Motion) else {}
    for f in dataclasses.fields(cast(Any, part)):
        value = getattr(part, f.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, tuple):
            value = [_to_plain(item) for item in value]
        if value is not None:
            values[f.name] = value
    return values


def _part(name: str, kind: type[Any], table: object) -> Any:
    if not isinstance(table, dict):
        raise ParameterError(name, "a table", repr(table))
    fields = dataclasses.fields(kind)
    check_fields(name, table, [f.name for f in fields])
    for f in fields:
        if f.name not in table and f.default is dataclasses.MISSING:
            raise ParameterError(f"{name}.{f.name}", "a value", "nothing")
    return kind(**table)


def _motion(name: str, table: object) -> Motion:
    if not isinstance(table, dict):
        raise ParameterError(name, "a table", repr(table))
    values = dict(table)
    kind = values.pop("kind", None)
    check_fields(f"{name}.kind", [kind], MOTIONS)
    if "models" in values:
        models = values["models"]
        if not isinstance(models, list):
            raise ParameterError(f"{name}.models", "an array of tables", repr(models))
        values["models"] = tuple(_motion(f"{name}.models[{i}]", m) for i, m in enumerate(models))
    return _part(name, MOTIONS[kind], values)
