"""The generative model: motion, sensor and population in one, read from and written to TOML."""

from __future__ import annotations

import dataclasses
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from asterism.errors import FormatError, ParameterError, check_fields
from asterism.model.motion import MOTIONS, Motion
from asterism.model.population import Population
from asterism.model.sensor import Sensor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["TrackingModel"]


@dataclass(frozen=True, kw_only=True)
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
        own = getattr(self.motion, "velocity_sigma", None)
        return float(own) if own else self.population.max_speed / (n_axes + 2) ** 0.5

    def initial_covariance(self, n_axes: int) -> NDArray[np.float64]:
        """Covariance of one axis' state after a first detection, shape (n, n)."""
        return self.motion.initial_covariance(self.sensor.noise_sigma, self.velocity_sigma(n_axes))

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Give the model as nested plain values, as it stands in a TOML file."""

        def plain(part: Any) -> dict[str, Any]:
            values = {f.name: getattr(part, f.name) for f in dataclasses.fields(part)}
            return {
                name: value.tolist() if isinstance(value, np.ndarray) else value
                for name, value in values.items()
                if value is not None
            }

        return {
            "motion": {"kind": self.motion.kind, **plain(self.motion)},
            "sensor": plain(self.sensor),
            "population": plain(self.population),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make a model from nested plain values; the inverse of `to_dict`.

        Raises
        ------
        ParameterError
            At an unknown, missing or impossible value.
        """
        check_fields("model", values, ("motion", "sensor", "population"))
        tables: dict[str, dict[str, Any]] = {}
        for name in ("motion", "sensor", "population"):
            table = values.get(name)
            if not isinstance(table, dict):
                raise ParameterError(f"model.{name}", "a table", repr(table))
            tables[name] = dict(table)
        kind = tables["motion"].pop("kind", None)
        if kind not in MOTIONS:
            raise ParameterError("motion.kind", f"one of {', '.join(MOTIONS)}", repr(kind))
        types: dict[str, type[Any]] = {
            "motion": MOTIONS[kind], "sensor": Sensor, "population": Population
        }  # fmt: skip
        parts: dict[str, Any] = {}
        for name, table in tables.items():
            fields = dataclasses.fields(types[name])
            check_fields(f"model.{name}", table, [f.name for f in fields])
            for f in fields:
                has_default = f.default is not dataclasses.MISSING
                if f.name not in table and not has_default:
                    raise ParameterError(f"model.{name}.{f.name}", "a value", "nothing")
            parts[name] = types[name](**table)
        return cls(**parts)

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
        import tomli_w

        text = tomli_w.dumps(self.to_dict())
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a model from a TOML file.

        Raises
        ------
        FormatError
            If the file is not TOML or does not hold a model.
        """
        path = Path(path)
        try:
            return cls.from_dict(tomllib.loads(path.read_text(encoding="utf-8")))
        except UnicodeDecodeError as error:
            raise FormatError(path, f"byte {error.start}", "UTF-8 text", error.reason) from error
        except tomllib.TOMLDecodeError as error:
            raise FormatError(path, "the file", "TOML", str(error)) from error
        except ParameterError as error:
            raise FormatError(path, error.name, error.expected, error.got, error.hint) from error
