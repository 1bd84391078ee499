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


problem = casadi.Opti()
xs, us = problem.variable(states, intervals + 1), problem.variable(inputs, intervals)
problem.subject_to(xs[:, 0] == 0)
problem.subject_to(problem.bounded(-1, casadi.vec(us), 1))
cost = 0
for k in range(intervals):
    problem.subject_to(xs[:, k + 1] == flow(xs[:, k], us[:, k]))
    cost += casadi.sumsqr(xs[:inputs, k + 1] - path((k + 1) * held_s)) + 1e-6 * casadi.sumsqr(us[:, k])
problem.minimize(1e3 * cost)
problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "hessian_approximation": "limited-memory", "tol": 1e-5, "max_iter": 300})
solution = problem.solve()
for column in np.atleast_2d(solution.value(us)).T:
    for _ in range(round(held_s / period)):
        print(*[repr(float(value)) for value in column])
