"""What the studies in MuJoCo share: a case made, imported and diagnosed by the program, judged, counted, and kept in a file that a study goes on from."""

import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np


def add_arguments(parser):
    """The arguments of every study."""
    parser.add_argument("host")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--out")
    parser.add_argument("--keep")


def run(host, *arguments):
    output = subprocess.run([host, *map(str, arguments)], capture_output=True, text=True)
    return output.returncode, output.stderr


def diagnosed(folder, host, columns, recordings, robot=None):
    """Writes the two recordings as tables, imports and diagnoses them; what the program said."""
    at = lambda file: folder / file
    described = ("--robot", at("robot.toml")) if robot else ()
    if robot:
        at("robot.toml").write_text(robot)
    for motion, rows in zip(("cal", "val"), recordings):
        np.savetxt(at(f"{motion}.csv"), rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        code, said = run(host, "import", at(f"{motion}.csv"), *described, "-o", at(f"{motion}.mcap"))
        if code != 0:
            return dict(verdict="refused", said=said[-400:])
    clock = time.time()
    code, said = run(host, "diagnose", at("cal.mcap"), "--holdout", at("val.mcap"), "-o", at("d.json"))
    told = json.loads(at("d.json").read_text()) if at("d.json").exists() else {}
    findings = told.get("findings", [])
    gain = (told.get("holdout_gain") or {}).get("share")
    return dict(code=code, seconds=round(time.time() - clock), verdict=told.get("verdict", "none was made"), named=[finding["effect"] for finding in findings], gain=gain, summary=told.get("summary", said[-400:]))


def judged(result):
    named = result.get("named", [])
    if result["verdict"] in ("refused", "none was made"):
        return result["verdict"]
    if result["effect"] == "none":
        return "right" if not named else "wrong"
    if result["effect"].startswith("outsider"):
        return "wrong" if named else "right" if result["verdict"] == "unknown" else "missing"
    if not named:
        return "missing"
    return "right" if named == [result["effect"]] else "beside others" if result["effect"] in named else "wrong"


def count(arguments, cases, make):
    """Makes every case `(robot, effect, seed)` that the file does not hold by `make(folder, robot, effect, seed)`; prints a line each and the counts by robot."""
    made = {}
    if arguments.out and Path(arguments.out).exists():
        for result in map(json.loads, Path(arguments.out).read_text().splitlines()):
            made[result["robot"], result["effect"], result["seed"]] = result
    counts = {}
    for name, effect, seed in cases:
        known = made.get((name, effect, seed))
        result = known or dict(robot=name, effect=effect, seed=seed, **case(name, effect, seed, arguments.keep, make))
        result["judged"] = judged(result)
        of_robot = counts.setdefault(name, {})
        of_robot[result["judged"]] = of_robot.get(result["judged"], 0) + 1
        print(f"{name:6} {effect:28} {seed:3} {result['judged']:14} {result['verdict']:14} {','.join(result.get('named', [])):40} {result.get('gain')} {result.get('seconds')} s", flush=True)
        if arguments.out and not known:
            with open(arguments.out, "a") as out:
                out.write(json.dumps(result) + "\n")
    for name, of_robot in counts.items():
        print(name, ", ".join(f"{count} {what}" for what, count in sorted(of_robot.items())))


def case(name, effect, seed, keep, make):
    """One case, made in a folder that is new, so that no file of an earlier run is taken for its own."""
    with tempfile.TemporaryDirectory() as folder:
        result = make(Path(folder), name, effect, seed)
        if keep:
            shutil.copytree(folder, Path(keep) / f"{name}_{effect}_{seed}", dirs_exist_ok=True)
    return result
