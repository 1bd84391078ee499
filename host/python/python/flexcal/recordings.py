"""Recordings: read, made from arrays, or made by a simulated robot."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from numpy.typing import ArrayLike

from . import _native
from ._arrays import FloatArray, column_bytes, from_columns, read_only
from ._files import write_new
from ._progress import Progress, callback
from .errors import DataError, UsageError
from .robots import Robot, as_robot

if TYPE_CHECKING:
    import pandas

__all__ = ["Recording", "as_recording", "from_arrays", "load", "simulate"]

Inputs = Literal["hold", "interpolate"]


class Recording:
    """A recording of a robot: one entry a tick in every column. SI units, on the link side of the gear.

    Made by `load`, `from_arrays` and `simulate`. It is what its file says: results on it are those of the binary on the file that `save` writes.
    """

    def __init__(self, native: _native.Recording) -> None:
        self._native = native

    @property
    def robot(self) -> Robot:
        """The robot that moved."""
        return Robot(self._native.robot)

    @property
    def path(self) -> str:
        """Where it comes from."""
        return self._native.path

    @property
    def sha256(self) -> str:
        """SHA-256 of its file, by which results name it."""
        return self._native.sha256

    @property
    def period_s(self) -> float:
        """Period of the tick, s."""
        return self._native.period_s

    @property
    def gaps(self) -> int:
        """Places where ticks are missing."""
        return self._native.gaps

    @property
    def missing_ticks(self) -> int:
        """Ticks without a sample between the first and the last one."""
        return self._native.missing_ticks

    @property
    def notes(self) -> list[str]:
        """What was done to the numbers of a table, and what is wrong with a file that was cut off."""
        return self._native.notes

    @property
    def columns(self) -> list[str]:
        """Names of the columns: inputs `u1` …, then the robot's channels (`theta1`, `g1x`, …)."""
        return self.robot.columns[1:]

    @property
    def t_s(self) -> FloatArray:
        """Time after the first sample, s, shape (samples,)."""
        return read_only(self._native.time())

    @property
    def u(self) -> FloatArray:
        """Inputs in the robot's unit, in force from their tick to the next, shape (samples, joints)."""
        return from_columns([self[f"u{i + 1}"].tobytes() for i in range(len(self.robot.joints))], len(self))

    @property
    def truth(self) -> dict[str, float] | None:
        """What is true of a simulated robot, by the names of a calibration's parameters; `None` of other recordings."""
        text = self._native.truth
        return None if text is None else {value["name"]: value["value"] for value in json.loads(text)}

    def __getitem__(self, column: str) -> FloatArray:
        """A column by its name, shape (samples,): rad, rad/s, m, m/s, or the input's unit. NaN: the sensor had no reading."""
        data = self._native.column(column)
        if data is None:
            raise UsageError(f"there is no column {column!r}", f"the columns are {', '.join(self.columns)}")
        return read_only(data)

    def __len__(self) -> int:
        return self._native.samples

    def to_frame(self) -> pandas.DataFrame:
        """All columns as a data frame, indexed by `t_s`."""
        import pandas

        return pandas.DataFrame({name: self[name] for name in self.columns}, index=pandas.Index(self.t_s, name="t_s"))

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes the recording (MCAP), as `host record` and `host import` do; an existing file is only replaced with `force`."""
        return write_new(path, self._native.to_mcap(), force)

    def __repr__(self) -> str:
        return f"<Recording {self.path}: {self._native.summary}>"


def load(
    path: str | os.PathLike[str],
    *,
    robot: Robot | str | os.PathLike[str] | None = None,
    inputs: Inputs | None = None,
) -> Recording:
    """Reads a recording, a CSV table (`.csv`, `.csv.gz`) or a ROS 2 bag.

    Parameters
    ----------
    path
        A recording of `host record`, `host import` or `save`; with `robot`, a table or a bag.
    robot
        The robot of a table or a bag. Columns: `t_us` or `t_s`, `u1` …, then its channels; its section `[import]` may name others.
    inputs
        What the input is in rows that have none: `hold` for a command, `interpolate` for a measured torque.
    """
    if robot is None:
        return Recording(_native.Recording.read(os.fspath(path)))
    return Recording(_native.Recording.import_table(os.fspath(path), as_robot(robot)._native, inputs))


def from_arrays(
    robot: Robot | str | os.PathLike[str],
    *,
    t_s: ArrayLike,
    u: ArrayLike,
    name: str = "arrays",
    inputs: Inputs | None = None,
    **channels: ArrayLike,
) -> Recording:
    """A recording from arrays, one row a tick. A missing tick is a missing row; NaN is a sensor without a reading.

    Parameters
    ----------
    robot
        The robot that moved.
    t_s
        Time, s, shape (samples,), rising; rounded to microseconds.
    u
        Inputs in the robot's unit, shape (samples, joints); (samples,) for one joint. The u of a row holds until the next.
    channels
        What its sensors read, in rad, rad/s, m, m/s on the link side of the gear. A column by its name, `theta2=` of shape (samples,), or all of a
        kind at once: `theta=`, `q=`, `thd=`, `qd=` of shape (samples, sensors of that kind), `g1=` of shape (samples, 3).
    name
        What results call this recording.
    inputs
        As in `load`.

    Examples
    --------
    >>> import numpy as np, flexcal
    >>> t_s = np.arange(1000) * 1e-3
    >>> flexcal.from_arrays("emps", t_s=t_s, u=np.sin(t_s), theta=0.01 * np.sin(t_s))
    <Recording arrays: 1000 samples of emps, 0.999 s, no gap>
    """
    robot = as_robot(robot)
    known = robot.columns[1:]
    columns = [("t_s", column_bytes("t_s", t_s, None)[0])]
    for key, values in {"u": u, **channels}.items():
        if key in known:
            names, width = [key], None
        else:
            names = [column for column in known if _belongs(column, key)]
            width = len(names)
        if not names:
            raise DataError(f"the robot {robot.name} has no column {key!r}", f"its columns are {', '.join(known)}")
        columns += zip(names, column_bytes(key, values, width), strict=True)
    return Recording(_native.Recording.from_columns(robot._native, columns, name, inputs))


def _belongs(column: str, kind: str) -> bool:
    """Whether a column is one of a kind: `theta2` of `theta`, `g1x` of `g1`."""
    rest = column.removeprefix(kind)
    return rest != column and (rest.isdigit() or (rest in ("x", "y", "z") and kind[-1:].isdigit()))


def simulate(
    robot: Robot | str | os.PathLike[str] = "doggy",
    *,
    motion: str | os.PathLike[str] = "short",
    seed: int = 0,
    effects: Sequence[str] = (),
    hide: int | None = None,
    process_noise: float = 0.0,
    nth: int = 1,
    progress: Progress = None,
) -> Recording:
    """Plays a motion on a simulated robot and records it; `truth` tells its parameters.

    Sensors, their timing and the motion player are those of `host simulate`; there is no serial line in between.

    Parameters
    ----------
    robot
        The robot; the seed draws its true parameters within ±15 % of what the description says of simulated robots.
    motion
        `short` (24 s), `calibration` (some 70 s), `validation`, or the path of a motion file.
    seed
        Decides everything that is drawn.
    effects
        Effects in the plant, as `base_bearing`, `backlash=large` or `backlash=0.008`.
    hide
        A seed that hides one more effect.
    process_noise
        White torque on motors and links, 1 for a hundredth of the paper's (36).
    nth
        The motion is the n-th of this robot: other noise on the same robot.
    progress
        As in `calibrate`.
    """
    if motion not in ("short", "calibration", "validation"):
        try:
            motion = Path(motion).read_text()
        except OSError as error:
            raise UsageError(
                f"cannot read the motion {os.fspath(motion)}: {error}",
                "give short, calibration, validation, or the path of a motion file",
            ) from error
    native = _native.Recording.simulate(
        as_robot(robot)._native,
        motion=os.fspath(motion),
        seed=seed,
        effects=list(effects),
        hide=hide,
        process_noise=process_noise,
        nth=nth,
        progress=callback(progress),
    )
    return Recording(native)


def as_recording(given: Recording | str | os.PathLike[str]) -> Recording:
    """A recording, whichever way it is given."""
    return given if isinstance(given, Recording) else load(given)
