"""Robots from MuJoCo's models (MJCF). The package `mujoco` parses them."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import FloatArray
from ._description import Drive, Gyro, JointText, description
from .errors import DataError, UsageError
from .robots import Robot, robot_from_text

__all__ = ["robot_from_mjcf"]

_LIMIT_RAD, _LIMIT_M = math.pi, 1.0
"""Limits of joints that have none."""
_SIGMA_RAD_S = 1.745e-3
"""Noise of a gyro that tells none: 0.1 deg/s."""


def robot_from_mjcf(
    path: str | os.PathLike[str],
    *,
    joints: Sequence[str] | None = None,
    drive: Drive | None = None,
    sample_period_s: float | None = None,
) -> Robot:
    """A robot from a MuJoCo model (needs the package `mujoco`: `pip install flexcal[mujoco]`).

    The model becomes a serial chain with its world as base, at the position 0 of every joint. Two coaxial joints of one body are a joint with an elastic
    transmission: the one with an actuator (or, without one, with armature) is its motor, the other its spring. What a model says of motors is used
    as start values: armature `b`, frictionloss `mu`, damping `v` (where the input is a current or torque), stiffness `k_s` and damping `d_s` of springs,
    the actuator's gain. Gyros become gyros; every joint gets an encoder on its motor.

    Parameters
    ----------
    path
        The model.
    joints
        Names of the joints of the chain (of elastic ones the motors), from the base outwards. Default: all. Others stand still at 0, and
        what they carry belongs to the body before them.
    drive
        Input, gear and supply of the drives, and parameters that stand for the model's. Default: torques, gear 1.
    sample_period_s
        Period of the control loop, s. Default: the model's time step.

    Raises
    ------
    DataError
        A model that is no serial chain of hinges and slides, with the name of what is not.
    UsageError
        `mujoco` is not installed, or a joint's name is not there.
    """
    try:
        import mujoco
    except ImportError:
        raise UsageError("the package mujoco is not installed", "pip install flexcal[mujoco]") from None
    path = Path(path)
    try:
        model = mujoco.MjModel.from_xml_path(os.fspath(path))
    except ValueError as error:
        raise DataError(f"{path} cannot be read: {error}", "correct the model; MuJoCo's message has the place") from error
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return robot_from_text(_Chain(mujoco, model, data, path).text(joints, drive or Drive(), sample_period_s))


@dataclass(frozen=True)
class _Joint:
    """A joint of the chain: MuJoCo's numbers of its motor, its spring and its body."""

    name: str
    motor: int
    spring: int | None
    body: int


