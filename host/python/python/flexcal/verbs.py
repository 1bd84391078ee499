"""The verbs: calibrate, verify, diagnose, observe, check."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Literal

from . import _native
from ._progress import Progress, callback
from .recordings import Recording, as_recording
from .results import Calibration, Check, Diagnosis, Observation, Verification, load_calibration
from .robots import Robot, as_robot

__all__ = ["calibrate", "check", "diagnose", "observe", "verify"]

Given = Recording | str | os.PathLike[str]
"""A recording, or the path of one."""


def calibrate(
    recordings: Given | Iterable[Given],
    *,
    robot: Robot | str | os.PathLike[str] | None = None,
    preset: Literal["default", "paper"] = "default",
    noise: Literal["estimated", "fixed"] | None = None,
    extend: Sequence[str] = (),
    unchecked: bool = False,
    progress: Progress = None,
) -> Calibration:
    """Calibrates the elastic-joint model: all states of all samples and the shared parameters by one least-squares problem.

    The interpreter's lock is free meanwhile. Ctrl-C ends the call at once.

    Parameters
    ----------
    recordings
        One recording or several of one robot. They share all parameters but the gyros' biases.
    robot
        Another description than the one in the recordings.
    preset
        Assumptions: `default`, or `paper` to reproduce the paper with its biases.
    noise
        Noise of sensors and model steps: `estimated` from the recording (`default` does so) or `fixed`, as the robot's description says.
    extend
        Ids of effects that extend the base model, as `base_bearing`.
    unchecked
        Goes on though units, signs, columns, rate or sensors look wrong.
    progress
        A function that is called with what begins, `True` for lines on stderr.

    Returns
    -------
    Calibration
        Where it is not to be used (`Calibration.is_usable`), with the warning `UntrustedResult`.

    Raises
    ------
    DataError
        A recording that cannot be used, with what to change.
    NoConvergenceError
        The solver gave up.
    """
    outcome = _native.calibrate(
        _recordings(recordings),
        robot=None if robot is None else as_robot(robot)._native,
        preset=preset,
        noise=noise,
        extend=list(extend),
        unchecked=unchecked,
        progress=callback(progress),
    )
    return Calibration(outcome)._warned()


def verify(
    calibration: Calibration | str | os.PathLike[str],
    recording: Given,
    *,
    unchecked: bool = False,
    progress: Progress = None,
) -> Verification:
    """Predicts a recording by a calibrated model: a free run, and windows 10, 100, 500 and 2000 ms ahead from past readings only.

    Give a recording that the calibration has not seen: that is what tells a good model from a good fit.
    """
    native = as_recording(recording)._native
    outcome = _native.verify(
        _calibration(calibration).to_json(), native, unchecked=unchecked, progress=callback(progress)
    )
    return Verification(outcome)


def diagnose(
    recordings: Given | Iterable[Given],
    *,
    holdout: Given | None = None,
    robot: Robot | str | os.PathLike[str] | None = None,
    without: Sequence[str] = (),
    unchecked: bool = False,
    progress: Progress = None,
) -> Diagnosis:
    """Shows what the model gets wrong: tries every effect of the catalogue on what the base model leaves unexplained.

    Parameters
    ----------
    recordings
        One recording or several of one robot.
    holdout
        Another motion of the same robot, to measure the gain on. Default: the last third of each recording.
    robot
        Another description than the one in the recordings.
    without
        Ids of effects that are left out of the catalogue.
    unchecked, progress
        As in `calibrate`.
    """
    outcome = _native.diagnose(
        _recordings(recordings),
        holdout=None if holdout is None else as_recording(holdout)._native,
        robot=None if robot is None else as_robot(robot)._native,
        without=list(without),
        unchecked=unchecked,
        progress=callback(progress),
    )
    return Diagnosis(outcome)


def observe(
    calibration: Calibration | str | os.PathLike[str],
    recording: Given,
    *,
    sensors: Literal["both", "gyros", "encoders"] = "both",
    unchecked: bool = False,
    progress: Progress = None,
) -> Observation:
    """Runs the robot's observer on a recording: an extended Kalman filter over the calibrated model, in the device's single precision.

    `sensors` is what is read: `gyros` alone (positions start from the encoders), `encoders` (all but gyros), or `both`.
    """
    native = as_recording(recording)._native
    outcome = _native.observe(
        _calibration(calibration).to_json(), native, sensors=sensors, unchecked=unchecked, progress=callback(progress)
    )
    return Observation(outcome)


def check(recording: Given) -> Check:
    """Tells whether a recording is fit for calibration, and what to change if not."""
    return Check(_native.check(as_recording(recording)._native))


def _recordings(given: Given | Iterable[Given]) -> list[_native.Recording]:
    if isinstance(given, (Recording, str, os.PathLike)):
        return [as_recording(given)._native]
    return [as_recording(recording)._native for recording in given]


def _calibration(given: Calibration | str | os.PathLike[str]) -> Calibration:
    return given if isinstance(given, Calibration) else load_calibration(given)
