#!/usr/bin/env python3
"""Doggy in MuJoCo, one hidden effect each, diagnosed by the program.

The robot of `host robot show doggy`: three elastic joints driven by duty, encoders of the motors, a gyro behind the yaw axis and one on the head. MuJoCo has
the bodies and integrates them (Runge-Kutta, 0.2 ms); drives, belts, friction and the hidden effect are torques that a callback adds at every stage of it.
Laws with a memory have other forms than the program's: bristles, slip elements, two poles.

    bodies, mass matrix: MuJoCo ─┐
    duty, supply, back-EMF ──────┼─▶ accelerations ─▶ encoders, gyros, rounded ─▶ CSV ─▶ host import, diagnose
    belts, friction, effect ─────┘

    python tests/mujoco/doggy.py target/release/host [--effects ID,…] [--size medium|weak] [--seeds N] [--first N] [--out FILE.jsonl]
        [--keep FOLDER]

Needs the packages mujoco and numpy. Prints a line a case and the counts. A case whose line stands in FILE.jsonl is counted and not made again.
"""

import argparse
import json
import subprocess
import sys
import tomllib
from math import copysign, cos, exp, pi, sin

import mujoco
import numpy as np

from count import add_arguments, count, diagnosed

STEP_S = 2e-4
TICK_S = 1e-3
GEAR = 42.092
COUNT_RAD = 2 * pi / 1024 / GEAR
SUPPLY_V = 32.0
LIMITS_RAD = (0.8, 0.45, 0.45)

# What is hidden, at medium size; a weak one is a third. Torques in N m, angles in rad, times in s.
EFFECTS = {
    "none": {},
    "viscous_friction": dict(v=6.0),
    "quadratic_drag": dict(c=0.25),
    "stribeck": dict(excess=0.9, at=0.1),
    "asymmetric_friction": dict(part=0.35),
    "link_friction": dict(mu=0.7, v=0.1),
    "load_friction": dict(a=0.02),
    "position_friction": dict(a=0.2),
    "friction_drift": dict(a=0.3, T=30.0),
    "cogging": dict(A=0.8, p=4),
    "torque_offset": dict(o=0.6),
    "backlash": dict(h=8e-3),
    "belt_hardening": dict(share=0.5),
    "belt_slack_side": dict(r=0.15),
    "belt_hysteresis": dict(share=0.25, slip=0.03),
    "gravity_residual": dict(G=1.5),
    "cable_spring": dict(k=2.0),
    "coriolis": dict(scale=1.0),
    "link_inertia": dict(m=0.12),
    "motor_mismatch": dict(share=0.08),
    "voltage_sag": dict(r=0.025),
    "current_limit": dict(T=95.0),
    "pwm_dead_zone": dict(d=0.02),
    "electrical_lag": dict(T=2e-3),
    "input_delay": dict(T=2e-3),
    "gyro_bias_drift": dict(a=0.02, T=25.0),
    "gyro_scale": dict(A=0.02),
    "gyro_lag": dict(T=1.5e-3),
    "gyro_clipping": dict(fs=3.0),
    "encoder_eccentricity": dict(e=8e-4),
    "encoder_lag": dict(T=2e-3),
    "structure_mode": dict(hz=12.0, zeta=0.03),
}
# A weak one of these is not a third of a medium one.
WEAK = {"current_limit": dict(T=115.0), "gyro_clipping": dict(fs=5.0), "structure_mode": dict(hz=18.0, zeta=0.03), "coriolis": dict(scale=1.0), "stribeck": dict(excess=0.35, at=0.1)}
# Nothing of the catalogue: friction of the pitch motor that follows the roll joint, torque that leaks from one motor to another, a spring that ages, a
# ripple whose amplitude follows the load, a gyro that rectifies fast motion, an encoder that creeps under torque.
OUTSIDERS = {
    "outsider_friction_of_another": dict(a=0.8),
    "outsider_leak": dict(share=0.06),
    "outsider_ageing_belt": dict(share=0.25),
    "outsider_creep": dict(a=3e-5),
    "outsider_loaded_ripple": dict(a=0.05, p=3),
    "outsider_gyro_rectifies": dict(a=0.03),
}


def tensor(body):
    """Inertia about the centre of mass, as MuJoCo wants it: xx yy zz xy xz yz."""
    return " ".join(str(body["inertia_kg_m2"].get(name, 0.0)) for name in ("xx", "yy", "zz", "xy", "xz", "yz"))