class _Chain:
    """A model at the position 0 of its joints."""

    def __init__(self, mujoco: Any, model: Any, data: Any, path: Path) -> None:
        self.mujoco, self.model, self.data, self.path = mujoco, model, data, path
        self.actuated = {
            int(model.actuator_trnid[i, 0]): i
            for i in range(model.nu)
            if int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        }

    def text(self, wanted: Sequence[str] | None, drive: Drive, sample_period_s: float | None) -> str:
        """The description of the chain of the joints that are wanted."""
        chain = self.joints(wanted)
        carried = self.carried([joint.body for joint in chain])
        texts = []
        to_world, origin = np.eye(3), np.zeros(3)
        for joint, bodies in zip(chain, carried, strict=True):
            anchor, axes = self.frame(joint)
            fields = {
                "kind": "prismatic" if self.slides(joint) else "revolute",
                "axis": _list(axes.T @ self.data.xaxis[joint.motor]),
                "origin_m": _list(to_world.T @ (anchor - origin)),
                "rotation": [_list(row) for row in axes.T @ to_world],
                "limits_m" if self.slides(joint) else "limits_rad": self.limits(joint),
            }
            texts.append(JointText(joint.name, self.slides(joint), self.drive(joint, drive), fields, self.body(bodies, anchor, axes)))
            to_world, origin = axes, anchor
        name = "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in self.name("MODEL", 0) or self.path.stem)
        return description(
            name,
            f"from {self.path.name}",
            sample_period_s or float(self.model.opt.timestep),
            texts,
            gravity_m_s2=_list(self.model.opt.gravity),
            gyros=self.gyros(chain, carried),
        )

    def joints(self, wanted: Sequence[str] | None) -> list[_Joint]:
        """The chain from the base outwards."""
        found = []
        for body in range(1, self.model.nbody):
            first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
            found += self.of_body(body, list(range(first, first + count)))
        if wanted is not None:
            missing = [name for name in wanted if all(name not in (joint.name, self.joint_name(joint.motor)) for joint in found)]
            if missing:
                has = ", ".join(joint.name for joint in found)
                raise UsageError(f"{self.path} has no joint {missing[0]!r} that can be one of a chain", f"it has: {has}")
            found = [joint for joint in found if joint.name in wanted or self.joint_name(joint.motor) in wanted]
        for before, joint in zip(found, found[1:]):
            if not self.carries(before.body, joint.body):
                raise DataError(
                    f"{joint.name!r} does not hang on {before.name!r}: {self.path} is no chain of all its joints",
                    "name the joints of one chain with joints=[…]; the others stand still at 0",
                )
        return found

    def of_body(self, body: int, joints: list[int]) -> list[_Joint]:
        """The joints of one body: none, one, or a motor with its spring."""
        for joint in joints:
            if self.kind(joint) not in ("hinge", "slide"):
                raise DataError(
                    f"the joint {self.joint_name(joint)!r} of the body {self.name('BODY', body)!r} is free or a ball",
                    "a robot stands on its base, and its joints turn or slide: fix the base, split balls into hinges",
                )
        if not joints:
            return []
        if len(joints) == 1:
            return [_Joint(self.joint_name(joints[0]), joints[0], None, body)]
        if len(joints) == 2 and self.coaxial(*joints):
            motors = [joint for joint in joints if joint in self.actuated] or [
                joint for joint in joints if self.dof("dof_armature", joint) > 0.0
            ]
            if len(motors) == 1:
                spring = next(joint for joint in joints if joint != motors[0])
                name = self.joint_name(motors[0]).removesuffix("_motor")
                return [_Joint(name, motors[0], spring, body)]
        raise DataError(
            f"the body {self.name('BODY', body)!r} has {len(joints)} joints",
            "give each a body of its own; two coaxial ones, one of which has an actuator, are a motor and its spring",
        )

    def coaxial(self, one: int, other: int) -> bool:
        same_kind = self.kind(one) == self.kind(other)
        same_axis = np.allclose(self.data.xaxis[one], self.data.xaxis[other], atol=1e-9)
        apart = self.data.xanchor[one] - self.data.xanchor[other]
        return bool(same_kind and same_axis and (self.kind(one) == "slide" or np.allclose(np.cross(apart, self.data.xaxis[one]), 0.0, atol=1e-9)))

    def carries(self, body: int, other: int) -> bool:
        while other not in (0, body):
            other = int(self.model.body_parentid[other])
        return other == body

    def carried(self, bodies: list[int]) -> list[list[int]]:
        """Of each body of the chain, the bodies that move with it."""
        carried: list[list[int]] = [[] for _ in bodies]
        for body in range(1, self.model.nbody):
            holders = [i for i, holder in enumerate(bodies) if self.carries(holder, body)]
            if holders:
                carried[holders[-1]].append(body)
        return carried

    def frame(self, joint: _Joint) -> tuple[FloatArray, FloatArray]:
        """Origin on the axis and axes (by columns) of a joint's frame, in the world."""
        return np.array(self.data.xanchor[joint.motor]), self.data.xmat[joint.body].reshape(3, 3).copy()

    def body(self, bodies: list[int], anchor: FloatArray, axes: FloatArray) -> dict[str, object]:
        """Mass, centre and inertia of bodies that move together, in the joint's frame."""
        mass = sum(float(self.model.body_mass[body]) for body in bodies)
        centre = sum((self.model.body_mass[body] * self.data.xipos[body] for body in bodies), np.zeros(3)) / (mass or 1.0)
        inertia = np.zeros((3, 3))
        for body in bodies:
            principal = self.data.ximat[body].reshape(3, 3)
            apart = self.data.xipos[body] - centre
            inertia += principal @ np.diag(self.model.body_inertia[body]) @ principal.T
            inertia += self.model.body_mass[body] * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        inertia = axes.T @ inertia @ axes
        places = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
        return {
            "mass_kg": mass,
            "centre_m": _list(axes.T @ (centre - anchor)) if mass else [0.0, 0.0, 0.0],
            "inertia_kg_m2": dict(zip(places, _list([inertia[place] for place in places.values()]), strict=True)),
        }

    def drive(self, joint: _Joint, given: Drive) -> Drive:
        """The drive that is given, with what the model says of this one."""
        said: dict[str, float] = {}
        armature, friction = self.dof("dof_armature", joint.motor), self.dof("dof_frictionloss", joint.motor)
        said |= {"b": armature} if armature > 0.0 else {}
        said |= {"mu": friction} if friction > 0.0 else {}
        damping = self.dof("dof_damping", joint.motor)
        actuator = self.actuated.get(joint.motor)
        gain = 0.0 if actuator is None else float(self.model.actuator_gear[actuator, 0] * self.model.actuator_gainprm[actuator, 0])
        if given.input in ("duty", "volt"):
            said |= {"k_mi": damping} if damping > 0.0 else {}
            said |= {"k_pwm": gain / (given.supply_v or 1.0)} if gain > 0.0 else {}
        else:
            said |= {"v": damping} if damping > 0.0 else {}
            said |= {"k_t": gain} if gain > 0.0 and given.input == "ampere" else {}
        if joint.spring is not None:
            stiffness, losses = self.joint_value("jnt_stiffness", joint.spring), self.dof("dof_damping", joint.spring)
            said |= {"k_s": stiffness} if stiffness > 0.0 else {}
            said |= {"d_s": losses} if losses > 0.0 else {}
        transmission = given.transmission if joint.spring is None else "elastic"
        unit = {"newton_metre": "newton"}.get(given.input, given.input) if self.slides(joint) else given.input
        return replace(given, input=unit, transmission=transmission, parameters=said | dict(given.parameters))

    def limits(self, joint: _Joint) -> list[float]:
        if self.model.jnt_limited[joint.motor]:
            return _list(self.model.jnt_range[joint.motor])
        for tendon in range(self.model.ntendon):
            # The position of an elastic joint's link is a tendon over motor and spring.
            first, count = int(self.model.tendon_adr[tendon]), int(self.model.tendon_num[tendon])
            over = {int(self.model.wrap_objid[i]) for i in range(first, first + count)}
            if over == {joint.motor, joint.spring} and self.model.tendon_limited[tendon]:
                return _list(self.model.tendon_range[tendon])
        largest = _LIMIT_M if self.slides(joint) else _LIMIT_RAD
        return [-largest, largest]

    def gyros(self, chain: list[_Joint], carried: list[list[int]]) -> list[Gyro]:
        gyros = []
        for sensor in range(self.model.nsensor):
            if int(self.model.sensor_type[sensor]) != int(self.mujoco.mjtSensor.mjSENS_GYRO):
                continue
            site = int(self.model.sensor_objid[sensor])
            body = int(self.model.site_bodyid[site])
            holder = next((joint for joint, bodies in zip(chain, carried) if body in bodies), None)
            if holder is None:
                continue  # on the base, which does not turn
            rotation = self.data.site_xmat[site].reshape(3, 3).T @ self.frame(holder)[1]
            sigma = float(self.model.sensor_noise[sensor]) if hasattr(self.model, "sensor_noise") else 0.0
            gyros.append(Gyro(holder.name, [_list(row) for row in rotation], sigma or _SIGMA_RAD_S))
        return gyros

    def slides(self, joint: _Joint) -> bool:
        return self.kind(joint.motor) == "slide"

    def kind(self, joint: int) -> str:
        """`hinge`, `slide`, `ball` or `free`."""
        kinds = ("hinge", "slide", "ball", "free")
        return next(kind for kind in kinds if int(getattr(self.mujoco.mjtJoint, f"mjJNT_{kind.upper()}")) == self.model.jnt_type[joint])

    def dof(self, field: str, joint: int) -> float:
        """A quantity of a joint's speed. A polynomial counts by its first coefficient."""
        return float(np.ravel(getattr(self.model, field)[self.model.jnt_dofadr[joint]])[0])

    def joint_value(self, field: str, joint: int) -> float:
        return float(np.ravel(getattr(self.model, field)[joint])[0])

    def joint_name(self, joint: int) -> str:
        return self.name("JOINT", joint) or f"joint{joint + 1}"

    def name(self, kind: str, number: int) -> str:
        if kind == "MODEL":
            return bytes(self.model.names).split(b"\0", 1)[0].decode(errors="replace")
        return self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}"), number) or ""


def _list(values: Any) -> list[float]:
    """The numbers, with what rounding left of zeros taken off."""
    array = np.array(values, dtype=np.float64)
    array[np.abs(array) < 1e-14 * np.max(np.abs(array), initial=0.0)] = 0.0
    return [float(value) for value in array]
