"""What the stories share: the binary of the same build, and recordings that are made once."""

from __future__ import annotations

import functools
import json
import os
import subprocess
import tempfile
from pathlib import Path

import flexcal

HOST = os.environ["FLEXCAL_HOST"]
"""The binary `host` of the same build."""
ROOT = Path(__file__).resolve().parents[3]


def host(*arguments: str, cwd: str | os.PathLike[str], codes: tuple[int, ...] = (0,)) -> str:
    """Runs the binary; gives what it prints to stdout."""
    run = subprocess.run([HOST, *arguments], cwd=cwd, capture_output=True, text=True, check=False)
    assert run.returncode in codes, f"host {arguments} ended with {run.returncode}:\n{run.stderr}"
    return run.stdout


def without_times(result: object) -> object:
    """A result without the time that computing took."""
    if isinstance(result, dict):
        return {key: without_times(value) for key, value in result.items() if key != "seconds"}
    if isinstance(result, list):
        return [without_times(value) for value in result]
    return result


def same(test, ours: flexcal.Result, theirs: Path) -> None:
    """Both results have the same text, but for the time that computing took: `json` reads and writes doubles without loss."""
    ours_text = json.dumps(without_times(ours.to_dict()))
    theirs_text = json.dumps(without_times(json.loads(theirs.read_text())))
    test.assertEqual(ours_text, theirs_text)


@functools.cache
def scratch() -> Path:
    """A folder for the stories' files."""
    folder = tempfile.TemporaryDirectory(prefix="flexcal-")
    _KEPT.append(folder)
    return Path(folder.name)


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


@functools.cache
def doggy() -> flexcal.Recording:
    """A short motion of a simulated Doggy, saved as `doggy.mcap` in `scratch` and read from there."""
    os.chdir(scratch())
    flexcal.simulate("doggy", seed=3).save("doggy.mcap")
    return flexcal.load("doggy.mcap")


@functools.cache
def calibrated() -> flexcal.Calibration:
    """Its calibration."""
    return flexcal.calibrate(doggy())
