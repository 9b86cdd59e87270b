"""Generative model of motion, sensor and population, read from and written to TOML files."""

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
"""Motion classes by their names in a model file; a new motion is registered here."""


@record
class TrackingModel:
    """Generative model of the detections, whose posterior every method searches.

    Parameters
    ----------
    motion : Motion
        Motion of a marker.
    sensor : Sensor
        Measurement noise, missed detections and clutter.
    population : Population
        Births and deaths of markers, and the bounds of a track.

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
        """Return the default prior standard deviation of a velocity coordinate, m/s.

        It is used if the motion has no `velocity_sigma`: ``v̄ / √(D + 2)``, the standard deviation
        for velocities distributed uniformly in the ball of radius v̄.

        Parameters
        ----------
        n_axes : int
            Number of coordinates D, 2 or 3.

        Examples
        --------
        >>> import asterism as am
        >>> model = am.TrackingModel(
        ...     motion=am.RandomWalk(walk_sigma=0.1),
        ...     sensor=am.Sensor(noise_sigma=3e-4, p_detection=0.95, clutter_density=0.1),
        ...     population=am.Population(
        ...         birth_density=0.01, p_disappear=1e-3, max_speed=8, max_gap=10),
        ... )
        >>> model.velocity_sigma(2)
        4.0
        """
        own = getattr(self.motion.modes[0], "velocity_sigma", None)
        return float(own) if own else self.population.max_speed / (n_axes + 2) ** 0.5

    def initial_covariance(self, n_axes: int) -> NDArray[np.float64]:
        """Return the covariance of one axis' state after a first detection, shape (n, n).

        Parameters
        ----------
        n_axes : int
            Number of coordinates, 2 or 3, from which the prior of the velocity follows.

        Examples
        --------
        >>> import asterism as am
        >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
        >>> model.initial_covariance(3).shape
        (2, 2)
        """
        return self.motion.modes[0].initial_covariance(
            self.sensor.noise_sigma, self.velocity_sigma(n_axes)
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return the model as nested plain values, in the form of a TOML file.

        Examples
        --------
        >>> import asterism as am
        >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
        >>> list(model.to_dict())
        ['motion', 'sensor', 'population']
        """
        return {name: _to_plain(getattr(self, name)) for name in _TABLES}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Build a model from nested plain values; the inverse of `to_dict`.

        Parameters
        ----------
        values : mapping
            Content of a model file by section.

        Raises
        ------
        ParameterError
            If a value is unknown, missing or impossible.

        Examples
        --------
        >>> import asterism as am
        >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
        >>> am.TrackingModel.from_dict(model.to_dict()) == model
        True
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
        """Return the model as TOML text, and write it to `path` if one is given.

        Parameters
        ----------
        path : path, optional
            File to write. An existing file is replaced.

        Returns
        -------
        str
            The text.

        Examples
        --------
        >>> import asterism as am
        >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
        >>> model.to_toml().splitlines()[0]
        '[motion]'
        """
        return write_toml(self.to_dict(), path)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a model from a TOML file.

        Parameters
        ----------
        path : path
            File of `to_toml`.

        Raises
        ------
        FormatError
            If the file is not TOML or does not contain a model.

        Examples
        --------
        >>> import asterism as am
        >>> from tempfile import TemporaryDirectory
        >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
        >>> with TemporaryDirectory() as folder:
        ...     text = model.to_toml(f"{folder}/model.toml")
        ...     am.TrackingModel.from_toml(f"{folder}/model.toml") == model
        True
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
    """Return a part of the model as plain values that TOML can represent."""
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
