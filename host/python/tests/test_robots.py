"""Robots from other people's files."""

import importlib.util
import tomllib
import unittest
from pathlib import Path

import numpy as np

import flexcal
from flexcal import errors
from support import ROOT, calibrated, doggy, scratch

ARM = ROOT / "tests/robots/arm7.urdf"
TWO = """
<mujoco model="two">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.001"/>
  <worldbody>
    <body name="a" pos="0 0 1" quat="0.9 0.1 0.2 0.1">
      <joint name="a_motor" axis="0 0 1" armature="0.2" damping="1" frictionloss="2"/>
      <joint name="a_belt" axis="0 0 1" stiffness="300" damping="0.4"/>
      <inertial pos="0.1 0 0" mass="2" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>
      <site name="g" quat="0.7 0 0.7 0"/>
      <body name="b" pos="0.3 0 0" quat="0.7 0.1 0 0">
        <joint name="b" axis="0 1 0" range="-0.5 0.5" ref="0.1" pos="0.05 0 0"/>
        <inertial pos="0 0.1 0" mass="1" diaginertia="0.01 0.02 0.015"/>
        <body name="tool" pos="0.1 0 0"><inertial pos="0 0 0" mass="0.3" diaginertia="0.001 0.001 0.001"/></body>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="a" range="-1 1"><joint joint="a_motor" coef="1"/><joint joint="a_belt" coef="1"/></fixed></tendon>
  <actuator><general name="a" joint="a_motor" gainprm="3"/><motor name="b" joint="b"/></actuator>
  <sensor><gyro name="g" site="g" noise="0.002"/></sensor>
</mujoco>
"""


class Urdf(unittest.TestCase):
    def test_an_arm(self):
        drive = flexcal.Drive("duty", "elastic", gear=50.0, supply_v=24.0, parameters={"k_s": 250.0})
        arm = flexcal.robot_from_urdf(ARM, drive=drive)
        self.assertEqual(arm.joints[:2], ["shoulder_yaw", "shoulder_pitch"])
        self.assertEqual(len(arm.joints), 7)
        self.assertEqual(arm.channels, {f"theta{i + 1}": "rad" for i in range(7)})
        known = flexcal.robot(ROOT / "tests/robots/arm7.toml")
        ours, theirs = tomllib.loads(arm.toml)["joint"], tomllib.loads(known.toml)["joint"]
        for one, other in zip(ours, theirs, strict=True):
            self.assertEqual((one["body"], one["origin_m"], one["axis"]), (other["body"], other["origin_m"], other["axis"]))
        arm.save(scratch() / "arm.toml")
        self.assertEqual(flexcal.robot(scratch() / "arm.toml").joints, arm.joints)

    def test_a_joint_that_is_not_there(self):
        with self.assertRaises(errors.UsageError) as told:
            flexcal.robot_from_urdf(ARM, locked=["finger"])
        self.assertIn("shoulder_yaw", told.exception.advice)


@unittest.skipUnless(importlib.util.find_spec("mujoco"), "the package mujoco is not installed")
class Mjcf(unittest.TestCase):
    def setUp(self):
        self.path = scratch() / "two.xml"
        self.path.write_text(TWO)

    def test_bodies_and_gravity_are_those_of_mujoco(self):
        import mujoco

        robot = flexcal.robot_from_mjcf(self.path)
        text = tomllib.loads(robot.toml)
        first, second = text["joint"]
        self.assertEqual([first["transmission"], second["transmission"]], ["elastic", "rigid"])
        self.assertEqual((first["limits_rad"], second["limits_rad"]), ([-1.0, 1.0], [-0.5, 0.5]))
        starts = {name: value["start"] for name, value in first["parameters"].items()}
        self.assertEqual(starts, {"b": 0.2, "mu": 2.0, "v": 1.0, "k_s": 300.0, "d_s": 0.4})
        self.assertEqual(text["sensor"][-1]["sigma_rad_s"], 0.002)
        # Positions of all masses at other angles than zero: both chains put them in the same places.
        model = mujoco.MjModel.from_xml_path(str(self.path))
        data = mujoco.MjData(model)
        angles = [0.3, -0.2]
        data.joint("a_motor").qpos[0], data.joint("b").qpos[0] = angles
        mujoco.mj_forward(model, data)
        to_world, origin, centres = np.eye(3), np.zeros(3), []
        for joint, angle in zip((first, second), angles, strict=True):
            axis = np.array(joint["axis"])
            cross = np.cross(np.eye(3), axis)
            turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
            origin = origin + to_world @ joint["origin_m"]
            to_world = to_world @ np.array(joint["rotation"]).T @ turn
            centres.append(origin + to_world @ joint["body"]["centre_m"])
        tool = (1.0 * data.body("b").xipos + 0.3 * data.body("tool").xipos) / 1.3
        # Products of rotations of order one: atol 1e-12 m.
        np.testing.assert_allclose(centres, [data.body("a").xipos, tool], atol=1e-12)
        self.assertEqual(second["body"]["mass_kg"], 1.3)

    def test_a_calibrated_robot_goes_to_mujoco_and_comes_back(self):
        cal = calibrated()
        text, losses = cal.export("mjcf")
        self.assertTrue(losses)
        path = scratch() / "doggy.xml"
        path.write_text(text)
        back = flexcal.robot_from_mjcf(path, drive=flexcal.Drive("duty", gear=42.092, supply_v=32.0))
        ours, theirs = tomllib.loads(back.toml), tomllib.loads(doggy().robot.toml)
        self.assertEqual(back.channels, doggy().robot.channels)
        for i, (one, other) in enumerate(zip(ours["joint"], theirs["joint"], strict=True)):
            axis = np.array(one["axis"])
            # MuJoCo keeps axes, centres and quaternions as doubles: atol 1e-9.
            np.testing.assert_allclose(axis, other["axis"], atol=1e-9)
            np.testing.assert_allclose(one["body"]["centre_m"], other["body"]["centre_m"], atol=1e-9)
            np.testing.assert_allclose(one["limits_rad"], other["limits_rad"], atol=1e-9)
            # The exported numbers are the estimates; rtol 1e-12 is their print.
            np.testing.assert_allclose(one["parameters"]["k_s"]["start"], cal[f"k_s[{i + 1}]"], rtol=1e-12)
        turned = [np.array(s["rotation"]["start"]) for s in ours["sensor"] if s["kind"] == "gyro"]
        for name, matrix in zip(("imu1", "imu2"), turned, strict=True):
            np.testing.assert_allclose(matrix, cal.rotations[name], atol=1e-9)

    def test_what_is_no_chain_is_named(self):
        self.path.write_text(TWO.replace('<joint name="b" axis="0 1 0" range="-0.5 0.5" ref="0.1" pos="0.05 0 0"/>', '<joint name="b" type="ball"/>').replace('<motor name="b" joint="b"/>', ""))
        with self.assertRaises(errors.DataError) as told:
            flexcal.robot_from_mjcf(self.path)
        self.assertIn("'b'", str(told.exception))


if __name__ == "__main__":
    unittest.main()
