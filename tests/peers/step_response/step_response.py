#!/usr/bin/env python3
"""Step responses of an axis of the TX8 table under its PID module, computed with scipy.

    pip install -r tests/peers/step_response/requirements.txt
    python3 tests/peers/step_response/step_response.py            # writes step_response.csv beside this file
    python3 tests/peers/step_response/step_response.py --check    # compares a new computation with that file

It shares no code with the simulated axis, and no method where that can be:

- `speed` and `current` are linear. The loop is taken as continuous, amplifier, motor and controller are one system of
  differential equations, and scipy.signal solves it exactly. No sampling, no counts, no steps of time.
- `friction` and `far` have dry friction, a command limit, slew, anti-windup, the amplifier's current limit. Between two
  samples of the controller an integrator of high order with step control (DOP853) follows the motor, and finds the
  moments at which it stops.

The parameters are written here anew, from the documentation of `AxisProfile::default()` in tools/cell and of
protocols/drives/src/pid; tools/cell/tests/table/step_response.rs sets the same ones.
"""

import math
import sys
from pathlib import Path

import numpy as np
import scipy
from scipy import signal
from scipy.integrate import solve_ivp

CSV = Path(__file__).with_suffix(".csv")

# The axis.
CONSTANT = 0.06  # N m/A
RESISTANCE = 1.2  # ohm
INERTIA = 5e-5  # kg m^2
VISCOUS = 2e-5  # N m s/rad
COULOMB = 0.02  # N m
MAX_CURRENT = 20.0  # A
SUPPLY = 48.0  # V
CURRENT_LOOP = 0.2e-3  # s
FULL_SPEED = 100.0 * math.pi  # rad/s
SPEED_GAIN = 0.15  # A s/rad
FULL_CURRENT = 20.0  # A
COUNTS = 2000 / math.tau  # counts a radian

# The controller.
PERIOD = 100e-6  # s
FILTER = 1e-3  # s

STEP = 1e-3  # between two rows of the table, s
ROWS = 401


def linear(kp, ki, kd, target, speed_mode):
    """The continuous loop: states are current, speed, position (counts), integral, filtered velocity."""
    if speed_mode:
        input_gain, speed_gain = SPEED_GAIN * FULL_SPEED, SPEED_GAIN
    else:
        input_gain, speed_gain = FULL_CURRENT, 0.0
    # command = kp (r - x) + integral - kd v
    command = np.array([0.0, 0.0, -kp, 1.0, -kd])
    a = np.zeros((5, 5))
    a[0] = command * input_gain / CURRENT_LOOP
    a[0, 0] -= 1.0 / CURRENT_LOOP
    a[0, 1] -= speed_gain / CURRENT_LOOP
    a[1, 0] = CONSTANT / INERTIA
    a[1, 1] = -VISCOUS / INERTIA
    a[2, 1] = COUNTS
    a[3, 2] = -ki
    a[4, 1] = COUNTS / FILTER
    a[4, 4] = -1.0 / FILTER
    b = np.array([[kp * input_gain / CURRENT_LOOP], [0.0], [0.0], [ki], [0.0]])
    system = signal.StateSpace(a, b, np.array([[0.0, 0.0, 1.0, 0.0, 0.0]]), np.zeros((1, 1)))
    times = np.arange(ROWS) * STEP
    _, response = signal.step(system, T=times)
    return response * target


def sampled(kp, ki, kd, target, limit, slew):
    """The sampled loop in speed mode, with everything that is not linear."""
    current, speed, angle = 0.0, 0.0, 0.5 / COUNTS
    integral, velocity, output = 0.0, 0.0, 0.0
    last = 0
    rows = []
    for sample in range(round((ROWS - 1) * STEP / PERIOD) + 1):
        if sample % round(STEP / PERIOD) == 0:
            rows.append(angle * COUNTS - 0.5)
        counts = math.floor(angle * COUNTS)
        velocity += ((counts - last) / PERIOD - velocity) * PERIOD / (FILTER + PERIOD)
        last = counts
        error = target - counts
        candidate = np.clip(integral + ki * PERIOD * error, -limit, limit)
        wanted = kp * error + candidate - kd * velocity
        allowed = np.clip(wanted, -limit, limit)
        output = np.clip(allowed, output - slew * PERIOD, output + slew * PERIOD)
        excess = wanted - output
        if not (excess > 0 and error > 0 or excess < 0 and error < 0):
            integral = candidate
        current, speed, angle = move(current, speed, angle, output)
    return np.array(rows)


