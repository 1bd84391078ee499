#!/usr/bin/env python3
"""Robots of another simulator, one hidden effect each, diagnosed by the program.

MuJoCo integrates the bodies; drives, friction and the hidden effect are torques that this file adds at every step of it.
The chains, the integration and the sensors are not those of the project's plant: encoders alone, a measured torque for the input. Most laws have the
program's forms: the study asks whether they are found on robots of other kinds.

    mass matrix, weight, Coriolis: MuJoCo ──┐
    motor torque, held for a tick ──────────┼─▶ joint accelerations ─▶ encoders, rounded to counts ─▶ CSV ─▶ host import, diagnose
    friction, springs, hidden effect ───────┘

    python tests/mujoco/study.py target/release/host [--robots arm2,arm3,flex1] [--effects ID,…] [--seeds N] [--first N] [--out FILE.jsonl] [--keep FOLDER]

Needs the packages mujoco and numpy. Prints a line a case and the count of right, wrong and missing names by robot. A case whose line stands in FILE.jsonl
is counted and not made again: another program needs another file. `--keep` leaves the files of every case in a folder of its own.
"""

import argparse
import sys

import mujoco
import numpy as np

from count import add_arguments, count, diagnosed

STEP_S = 5e-5
TICK_S = 1e-3
COUNT_RAD = 2 * np.pi / 65536
LENGTH_S = 16.0
# Of the recorded torque, N m.
TORQUE_SIGMA = 2e-3
# Coulomb friction is tanh(v / this); the slope of a robot file is twice that of the argument.
SMOOTH_RAD_S = 5e-3

# Joints: axis, origin in the body before, mass, centre, inertias about the centre (diagonal), armature, friction, viscous, centre of the sines, amplitude.
JOINT = dict(axis=(0, 1, 0), origin=(0, 0, 0), mass=1.0, centre=(0, 0, -0.2), inertia=(0.01, 0.01, 0.002), b=0.03, mu=0.25, v=0.08, middle=0.0, amplitude=0.7)
ROBOTS = {
    "arm2": [
        dict(JOINT, mass=1.6, centre=(0, 0, -0.18), b=0.06, mu=0.5, v=0.15),
        dict(JOINT, origin=(0, 0, -0.36), mass=0.8, centre=(0.01, 0, -0.15), b=0.03, mu=0.25, v=0.06, amplitude=0.9),
    ],
    "arm3": [
        dict(JOINT, axis=(0, 0, 1), mass=2.0, centre=(0.02, 0, 0.1), b=0.12, mu=0.8, v=0.3, amplitude=1.0),
        dict(JOINT, origin=(0, 0, 0.2), mass=1.4, centre=(0, 0, 0.16), b=0.1, mu=0.7, v=0.2, middle=0.4),
        dict(JOINT, origin=(0, 0, 0.35), mass=0.7, centre=(0, 0.01, 0.14), b=0.04, mu=0.3, v=0.07, middle=-0.6, amplitude=0.9),
    ],
    # Motor and link of one joint, a spring between them; encoders on both.
    "flex1": [dict(JOINT, mass=1.5, centre=(0, 0, -0.25), b=0.08, mu=0.4, v=0.1, k_s=70.0, d_s=0.25)],
}
# The effects, and the robots that can have them.
EFFECTS = {
    "none": "all",
    "stribeck": "all",
    "asymmetric_friction": "all",
    "quadratic_drag": "all",
    "cogging": "all",
    "cable_spring": "all",
    "position_friction": "all",
    "input_delay": "all",
    "encoder_eccentricity": "all",
    "load_friction": "all",
    "backlash": "flex1",
    "belt_hardening": "flex1",
}


def mjcf(joints):
    """The chain. An elastic joint's motor is a hinge of its own without a body that matters."""
    inner = ""
    for i, p in reversed(list(enumerate(joints))):
        x, y, z = p["origin"]
        armature = 0.0 if "k_s" in p else p["b"]
        inner = (
            f'<body pos="{x} {y} {z}"><joint name="q{i}" type="hinge" axis="{p["axis"][0]} {p["axis"][1]} {p["axis"][2]}" armature="{armature}"/>'
            f'<inertial mass="{p["mass"]}" pos="{p["centre"][0]} {p["centre"][1]} {p["centre"][2]}" '
            f'diaginertia="{p["inertia"][0]} {p["inertia"][1]} {p["inertia"][2]}"/>{inner}</body>'
        )
    motors = "".join(
        f'<body><joint name="m{i}" type="hinge" axis="{p["axis"][0]} {p["axis"][1]} {p["axis"][2]}" armature="{p["b"]}"/>'
        f'<inertial mass="1e-6" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/></body>'
        for i, p in enumerate(joints)
        if "k_s" in p
    )
    return (
        f'<mujoco><option timestep="{STEP_S}" gravity="0 0 -9.81" integrator="Euler"><flag contact="disable" eulerdamp="disable"/></option>'
        f"<worldbody>{inner}{motors}</worldbody></mujoco>"
    )