def quaternion(rotation):
    """Of a matrix that takes the child's axes to the parent's."""
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, np.array(rotation, float).flatten())
    return " ".join(map(str, q))


def mjcf(robot, b, effect, what, rng):
    """The chain of the robot file, with a rotor a joint. A flexible rod has two more hinges before the head."""
    inner = '<site name="gyro2"/>'
    rod = ""
    if effect == "structure_mode":
        stiff = [0.36 * (2 * pi * what["hz"] * f) ** 2 for f in rng.uniform(0.85, 1.15, 2)]
        damp = [2 * what["zeta"] * (0.36 * k) ** 0.5 for k in stiff]
        rod = "".join(
            f'<joint name="rod{axis}" type="hinge" axis="{axis}" pos="0.2 0 0" stiffness="{k}" damping="{d}"/>' for axis, k, d in zip(("0 1 0", "0 0 1"), stiff, damp)
        )
    for i, joint in reversed(list(enumerate(robot["joint"]))):
        body, axis = joint["body"], " ".join(map(str, joint["axis"]))
        mass, centre, inertia = body["mass_kg"], body["centre_m"], tensor(body)
        if i == 2 and effect == "link_inertia":
            extra = f'<body pos="0.8 0 0"><inertial mass="{what["m"]}" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/></body>'
            inner += extra
        turned = f' quat="{quaternion(joint["rotation"])}"' if "rotation" in joint else ""
        site = '<site name="gyro1"/>' if i == 0 else ""
        own = f'<inertial mass="{mass}" pos="{centre[0]} {centre[1]} {centre[2]}" fullinertia="{inertia}"/>{site}{inner}'
        if i == 2 and rod:
            # The file's body hangs on the rod; a light frame beside it stays on the roll joint.
            own = f'<inertial mass="0.2" pos="0 0 0" diaginertia="1e-3 1e-3 1e-3"/><body>{rod}{own}</body>'
        inner = f'<body{turned}><joint name="q{i}" type="hinge" axis="{axis}"/>{own}</body>'
    rotors = "".join(
        f'<body><joint name="m{i}" type="hinge" axis="0 0 1" armature="{b[i]}"/><inertial mass="1e-6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/></body>' for i in range(3)
    )
    return (
        f'<mujoco><option timestep="{STEP_S}" gravity="0 0 0" integrator="RK4"><flag contact="disable"/></option>'
        f"<worldbody>{inner}{rotors}</worldbody>"
        '<sensor><gyro site="gyro1"/><gyro site="gyro2"/></sensor></mujoco>'
    )


def smooth_sign(speed):
    """2/(1 + e^−400 v) − 1 of the paper's friction."""
    return 2 / (1 + exp(max(-700.0, min(700.0, -400.0 * speed)))) - 1


def wobble(rng, share, n=3):
    return (rng.choice([-1.0, 1.0], n) * rng.uniform(0.75, 1.25, n) * share).tolist()


def drawn(robot, effect, what, rng):
    """All true parameters: around those of the file, and the effect's own of every joint."""
    around = lambda value: float(value * rng.uniform(0.87, 1.13))
    common = {name: around(robot["parameters"][name]["simulated"]) for name in ("k_pwm", "k_mi", "b")}
    p = {name: [value] * 3 for name, value in common.items()}
    of = lambda joint, name: joint["parameters"][name].get("simulated", joint["parameters"][name]["start"])
    for name in ("mu", "k_s", "d_s"):
        p[name] = [around(of(joint, name)) for joint in robot["joint"]]
    size = [0.0] * 3
    if effect == "motor_mismatch":
        for name in ("b", "k_pwm", "k_mi"):
            p[name] = [value * (1 + share) for value, share in zip(p[name], wobble(rng, what["share"]))]
    keys = {"viscous_friction": "v", "quadratic_drag": "c", "stribeck": "excess", "asymmetric_friction": "part", "link_friction": "mu", "load_friction": "a", "position_friction": "a", "friction_drift": "a", "cogging": "A", "torque_offset": "o", "backlash": "h", "belt_hardening": "share", "belt_slack_side": "r", "belt_hysteresis": "share", "gravity_residual": "G", "cable_spring": "k", "pwm_dead_zone": "d", "encoder_eccentricity": "e"}
    if effect in keys:
        size = wobble(rng, what[keys[effect]])
        if effect not in ("asymmetric_friction", "torque_offset", "belt_slack_side"):
            size = [abs(value) for value in size]
    if effect == "viscous_friction":
        size = [value * share for value, share in zip(size, rng.permutation([1.0, 0.5, 0.0]))]
    p["size"], p["phase"] = size, rng.uniform(-pi, pi, 3).tolist()
    return p


