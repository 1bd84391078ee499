"""The text of a robot description from a chain and its drives."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .errors import UsageError

__all__ = ["Drive", "Gyro", "JointText", "description"]

_INPUTS = ("duty", "volt", "ampere", "newton_metre", "newton")


@dataclass(frozen=True)
class Drive:
    """What moves a joint. All quantities are meant on the link side of the gear.

    Parameters
    ----------
    input
        What the motor is commanded with: `duty` (−1 … 1 of `supply_v`), `volt`, `ampere`, `newton_metre` or `newton`; one for all joints.
    transmission
        `elastic` (spring and damper) or `rigid`.
    gear
        Motor radians per radian (or metre) of the link; what an encoder on the motor counts.
    sigma
        Standard deviation of the motor's encoder on the link side, rad or m.
    supply_v
        Supply voltage, V; only with `duty`.
    parameters
        Start values by name: `b` motor inertia (kg m²), `mu` Coulomb friction (N m), `k_s` stiffness (N m/rad), `d_s` damping (N m s/rad),
        `k_pwm` (N m/V), `k_mi` (N m s/rad), `k_t` (N m/A), `v` viscous friction (N m s/rad). What is needed and not given gets a guess; a
        calibration starts there.
    """

    input: str = "newton_metre"
    transmission: str = "rigid"
    gear: float = 1.0
    sigma: float = 1e-4
    supply_v: float | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.input not in _INPUTS:
            raise UsageError(f"input is {self.input!r}", f"give one of {', '.join(_INPUTS)}")
        if self.transmission not in ("elastic", "rigid"):
            raise UsageError(f"transmission is {self.transmission!r}", "give elastic or rigid")
        if (self.input == "duty") != (self.supply_v is not None):
            raise UsageError(f"input is {self.input!r}, supply_v {self.supply_v}", "give supply_v with duty, and only there")

    def starts(self) -> dict[str, float]:
        """Start values of all parameters that the equations of this drive have, and of those given beside them."""
        guesses = {"b": 0.1, "mu": 1.0}
        if self.input in ("duty", "volt"):
            guesses |= {"k_pwm": 1.0, "k_mi": 1.0}
        elif self.input == "ampere":
            guesses |= {"k_t": 1.0}
        if self.transmission == "elastic":
            guesses |= {"k_s": 100.0, "d_s": 0.5}
        return guesses | dict(self.parameters)


@dataclass(frozen=True)
class Gyro:
    """A gyro on the body that `joint` moves; `rotation` takes the body's axes to the sensor's."""

    joint: str
    rotation: Sequence[Sequence[float]]
    sigma_rad_s: float


@dataclass(frozen=True)
class JointText:
    """A joint for `description`; what a URDF gives is left out."""

    name: str
    slides: bool
    drive: Drive
    chain: Mapping[str, object] = field(default_factory=dict)
    body: Mapping[str, object] = field(default_factory=dict)


def description(
    name: str,
    line: str,
    sample_period_s: float,
    joints: Sequence[JointText],
    *,
    gravity_m_s2: Sequence[float] = (0.0, 0.0, -9.81),
    gyros: Sequence[Gyro] = (),
    urdf: tuple[str, list[str]] | None = None,
) -> str:
    """The text of a description file."""
    if not joints:
        raise UsageError("the chain has no joint", "name the joints that move with joints=[…]")
    drives = [joint.drive for joint in joints]
    if len({(drive.input, drive.supply_v) for drive in drives}) > 1:
        raise UsageError("the drives have different inputs or supplies", "give all joints the same input and supply_v")
    text = [
        f"name = {_value(name)}",
        f"description = {_value(line)}",
        f"sample_period_s = {sample_period_s!r}",
        "coriolis = true",
        f"gravity_m_s2 = {_value(list(gravity_m_s2))}",
    ]
    if urdf is not None:
        text += ["", "[urdf]", f"file = {_value(urdf[0])}", f"locked = {_value(urdf[1])}"]
    text += ["", "[input]", f"unit = {_value(drives[0].input)}"]
    if drives[0].supply_v is not None:
        text.append(f"supply_v = {float(drives[0].supply_v)!r}")
    for joint in joints:
        drive, slope = joint.drive, "slope_s_m" if joint.slides else "slope_s_rad"
        text += ["", "[[joint]]", f"name = {_value(joint.name)}"]
        text += [f"{key} = {_value(value)}" for key, value in joint.chain.items()]
        text += [
            'gravity = "acts"',
            f"transmission = {_value(drive.transmission)}",
            f'friction = {{ law = "coulomb", {slope} = 400.0 }}',
            f"gear = {float(drive.gear)!r}",
        ]
        if joint.body:
            text += ["", "[joint.body]", *(f"{key} = {_value(value)}" for key, value in joint.body.items())]
        text += ["", "[joint.parameters]"]
        text += [f"{key} = {{ start = {float(value)!r} }}" for key, value in drive.starts().items()]
    for joint in joints:
        sigma = "sigma_m" if joint.slides else "sigma_rad"
        text += ["", "[[sensor]]", 'kind = "motor_encoder"', f"joint = {_value(joint.name)}"]
        text.append(f"{sigma} = {float(joint.drive.sigma)!r}")
    for gyro in gyros:
        text += [
            "",
            "[[sensor]]",
            'kind = "gyro"',
            f"joint = {_value(gyro.joint)}",
            f"rotation = {{ start = {_value(gyro.rotation)} }}",
            "bias_rad_s = { start = [0.0, 0.0, 0.0] }",
            f"sigma_rad_s = {float(gyro.sigma_rad_s)!r}",
        ]
    return "\n".join(text) + "\n"


def _value(value: object) -> str:
    """A value as TOML."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return json.dumps(value, ensure_ascii=False)
        case int() | float():
            return repr(float(value))
        case Mapping():
            return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
        case _:
            return "[" + ", ".join(_value(inner) for inner in value) + "]"  # type: ignore[attr-defined]
