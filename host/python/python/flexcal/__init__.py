"""Dynamics calibration of flexible-joint robots from cheap sensors.

>>> import flexcal
>>> run = flexcal.simulate("doggy", seed=3)                # or flexcal.load("run.mcap"), flexcal.from_arrays(…)
>>> cal = flexcal.calibrate(run, progress=print)           # doctest: +SKIP
>>> cal.parameters                                         # doctest: +SKIP
>>> flexcal.verify(cal, flexcal.simulate(seed=3, nth=2))   # doctest: +SKIP

Numbers are those of the binary `host`, of all verbs but `diagnose` to the bit; `to_dict` and `save` its files, and results show its pages in a notebook. SI units throughout, on the
link side of the gear. Errors (`flexcal.errors`) say what is wrong and what to do.
"""

from __future__ import annotations

from . import errors
from ._description import Drive
from ._native import __version__
from .errors import FlexcalError, UntrustedResult
from .mjcf import robot_from_mjcf
from .recordings import Recording, from_arrays, load, simulate
from .results import Calibration, Check, Diagnosis, Observation, Result, Verification, load_calibration
from .robots import Robot, robot, robot_from_text, robot_from_urdf, robot_names
from .verbs import calibrate, check, diagnose, observe, verify

__all__ = [
    "Calibration",
    "Check",
    "Diagnosis",
    "Drive",
    "FlexcalError",
    "Observation",
    "Recording",
    "Result",
    "Robot",
    "UntrustedResult",
    "Verification",
    "__version__",
    "calibrate",
    "check",
    "diagnose",
    "errors",
    "from_arrays",
    "load",
    "load_calibration",
    "observe",
    "robot",
    "robot_from_mjcf",
    "robot_from_text",
    "robot_from_urdf",
    "robot_names",
    "simulate",
    "verify",
]