def motion(rng, validation):
    """Targets and ceilings of the duty, a tick at a time: at rest, slow one by one, slow together, fast and a chirp each, together."""
    rows = []

    def stage(seconds, axes, ceiling, every_s, chirp=None):
        goal = np.zeros(3)
        sign = rng.choice([-1.0, 1.0], 3)
        for tick in range(int(seconds / TICK_S)):
            t = tick * TICK_S
            if chirp:
                low, high = chirp
                phase = 2 * pi * (low * t + (high - low) * t * t / (2 * seconds))
                goal = np.array([(0.3 if i in axes else 0.0) * LIMITS_RAD[i] * sign[i] * sin(phase + 0.7 * i) for i in range(3)])
            elif tick % int(every_s / TICK_S) == 0:
                goal = np.array([(rng.uniform(-1, 1) * LIMITS_RAD[i] if i in axes else 0.0) for i in range(3)])
                if t > seconds - every_s:
                    goal = np.zeros(3)
            rows.append((goal.tolist(), ceiling, 5.0 if chirp else 2.5))

    every = (0, 1, 2)
    if validation:
        stage(3.2, (), 0.0, 1.0)
        stage(10.0, every, 0.4, 0.8)
        stage(6.0, every, 0.15, 1.4)
        stage(8.5, every, 0.9, 0.45)
        return rows
    stage(3.4, (), 0.0, 1.0)
    for axis in every:
        stage(5.0, (axis,), 0.15, 1.2)
    stage(6.0, every, 0.15, 1.2)
    for axis in every:
        stage(4.0, (axis,), 0.9, 0.5)
        stage(4.5, (axis,), 0.9, 1.0, (1.4, 10.0))
    stage(9.0, every, 0.9, 0.5)
    stage(9.0, every, 0.9, 1.0, (1.4, 10.0))
    return rows