def hidden(effect, joints, rng):
    """What the robot of this draw has beside the model, by joint; torques are sized by the joint's Coulomb friction."""
    n = len(joints)
    mu = np.array([p["mu"] for p in joints])
    sign = rng.choice([-1.0, 1.0], n)
    some = rng.uniform(0.7, 1.4, n)
    return {
        "stribeck": dict(extra=0.6 * some * mu, at=0.12 * rng.uniform(0.7, 1.4)),
        # The constant part alone is the offset that every joint of these robots has.
        "asymmetric_friction": dict(part=0.25 * some * sign * mu, slope=0.4 * some * sign * np.array([p["v"] for p in joints])),
        "quadratic_drag": dict(c=0.12 * some * mu),
        "cogging": dict(a=0.3 * some * mu, p=int(rng.integers(4, 12)), phi=rng.uniform(-3, 3, n)),
        "cable_spring": dict(k=0.9 * some * mu, at=rng.uniform(-0.8, 0.8, n)),
        "position_friction": dict(a=0.4 * some * mu, phi=rng.uniform(-3, 3, n)),
        "input_delay": dict(ticks=4),
        "encoder_eccentricity": dict(a=4e-3 * some, phi=rng.uniform(-3, 3, n)),
        "load_friction": dict(a=0.12 * some),
        "backlash": dict(half=6e-3 * rng.uniform(0.7, 1.4)),
        "belt_hardening": dict(k3=70.0 * 20 * rng.uniform(0.7, 1.4)),
    }.get(effect, {})


def reference(joints, rng):
    """A sum of sines and a slow part in which speeds change their sign often."""
    sines = []
    for p in joints:
        hz = rng.uniform(0.15, 1.6, 6)
        a = rng.uniform(0.4, 1.0, 6) / hz**0.5
        sines.append((p["middle"], p["amplitude"] * a / a.sum(), hz, rng.uniform(-3, 3, 6)))

    def at(t):
        ease = min(1.0, t / 1.0)
        positions = []
        for p, (middle, a, hz, phase) in zip(joints, sines):
            start = p["middle"] if "k_s" not in p else 0.0
            goal = middle + float(np.sum(a * np.sin(2 * np.pi * hz * t + phase)))
            positions.append(start + ease * (goal - start))
        return np.array(positions)

    return at


def simulate(joints, effect, what, rng):
    """One recording: t_s, u, theta and, of an elastic joint, q."""
    model = mujoco.MjModel.from_xml_string(mjcf(joints))
    data = mujoco.MjData(model)
    n = len(joints)
    elastic = "k_s" in joints[0]
    links = np.arange(n)
    motors = np.arange(n, 2 * n) if elastic else links
    data.qpos[links] = [0.0 if elastic else p["middle"] for p in joints]
    mu = np.array([p["mu"] for p in joints])
    v = np.array([p["v"] for p in joints])
    gain = np.array([90.0 * p["b"] + 12.0 * p["mass"] for p in joints])
    wanted = reference(joints, rng)
    ticks, substeps = int(LENGTH_S / TICK_S), int(TICK_S / STEP_S)
    rows = []
    delayed = [np.zeros(n)] * what.get("ticks", 0)
    load = np.zeros(n)
    for tick in range(ticks):
        t = tick * TICK_S
        theta, speed = data.qpos[motors].copy(), data.qvel[motors].copy()
        before = wanted(t - TICK_S) if tick else wanted(0.0)
        goal = wanted(t)
        u = gain * (goal - theta) + 0.12 * gain * ((goal - before) / TICK_S - speed)
        u = np.clip(u, -60.0, 60.0)
        read = theta.copy()
        if effect == "encoder_eccentricity":
            read = read + what["a"] * np.sin(theta + what["phi"])
        counts = lambda x: np.round((x + rng.normal(0, 0.5 * COUNT_RAD, n)) / COUNT_RAD) * COUNT_RAD
        row = [t, *(u + rng.normal(0, TORQUE_SIGMA, n)), *counts(read)]
        if elastic:
            row += list(counts(data.qpos[links]))
        rows.append(row)
        delayed.append(u)
        acting = delayed.pop(0)
        for _ in range(substeps):
            x, w = data.qpos[motors], data.qvel[motors]
            level = mu.copy()
            if effect == "stribeck":
                level = level + what["extra"] * np.exp(-((w / what["at"]) ** 2))
            if effect == "position_friction":
                level = level + what["a"] * np.sin(x + what["phi"])
            if effect == "load_friction":
                level = level + what["a"] * np.abs(load)
            friction = level * np.tanh(w / SMOOTH_RAD_S) + v * w
            if effect == "asymmetric_friction":
                friction = friction + what["part"] * np.abs(np.tanh(w / SMOOTH_RAD_S)) + what["slope"] * np.abs(w)
            # Air and cables are the link's.
            place, rate = data.qpos[links], data.qvel[links]
            held = np.zeros(n)
            if effect == "quadratic_drag":
                held = what["c"] * rate * np.abs(rate)
            if effect == "cable_spring":
                held = what["k"] * (place - what["at"])
            if effect == "cogging":
                friction = friction + what["a"] * np.sin(what["p"] * x + what["phi"])
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[motors] += acting - friction
            data.qfrc_applied[links] -= held
            if elastic:
                wound, rate = place - x, rate - w
                if effect == "backlash":
                    met = np.abs(wound) > what["half"]
                    spring = np.where(met, joints[0]["k_s"] * (wound - np.sign(wound) * what["half"]) + joints[0]["d_s"] * rate, 0.0)
                else:
                    spring = joints[0]["k_s"] * wound + joints[0]["d_s"] * rate
                if effect == "belt_hardening":
                    spring = spring + what["k3"] * wound**3
                data.qfrc_applied[motors] += spring
                data.qfrc_applied[links] -= spring
                load = spring
            else:
                # The torque through the transmission: all but the rotor's own.
                load = acting - friction - held - np.array([p["b"] for p in joints]) * data.qacc[motors]
            mujoco.mj_step(model, data)
    return np.array(rows)


