"""A toy MPC in CasADi: inputs that lead the links of Doggy along a path of 0.5 s, from the C functions of `host export --c`.

track.py LIBRARY CAL.json estimate|initial PERIOD prints the inputs of every sample, n a line. The model's parameters are those of CAL.json:
`estimate`, the calibrated ones, or `initial`, the guess that the calibration started from.
"""
import json
import sys
import casadi
import numpy as np

library, calibration, which, period = sys.argv[1], json.load(open(sys.argv[2])), sys.argv[3], float(sys.argv[4])
rates = casadi.external("doggy_f", library)  # x, u, p, t -> xdot; its exact Jacobian is found by its name
states, inputs = rates.size1_in(0), rates.size1_in(1)
p = [parameter[which] for parameter in calibration["parameters"]]
assert len(p) == rates.size1_in(2)

# Inputs are held over 20 ms; the state is integrated in steps of half a sample.
held_s, intervals = 0.020, 25
steps = round(2 * held_s / period)
x, u = casadi.MX.sym("x", states), casadi.MX.sym("u", inputs)
h = held_s / steps
k1 = rates(x, u, p, 0)
k2 = rates(x + h / 2 * k1, u, p, 0)
k3 = rates(x + h / 2 * k2, u, p, 0)
k4 = rates(x + h * k3, u, p, 0)
step = casadi.Function("step", [x, u], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
interval = step.mapaccum("interval", steps)
flow = casadi.Function("flow", [x, u], [interval(x, casadi.repmat(u, 1, steps))[:, -1]])


def path(t_s):
    """The links' positions on the path, rad."""
    return np.array([0.3, -0.2, 0.25]) * (1 - np.cos(2 * np.pi * t_s)) / 2


us = casadi.MX.sym("us", inputs, intervals)
x, residuals = casadi.DM.zeros(states), []
for k in range(intervals):
    x = flow(x, us[:, k])
    residuals.append((x[:inputs] - path((k + 1) * held_s)) / 1e-3)
residuals.append(0.01 * casadi.vec(us))
residual = casadi.Function("residual", [casadi.vec(us)], [casadi.vertcat(*residuals)])
slopes = residual.jacobian()

# Levenberg-Marquardt steps, each a quadratic problem within the bounds of the duty.
size = inputs * intervals
quadratic = casadi.conic("quadratic", "qrqp", {"h": casadi.Sparsity.dense(size, size)}, {"print_iter": False, "print_header": False, "print_info": False})
best = casadi.DM.zeros(size)
r = residual(best)
damping = 1.0
for _ in range(60):
    j = slopes(best, r)
    while True:
        h = j.T @ j + damping * casadi.DM.eye(size)
        trial = best + quadratic(h=h, g=j.T @ r, lbx=-1 - best, ubx=1 - best)["x"]
        r_trial = residual(trial)
        before, after = float(casadi.sumsqr(r)), float(casadi.sumsqr(r_trial))
        if after < before or damping > 1e12:
            break
        damping *= 8
    if not after < before:
        break
    best, r, damping = trial, r_trial, damping / 8
    if before - after < 1e-4 * before:
        break
print(f"cost {float(casadi.sumsqr(r)):.3g}", file=sys.stderr)
for column in np.array(casadi.reshape(best, inputs, intervals)).T:
    for _ in range(round(held_s / period)):
        print(*[repr(float(value)) for value in column])