def simulate(robot, effect, what, p, mountings, biases, rng, validation):
    """One recording: t_us, duties, encoders, gyros."""
    model = mujoco.MjModel.from_xml_string(mjcf(robot, p["b"], effect, what, np.random.default_rng(1)))
    data = mujoco.MjData(model)
    links = [model.joint(f"q{i}").qposadr[0] for i in range(3)]
    motors = [model.joint(f"m{i}").qposadr[0] for i in range(3)]
    start = rng.uniform(-0.03, 0.03, 3)
    data.qpos[links] = start
    data.qpos[motors] = start
    bias_torque = np.zeros(model.nv)
    k_pwm, k_mi, mu, k_s, d_s, size, phase = (p[name] for name in ("k_pwm", "k_mi", "mu", "k_s", "d_s", "size", "phase"))
    acting = [0.0] * 3
    lagged = [0.0] * 3
    slipped = [[0.0] * 3 for _ in range(2)]
    bristle = [0.0] * 3
    now = [0.0]
    coriolis_left = what.get("scale", 0.0) if effect == "coriolis" else 0.0

    def motor_torques(speed):
        supply = SUPPLY_V
        if effect == "voltage_sag":
            # Σ u τ_m = Σ u (k U u − k_mi w) with U = U_max − r Σ u τ_m, in closed form.
            square = sum(k * u * u for k, u in zip(k_pwm, acting))
            back = sum(k * u * w for k, u, w in zip(k_mi, acting, speed))
            power = (square * SUPPLY_V - back) / (1 + what["r"] * square)
            supply = min(SUPPLY_V, SUPPLY_V - what["r"] * power)
        torques = [k * supply * u - e * w for k, u, e, w in zip(k_pwm, acting, k_mi, speed)]
        if effect == "electrical_lag":
            return lagged
        if effect == "current_limit":
            torques = [max(-what["T"], min(what["T"], torque)) for torque in torques]
        if effect == "outsider_leak":
            torques = [torques[0], torques[1] + what["share"] * torques[2], torques[2]]
        return torques

    def passive(model_, data_):
        position, velocity = data_.qpos.tolist(), data_.qvel.tolist()
        mujoco.mj_rne(model_, data_, 0, bias_torque)
        if coriolis_left != 1.0:
            data_.qfrc_passive[:] += (1 - coriolis_left) * bias_torque
        speeds = [velocity[m] for m in motors]
        drive = motor_torques(speeds)
        t = now[0]
        for i in range(3):
            q, dq, x, w = position[links[i]], velocity[links[i]], position[motors[i]], speeds[i]
            wound, rate = q - x, dq - w
            belt = k_s[i] * wound + d_s[i] * rate
            if effect == "backlash":
                free = max(-size[i], min(size[i], wound))
                met = min(1.0, abs(wound - free) / 1e-3)
                belt = k_s[i] * (wound - free) + met * d_s[i] * rate
            elif effect == "belt_hardening":
                belt += size[i] * k_s[i] / 0.01 * wound**3
            elif effect == "belt_slack_side":
                belt += size[i] * k_s[i] * abs(wound)
            elif effect == "belt_hysteresis":
                belt += size[i] * k_s[i] * 0.5 * ((wound - slipped[0][i]) + (wound - slipped[1][i]))
            elif effect == "outsider_ageing_belt":
                belt -= what["share"] * k_s[i] * wound * t / 70.0
            level, sign = mu[i], smooth_sign(w)
            if effect == "load_friction":
                level *= 1 + size[i] * abs(belt)
            elif effect == "position_friction":
                level *= 1 + size[i] * cos(x - phase[i])
            elif effect == "friction_drift":
                level *= 1 + size[i] * exp(-t / what["T"])
            elif effect == "outsider_friction_of_another" and i == 1:
                level *= max(0.1, 1 + what["a"] * position[links[2]] / 0.5)
            friction = level * sign
            if effect == "stribeck":
                friction = bristle[i]
            elif effect == "viscous_friction":
                friction += size[i] * w
            elif effect == "asymmetric_friction":
                friction += size[i] * mu[i] * abs(sign)
            elif effect == "cogging":
                friction += size[i] * sin(what["p"] * GEAR * x + phase[i])
            elif effect == "torque_offset":
                friction -= size[i]
            elif effect == "outsider_loaded_ripple":
                friction += what["a"] * abs(belt) * sin(what["p"] * GEAR * x + phase[i])
            held = 0.0
            if effect == "quadratic_drag":
                held = size[i] * dq * abs(dq)
            elif effect == "link_friction":
                held = size[i] * smooth_sign(dq) + what["v"] * dq
            elif effect == "gravity_residual" and i > 0:
                held = -size[i] * sin(q + phase[i] * 0.1)
            elif effect == "cable_spring":
                held = size[i] * q
            data_.qfrc_passive[motors[i]] += drive[i] + belt - friction
            data_.qfrc_passive[links[i]] -= belt + held

    def remember(position, velocity):
        """States of the effect over one step, outside the integrator."""
        if effect == "electrical_lag":
            share = 1 - exp(-STEP_S / what["T"])
            for i in range(3):
                w = velocity[motors[i]]
                lagged[i] += share * (k_pwm[i] * SUPPLY_V * acting[i] - k_mi[i] * w - lagged[i])
        elif effect == "belt_hysteresis":
            for i in range(3):
                wound = position[links[i]] - position[motors[i]]
                for element, reach in zip(slipped, (what["slip"], 0.35 * what["slip"])):
                    element[i] = max(wound - reach, min(wound + reach, element[i]))
        elif effect == "stribeck":
            # LuGre's bristles bend by 0.1 mrad under Coulomb's torque; the rate that they settle at is taken implicitly.
            for i in range(3):
                w, stiffness = velocity[motors[i]], mu[i] / 1e-4
                most = mu[i] * (1 + size[i] * exp(-((w / what["at"]) ** 2)))
                bristle[i] = (bristle[i] + stiffness * w * STEP_S) / (1 + stiffness * abs(w) / most * STEP_S)

    mujoco.set_mjcb_passive(passive)
    poles = [np.zeros(3) for _ in range(4)]
    held, encoders = [], []
    creep = [0.0] * 3
    rows = []
    dead = size if effect == "pwm_dead_zone" else [0.0] * 3
    for tick, (goal, ceiling, gain) in enumerate(motion(rng, validation)):
        t = tick * TICK_S
        now[0] = t
        theta = [data.qpos[m] for m in motors]
        read = list(theta)
        if effect == "encoder_lag":
            encoders.append(theta)
            read[1] = encoders[-1 - min(len(encoders) - 1, round(what["T"] / TICK_S))][1]
        if effect == "encoder_eccentricity":
            read = [x + size[i] * sin(x + phase[i]) for i, x in enumerate(read)]
        if effect == "outsider_creep":
            for i in range(3):
                creep[i] += TICK_S / 0.4 * (what["a"] * k_s[i] * (data.qpos[links[i]] - theta[i]) - creep[i])
            read = [x + c for x, c in zip(read, creep)]
        read = [round((x + rng.normal(0, 5.5e-5)) / COUNT_RAD) * COUNT_RAD for x in read]
        u = [round(max(-ceiling, min(ceiling, gain * (g - x))), 4) for g, x in zip(goal, read)]
        mujoco.mj_forward(model, data)
        rates = [data.sensordata[:3].copy(), data.sensordata[3:6].copy()]
        words = []
        for g, rate in enumerate(rates):
            if effect == "gyro_lag":
                rate = poles[2 + g].copy()
            reading = mountings[g] @ rate
            if effect == "gyro_scale":
                reading = reading * (1 + what["A"] * np.array([1.0, -0.7, 0.8]) * (1 if g else -1))
            if effect == "outsider_gyro_rectifies" and g == 1:
                reading = reading + what["a"] * np.abs(reading) ** 1.5
            if effect == "gyro_clipping":
                reading = np.clip(reading, -what["fs"], what["fs"])
            reading = reading + biases[g]
            if effect == "gyro_bias_drift":
                reading = reading + what["a"] * np.array([1.0, -0.8, 0.6]) * (1 - exp(-t / what["T"]))
            words += np.round(reading + rng.normal(0, 1.745e-3, 3), 3).tolist()
        rows.append([tick * 1000 + 5000, *u, *read, *words])
        held.append(u)
        for part in range(5):
            since = t + part * STEP_S
            command = u
            if effect == "input_delay":
                back = int((since - what["T"]) / TICK_S + 1e-9) if since >= what["T"] else 0
                command = held[back]
            for i in range(3):
                c = command[i]
                acting[i] = copysign(max(abs(c) - dead[i], 0.0), c)
            remember(data.qpos.tolist(), data.qvel.tolist())
            mujoco.mj_step(model, data)
            if effect == "gyro_lag":
                share = 1 - exp(-STEP_S / (what["T"] / 2))
                for g in range(2):
                    poles[g] += share * (data.sensordata[3 * g : 3 * g + 3] - poles[g])
                    poles[2 + g] += share * (poles[g] - poles[2 + g])
    mujoco.set_mjcb_passive(None)
    return np.array(rows)


