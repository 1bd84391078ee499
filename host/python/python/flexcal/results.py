"""What the verbs find: the files of the binary as objects, with arrays, frames and pages."""

from __future__ import annotations

import html
import json
import os
import warnings
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from ._arrays import FloatArray, from_columns, read_only
from ._files import write_new
from .errors import DeviceError, UntrustedResult, UsageError
from .robots import Robot, robot_from_text

if TYPE_CHECKING:
    import pandas

__all__ = ["Calibration", "Check", "Diagnosis", "Observation", "Result", "Verification", "load_calibration"]


class Result:
    """What a verb found. `to_dict` is all of it, in the names and units of the file that the binary writes with `-o`."""

    def __init__(self, native: _native.Outcome) -> None:
        self._native = native

    @cached_property
    def _dict(self) -> dict[str, Any]:
        result: dict[str, Any] = json.loads(self._native.json)
        return result

    def to_dict(self) -> dict[str, Any]:
        """The whole result as JSON has it; a copy."""
        copy: dict[str, Any] = json.loads(self._native.json)
        return copy

    def to_json(self) -> str:
        """The text of the file that the binary writes with `-o`."""
        return self._native.json

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes the file that the binary writes with `-o`; an existing file is only replaced with `force`."""
        return write_new(path, self._native.json.encode(), force)

    def page(self) -> str:
        """The page that the binary writes with `--report`: one self-contained HTML file."""
        return self._native.page()

    def save_page(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes `page`; an existing file is only replaced with `force`."""
        return write_new(path, self.page().encode(), force)

    def _repr_html_(self) -> str:
        """The page inside of a notebook; its script sees nothing of the notebook."""
        page = html.escape(self.page(), quote=True)
        return f'<iframe sandbox="allow-scripts" style="width: 100%; height: 640px; border: 0" srcdoc="{page}"></iframe>'

    def _summary(self) -> str:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._summary()}>"


