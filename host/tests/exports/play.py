"""Validates an FMU and plays it with FMPy: co-simulation by steps of the sample period, model exchange by CVode.

play.py FMU INPUTS.csv PERIOD TOLERANCE prints the variables of every sample of the first, then of the second.
INPUTS.csv has a row a sample: time, then u1..un, each held until the next row.
"""
import sys
import numpy as np
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

fmu, table, period, tolerance = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])
problems = validate_fmu(fmu)
assert not problems, problems
description = read_model_description(fmu, validate=True)
outputs = [variable.name for variable in description.modelVariables if variable.causality == "output"]
print(*outputs)

rows = np.loadtxt(table, delimiter=",", ndmin=2)
names = ["time"] + [f"u{i + 1}" for i in range(rows.shape[1] - 1)]
# A sample is a row with the input before it and one with its own: a jump, which solvers are told of.
held = np.empty((2 * len(rows) - 1, rows.shape[1]))
held[0::2] = rows
held[1::2, 0], held[1::2, 1:] = rows[1:, 0], rows[:-1, 1:]
signals = np.array([tuple(row) for row in held], dtype=[(name, float) for name in names])
stop = (len(rows) - 1) * period
for kind in ["CoSimulation", "ModelExchange"]:
    result = simulate_fmu(
        fmu, validate=False, stop_time=stop, fmi_type=kind, output_interval=period, step_size=period,
        relative_tolerance=tolerance, input=signals, output=outputs, record_events=False,
    )
    for row in result:
        print(*[repr(float(value)) for value in list(row)[1:]])