COLUMNS = ["t_us", "u1", "u2", "u3", "theta1", "theta2", "theta3", "g1x", "g1y", "g1z", "g2x", "g2y", "g2z"]


def turned(rotation, rng):
    """A mounting, one to four degrees off."""
    axis = rng.normal(size=3)
    angle = rng.uniform(1, 4) * pi / 180
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.array(rotation) @ (np.eye(3) + sin(angle) * k + (1 - cos(angle)) * k @ k)


def recordings(shown, effect, size, seed):
    """The two recordings of a robot as rows; `shown` is its description as text."""
    robot = tomllib.loads(shown)
    everything = sorted({**EFFECTS, **OUTSIDERS})
    rng = np.random.default_rng([seed, everything.index(effect), 7])
    what = dict({**EFFECTS, **OUTSIDERS}[effect])
    if size == "weak":
        whole = ("at", "p", "T", "zeta") if effect in ("stribeck", "cogging", "friction_drift", "gyro_bias_drift") else ()
        what = dict(WEAK.get(effect, {name: value if name in whole or name == "slip" else value / 3 for name, value in what.items()}))
    p = drawn(robot, effect, what, rng)
    gyros = [sensor for sensor in robot["sensor"] if sensor["kind"] == "gyro"]
    mountings = [turned(gyro["rotation"]["start"], rng) for gyro in gyros]
    biases = [np.array(gyro["bias_rad_s"]["start"]) * rng.uniform(0.9, 1.1, 3) for gyro in gyros]
    made = [simulate(robot, effect, what, p, mountings, biases, rng, validation) for validation in (False, True)]
    return dict(what=what, **p), made


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument("--effects", default=",".join({**EFFECTS, **OUTSIDERS}))
    parser.add_argument("--size", default="medium", choices=["medium", "weak"])
    arguments = parser.parse_args()
    shown = subprocess.run([arguments.host, "robot", "show", "doggy"], capture_output=True, text=True, check=True).stdout
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    cases = [(f"doggy {arguments.size}", effect, seed) for seed in seeds for effect in arguments.effects.split(",")]

    def make(folder, _, effect, seed):
        truth, rows = recordings(shown, effect, arguments.size, seed)
        (folder / "truth.json").write_text(json.dumps(truth))
        return diagnosed(folder, arguments.host, COLUMNS, rows)

    count(arguments, cases, make)
    return 0


if __name__ == "__main__":
    sys.exit(main())