class Check(Result):
    """Whether a recording is fit for calibration."""

    @property
    def usable(self) -> bool:
        """Whether it is."""
        return bool(self._dict["usable"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """What is wrong or worth knowing, the worst first: `severity`, `about`, `channel`, `message`, `advice`."""
        return list(self._dict["findings"])

    def _summary(self) -> str:
        return ("fit" if self.usable else "not fit") + f" for calibration, {len(self.findings)} findings"


class Calibration(Result):
    """Parameters of a robot, with their errors, from recordings of it.

    Rows of `estimates`, `std_errors` and `ci95` are in the order of `names`. `calibration["k_s[2]"]` is one estimate.
    """

    @property
    def status(self) -> str:
        """`converged`, `almost`, `unidentifiable` (usable), `does_not_fit`, `no_progress` or `iteration_limit` (not)."""
        return str(self._dict["status"])

    @property
    def is_usable(self) -> bool:
        """Whether the estimates may be used."""
        return self.status in ("converged", "almost", "unidentifiable")

    @property
    def misfit(self) -> list[str]:
        """What does not fit, in sentences."""
        return list(self._dict["misfit"])

    @property
    def names(self) -> list[str]:
        """Names of the parameters, as `k_s[2]`."""
        return [parameter["name"] for parameter in self._dict["parameters"]]

    @property
    def units(self) -> list[str]:
        """Their units."""
        return [parameter["unit"] for parameter in self._dict["parameters"]]

    @cached_property
    def estimates(self) -> FloatArray:
        """Estimates in `units`, shape (parameters,)."""
        return _array(parameter["estimate"] for parameter in self._dict["parameters"])

    @cached_property
    def std_errors(self) -> FloatArray:
        """Standard errors in `units`, shape (parameters,); NaN where the motion does not show the parameter."""
        return _array(parameter["std_error"] for parameter in self._dict["parameters"])

    @cached_property
    def ci95(self) -> FloatArray:
        """95 % intervals in `units`, shape (parameters, 2); NaN where the motion does not show the parameter."""
        rows = [parameter["ci95"] or (None, None) for parameter in self._dict["parameters"]]
        return np.array(rows, dtype=np.float64).reshape(-1, 2)

    @property
    def covariance_names(self) -> list[str]:
        """The identifiable parameters, in the order of `covariance`."""
        return list(self._dict["covariance"]["parameters"])

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the identifiable parameters in the products of their units, shape (identifiable, identifiable)."""
        matrix = np.array(self._dict["covariance"]["matrix"], dtype=np.float64)
        return matrix if matrix.size else np.empty((0, 0))

    @property
    def parameters(self) -> pandas.DataFrame:
        """A row a parameter: `unit`, `initial`, `estimate`, `std_error`, `low95`, `high95`, `identifiable`.

        A data frame where pandas is installed, else a list of dictionaries as in `to_dict`.
        """
        rows: Any = self.to_dict()["parameters"]
        try:
            import pandas
        except ImportError:
            return rows
        columns: dict[str, Any] = {key: [row[key] for row in rows] for key in ("unit", "initial", "estimate")}
        columns |= {"std_error": self.std_errors, "low95": self.ci95[:, 0], "high95": self.ci95[:, 1]}
        columns["identifiable"] = [row["identifiable"] for row in rows]
        return pandas.DataFrame(columns, index=pandas.Index(self.names, name="parameter"))

    @property
    def rotations(self) -> dict[str, FloatArray]:
        """Matrices that take body axes to sensor axes, by gyro (`imu1` …), each of shape (3, 3)."""
        return {name: np.array(rows, dtype=np.float64) for name, rows in self._dict["rotations"].items()}

    @property
    def robot(self) -> Robot:
        """The description that was used."""
        return robot_from_text(self._dict["robot_toml"])

    def export(self, format: str) -> tuple[str, list[str]]:
        """The calibrated model for another tool, and what it loses there: `robot` (description file), `mjcf`, `urdf` or `rust`."""
        return _native.export(self._native.json, format)

    def __getitem__(self, name: str) -> float:
        """The estimate of a parameter by its name."""
        try:
            return float(self.estimates[self.names.index(name)])
        except ValueError:
            raise UsageError(f"there is no parameter {name!r}", f"the parameters are {', '.join(self.names)}") from None

    def _summary(self) -> str:
        return f"of {self._dict['robot']}: {self.status}, {len(self.names)} parameters"

    def _warned(self) -> Calibration:
        """The same, after a warning where it is not to be used."""
        if not self.is_usable:
            why = "; ".join(self.misfit) or "the estimates are not a minimum"
            warnings.warn(f"{self.status}: {why}", UntrustedResult, stacklevel=3)
        return self


class Verification(Result):
    """How well a calibrated model predicts a recording."""

    @property
    def fits(self) -> bool:
        """Whether the model fits the recording."""
        return bool(self._dict["status"] == "fits")

    @cached_property
    def predicted(self) -> FloatArray:
        """The free run: what it predicts for the robot's channels, in their units, shape (samples, channels); NaN where it does not predict."""
        columns = self._native.array("predicted")
        return from_columns(columns, len(columns[0]) // 8 if columns else 0)

    @property
    def horizons(self) -> pandas.DataFrame:
        """RMSE of predictions some time ahead, in sigmas of each sensor: a row a channel, a column a horizon in s.

        A data frame where pandas is installed, else the list of dictionaries as in `to_dict`.
        """
        horizons: Any = self.to_dict()["horizons"]
        try:
            import pandas
        except ImportError:
            return horizons
        columns = {h["horizon_s"]: {c["channel"]: c["rmse_sigma"] for c in h["channels"]} for h in horizons}
        return pandas.DataFrame(columns).rename_axis(index="channel", columns="horizon_s")

    def _summary(self) -> str:
        return "the model fits" if self.fits else "the model does not fit: " + "; ".join(self._dict["misfit"])


class Diagnosis(Result):
    """What the model gets wrong, by name, and what knowing it brings."""

    @property
    def verdict(self) -> str:
        """`none`, `named`, `unknown` or `not_separable`."""
        return str(self._dict["verdict"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """The causes in the order in which they were accepted: `effect`, `axes`, `parameters`, `cv_gain`, `holdout_gain`, `flags`, …"""
        return list(self._dict["findings"])

    @property
    def named(self) -> list[str]:
        """Ids of the effects that were named."""
        return [finding["effect"] for finding in self.findings]

    @cached_property
    def base(self) -> Calibration:
        """The calibration of the model as it was."""
        return self._calibration("base")

    @cached_property
    def extended(self) -> Calibration:
        """The calibration of the model with the findings."""
        return self._calibration("extended")

    def _calibration(self, name: str) -> Calibration:
        native = self._native.calibration(name)
        assert native is not None
        return Calibration(native)

    def _summary(self) -> str:
        return self.verdict + "".join(f", {name}" for name in self.named)


class Observation(Result):
    """The robot's observer on a recording. Columns of `states` and `sigmas` are in the order of `names`."""

    @property
    def status(self) -> str:
        """`consistent`, `too_sure`, `too_careful` or `no_motion`."""
        return str(self._dict["status"])

    @property
    def names(self) -> list[str]:
        """Names of the states: `q1`, `qd1`, `theta1`, `thetad1` …, then the gyros' biases."""
        return [state["name"] for state in self._dict["states"]]

    @property
    def units(self) -> list[str]:
        """Their units."""
        return [state["unit"] for state in self._dict["states"]]

    @cached_property
    def t_s(self) -> FloatArray:
        """Time after the first sample, s, shape (samples,)."""
        return read_only(self._native.array("t_s")[0])

    @cached_property
    def states(self) -> FloatArray:
        """Estimates in `units`, shape (samples, states); NaN before the filter has started."""
        return from_columns(self._native.array("states"), len(self.t_s))

    @cached_property
    def sigmas(self) -> FloatArray:
        """Standard deviations in `units`, shape (samples, states)."""
        return from_columns(self._native.array("sigmas"), len(self.t_s))

    @cached_property
    def nis_per_reading(self) -> FloatArray:
        """Normalised innovation squared over the readings taken in, shape (samples,); NaN where there were none."""
        return read_only(self._native.array("nis_per_reading")[0])

    def _summary(self) -> str:
        return f"{self.status}, {len(self.names)} states"


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Reads a calibration that `save` or `host calibrate -o` wrote."""
    try:
        text = Path(path).read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise DeviceError(f"cannot read the calibration {path}: {error}", "check the path and that you may read the file") from error
    return Calibration(_native.read_calibration(text, os.fspath(path)))


def _array(values: Any) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
