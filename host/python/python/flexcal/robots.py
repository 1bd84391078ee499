"""Robots: built in, from description files, from URDF."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from . import _native
from ._description import Drive, JointText, description
from ._files import write_new
from .errors import DataError, DeviceError, UsageError

__all__ = ["Robot", "as_robot", "robot", "robot_from_text", "robot_from_urdf", "robot_names"]


class Robot:
    """A robot, as its description says: a serial chain of joints with drives and sensors.

    Made by `robot`, `robot_from_text`, `robot_from_urdf` and `robot_from_mjcf`.
    """

    def __init__(self, native: _native.Robot) -> None:
        self._native = native

    @property
    def name(self) -> str:
        """Name, also in results."""
        return self._native.name

    @property
    def description(self) -> str:
        """One line for people."""
        return self._native.description

    @property
    def sample_period_s(self) -> float:
        """Period of the control loop, s."""
        return self._native.sample_period_s

    @property
    def joints(self) -> list[str]:
        """Names of the joints from the base outwards."""
        return self._native.joints

    @property
    def columns(self) -> list[str]:
        """Columns of a table of this robot: `t_us`, the inputs `u1` …, then its channels."""
        return self._native.columns

    @property
    def channels(self) -> dict[str, str]:
        """What its sensors measure: column and unit, on the link side of the gear."""
        return dict(self._native.channels)

    @property
    def toml(self) -> str:
        """The text of the description; what stands in a URDF is written out."""
        return self._native.toml

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes the description; an existing file is only replaced with `force`."""
        return write_new(path, self.toml.encode(), force)

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self.description}>"


def robot(name_or_path: str | os.PathLike[str]) -> Robot:
    """A built-in robot by its name (`robot_names`), or a description file (TOML) by its path."""
    return Robot(_native.Robot.load(os.fspath(name_or_path)))


def robot_names() -> list[str]:
    """Names of the built-in robots."""
    return _native.robot_names()


def robot_from_text(toml: str, *, folder: str | os.PathLike[str] = ".") -> Robot:
    """A robot from the text of a description; a URDF that it names is looked for in `folder`."""
    return Robot(_native.Robot.parse(toml, os.fspath(folder)))


def as_robot(given: Robot | str | os.PathLike[str]) -> Robot:
    """A robot, whichever way it is given."""
    return given if isinstance(given, Robot) else robot(given)


def robot_from_urdf(
    path: str | os.PathLike[str],
    *,
    joints: Sequence[str] | None = None,
    locked: Sequence[str] = (),
    drive: Drive | Mapping[str, Drive] = Drive(),
    sample_period_s: float = 0.001,
) -> Robot:
    """A robot from a URDF. A URDF has chain, masses and limits; drives and sensors are said here.

    Each joint gets an encoder on its motor. For gyros and other sensors edit the text: `robot_from_text(r.toml + more)`.

    Parameters
    ----------
    path
        The URDF.
    joints
        Names of the joints of the chain from the base outwards. Default: all that move, in the order of the file.
    locked
        Joints that stand still at zero, as a gripper's.
    drive
        The drive of every joint, or of each by its name.
    sample_period_s
        Period of the control loop, s.
    """
    path = Path(path)
    try:
        tree = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise DeviceError(f"cannot read {path}: {error}", "check the path and that you may read the file") from error
    except ElementTree.ParseError as error:
        raise DataError(f"{path} is no XML: {error}", "run xacro first if it is a .xacro file") from error
    moving = {j.get("name", ""): j for j in tree.findall("joint") if j.get("type") in ("revolute", "continuous", "prismatic")}
    names = [name for name in moving if name not in locked] if joints is None else list(joints)
    unknown = [name for name in [*names, *locked] if name not in moving]
    if unknown:
        raise UsageError(f"{path} has no moving joint {unknown[0]!r}", f"it has: {', '.join(moving)}")
    texts = [
        JointText(name, slides=moving[name].get("type") == "prismatic", drive=_drive_of(drive, name)) for name in names
    ]
    name = "".join(c if c.isalnum() or c in "_-" else "_" for c in (tree.get("name") or path.stem))
    text = description(name, f"from {path.name}", sample_period_s, texts, urdf=(path.name, list(locked)))
    return robot_from_text(text, folder=path.parent)


def _drive_of(drive: Drive | Mapping[str, Drive], joint: str) -> Drive:
    if isinstance(drive, Drive):
        return drive
    try:
        return drive[joint]
    except KeyError:
        raise UsageError(f"`drive` says nothing of the joint {joint!r}", "give a drive for each joint") from None