def robot_file(name, joints, rng):
    """The file that a user would have: bodies as unknowns, or from drawings where axes cross; starts off by some tens of percent."""
    drawn = any(abs(p["axis"][2]) > 0.5 for p in joints)
    off = lambda x: float(x * rng.uniform(0.7, 1.4))
    lines = [f'name = "{name}"', f'description = "{name} of another simulator"', "sample_period_s = 0.001", "coriolis = true", "gravity_m_s2 = [0.0, 0.0, -9.81]", "", "[input]", 'unit = "newton_metre"', ""]
    for i, p in enumerate(joints):
        axis = np.array(p["axis"])
        elastic = "k_s" in p
        inertia = p["inertia"][int(np.argmax(axis))] + p["mass"] * (np.dot(p["centre"], p["centre"]) - np.dot(p["centre"], axis) ** 2)
        lines += ["[[joint]]", f'name = "j{i + 1}"', 'kind = "revolute"', f"axis = [{axis[0]}.0, {axis[1]}.0, {axis[2]}.0]", f"origin_m = {[float(x) for x in p['origin']]}", "limits_rad = [-3.0, 3.0]", 'gravity = "acts"', f'transmission = "{"elastic" if elastic else "rigid"}"', f'friction = {{ law = "coulomb", slope_s_rad = {2 / SMOOTH_RAD_S} }}', "gear = 1.0", "[joint.body]"]
        x, y, z = p["inertia"] if drawn else (0.0, 0.0, 0.0)
        lines += [f"mass_kg = {p['mass'] if drawn else 0.0}", f"centre_m = {[float(x) for x in p['centre']] if drawn else [0.0, 0.0, 0.0]}", f"inertia_kg_m2 = {{ xx = {x}, yy = {y}, zz = {z} }}", "[joint.parameters]"]
        lines.append(f"b = {{ start = {off(p['b'])} }}" if elastic or drawn or i else f"b = {{ fixed = {p['b']} }}")
        if not drawn:
            lines.append(f"J = {{ start = {off(inertia)} }}")
            lines += [f"mz = {{ start = {off(p['mass'] * p['centre'][2])} }}", "mx = { start = 0.0 }"]
        lines += [f"mu = {{ start = {off(p['mu'])} }}", f"v = {{ start = {off(p['v'])} }}", "o = { start = 0.0 }"]
        if elastic:
            lines += [f"k_s = {{ start = {off(p['k_s'])} }}", f"d_s = {{ start = {off(p['d_s'])} }}"]
        lines.append("")
    sensors = ["motor_encoder", "link_encoder"] if "k_s" in joints[0] else ["motor_encoder"]
    for kind in sensors:
        for i in range(len(joints)):
            lines += ["[[sensor]]", f'kind = "{kind}"', f'joint = "j{i + 1}"', f"sigma_rad = {0.6 * COUNT_RAD}", ""]
    return "\n".join(lines)


def columns(joints):
    n = len(joints)
    names = ["t_s"] + [f"u{i + 1}" for i in range(n)] + [f"theta{i + 1}" for i in range(n)]
    return names + ([f"q{i + 1}" for i in range(n)] if "k_s" in joints[0] else [])


def recordings(name, effect, seed):
    """The two recordings of a robot, and the file that its user would have."""
    rng = np.random.default_rng([seed, sorted(EFFECTS).index(effect), sorted(ROBOTS).index(name)])
    joints = ROBOTS[name]
    what = hidden(effect, joints, rng)
    described = robot_file(name, joints, rng)
    return [simulate(joints, effect, what, rng) for _ in range(2)], described


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--effects", default=",".join(EFFECTS))
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    robots, effects = arguments.robots.split(","), arguments.effects.split(",")
    cases = [(name, effect, seed) for seed in seeds for effect in effects for name in robots if EFFECTS[effect] in ("all", name)]

    def make(folder, name, effect, seed):
        rows, described = recordings(name, effect, seed)
        return diagnosed(folder, arguments.host, columns(ROBOTS[name]), rows, described)

    count(arguments, cases, make)
    return 0


if __name__ == "__main__":
    sys.exit(main())