def move(current, speed, angle, command):
    """The motor through one period of the controller."""
    now = 0.0
    while now < PERIOD:
        moving = speed != 0.0
        sense = math.copysign(1.0, speed) if moving else math.copysign(1.0, CONSTANT * current)
        sticks = not moving and abs(CONSTANT * current) <= COULOMB

        def slope(_, state):
            i, w, _ = state
            asked = np.clip((command * FULL_SPEED - w) * SPEED_GAIN, -MAX_CURRENT, MAX_CURRENT)
            asked = np.clip(
                asked, (-SUPPLY - CONSTANT * w) / RESISTANCE, (SUPPLY - CONSTANT * w) / RESISTANCE
            )
            torque = 0.0 if sticks else CONSTANT * i - VISCOUS * w - COULOMB * sense
            return [(asked - i) / CURRENT_LOOP, torque / INERTIA, 0.0 if sticks else w]

        def stops(_, state):
            return state[1] * sense

        stops.terminal, stops.direction = True, -1

        def breaks_loose(_, state):
            return CONSTANT * abs(state[0]) - COULOMB

        breaks_loose.terminal, breaks_loose.direction = True, 1
        solution = solve_ivp(
            slope,
            (now, PERIOD),
            [current, speed, angle],
            method="DOP853",
            rtol=1e-8,
            atol=1e-9,
            events=breaks_loose if sticks else stops,
        )
        now = solution.t[-1]
        current, speed, angle = solution.y[:, -1]
        if solution.status == 1:
            if sticks:
                # Over the edge, so that the next piece moves.
                current = math.copysign(COULOMB / CONSTANT * (1 + 1e-9), current)
            else:
                speed = 0.0
    return current, speed, angle


def table():
    return {
        "speed": linear(kp=3e-4, ki=1e-3, kd=1e-6, target=1000, speed_mode=True),
        "current": linear(kp=5e-4, ki=5e-3, kd=1.3e-5, target=1000, speed_mode=False),
        "friction": sampled(kp=5e-4, ki=4e-3, kd=0.0, target=500, limit=0.2, slew=20.0),
        "far": sampled(kp=5e-4, ki=3e-3, kd=2e-6, target=20_000, limit=1.0, slew=100.0),
    }


def main():
    columns = table()
    if sys.argv[1:] == ["--check"]:
        before = np.loadtxt(CSV, delimiter=",", comments="#", skiprows=4)
        new = np.column_stack(list(columns.values()))
        worst = np.abs(before[:, 1:] - new).max(axis=0)
        for name, difference in zip(columns, worst):
            print(f"{name}: {difference:.4f} counts from {CSV.name}")
        sys.exit(0 if worst.max() < 0.1 else 1)
    with CSV.open("w") as file:
        file.write("# Step responses of an axis of the TX8 table, in counts from where it started; gains and targets\n")
        file.write("# are in step_response.py. Made by `python3 tests/peers/step_response/step_response.py`\n")
        file.write(f"# with numpy {np.__version__} and scipy {scipy.__version__}.\n")
        file.write("ms," + ",".join(columns) + "\n")
        for row in range(ROWS):
            values = ",".join(f"{column[row]:.3f}" for column in columns.values())
            file.write(f"{row},{values}\n")
    for name, column in columns.items():
        print(f"{name}: greatest {column.max():.1f}, last {column[-1]:.1f} counts")


main()
