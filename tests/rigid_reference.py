"""The rigid walker a second time: four coordinates, and multipliers for the foot that rolls."""

import numpy as np
from scipy.integrate import solve_ivp

import jaxbiped as jb


def mass_matrix(walker, theta):
    """Of (hip x, hip z, θ1, θ2), without any contact."""
    m, d = float(walker.m), float(walker.d)
    matrix = np.diag([float(walker.total_mass)] * 2 + [float(walker.J) + m * d * d] * 2)
    for i, angle in enumerate(theta):
        column = m * d * np.array([np.cos(angle), np.sin(angle)])
        matrix[:2, 2 + i] = matrix[2 + i, :2] = column
    return matrix


def contact_rows(walker, angle, leg):
    """Velocity of the point of a foot that touches, by (hip vx, hip vz, ω1, ω2)."""
    reach, r = float(walker.hip_to_foot), float(walker.r)
    rows = np.zeros((2, 4))
    rows[:, :2] = np.eye(2)
    rows[:, 2 + leg] = [reach * np.cos(angle) + r, reach * np.sin(angle)]
    return rows


def coordinates(scene, state):
    whole = jb.dynamics.whole_state(scene, state)
    theta = np.array([float(state.theta_1), float(state.theta_2)])
    rates = np.array([float(whole.hip_vx), float(whole.hip_vz), *map(float, state[3:])])
    return whole, theta, rates


def rolling_solution(scene, theta, rates):
    """Accelerations of (hip x, hip z, θ1, θ2), and the ground's force on foot 2 (x, z)."""
    walker, slope, g = scene.walker, float(scene.ground.slope), float(scene.ground.g)
    m, d, total = float(walker.m), float(walker.d), float(walker.total_mass)
    matrix, rows = mass_matrix(walker, theta), contact_rows(walker, theta[1], 1)
    pull = g * np.array([np.sin(slope), -np.cos(slope)])
    forces = np.concatenate([total * pull, np.zeros(2)])
    for i, angle in enumerate(theta):
        outward = np.array([-np.sin(angle), np.cos(angle)])
        forces[:2] -= m * d * outward * rates[2 + i] ** 2
        forces[2 + i] += m * d * pull @ [np.cos(angle), np.sin(angle)]
    reach = float(walker.hip_to_foot)
    centripetal = reach * np.array([-np.sin(theta[1]), np.cos(theta[1])]) * rates[3] ** 2
    system = np.block([[matrix, -rows.T], [rows, np.zeros((2, 2))]])
    return np.linalg.solve(system, np.concatenate([forces, -centripetal]))


def impact_solution(scene, theta, rates):
    """Rates after the plastic impact of foot 1, and its impulse (x, z)."""
    rows, matrix = contact_rows(scene.walker, theta[0], 0), mass_matrix(scene.walker, theta)
    system = np.block([[matrix, -rows.T], [rows, np.zeros((2, 2))]])
    return np.linalg.solve(system, np.concatenate([matrix @ rates, np.zeros(2)]))


def footstep(scene, state, drop=0.0):
    """Angles and rates of swing and stance leg after the next impact, and when it comes.

    The ground lies lower by `drop` where the foot comes down.
    """
    solved = _until_strike(scene, state, drop)
    y, time = solved.y_events[0][0], solved.t_events[0][0]
    after = impact_solution(scene, y[:2], y[[4, 5, 2, 3]])
    return np.array([y[1], y[0], after[3], after[2]]), time


def before_strike(scene, state):
    """Angles of swing and stance leg and their rates just before the next impact, shape (4,)."""
    return _until_strike(scene, state).y_events[0][0][:4]


def needed_friction(scene, state):
    """Least coefficient that keeps the stance foot from slipping before the next impact [–]."""
    solved = _until_strike(scene, state)
    times = np.linspace(0.0, solved.t_events[0][0], 1001)
    forces = [rolling_solution(scene, y[:2], y[[4, 5, 2, 3]])[4:] for y in solved.sol(times).T]
    along, normal = np.transpose(forces)
    return np.max(np.abs(along) / normal)


def _until_strike(scene, state, drop=0.0):
    _, theta, rates = coordinates(scene, state)
    reach = float(scene.walker.hip_to_foot)

    def strikes(t, y):
        height = reach * (np.cos(y[1]) - np.cos(y[0])) + drop
        return height if y[0] > y[1] + 0.05 else 1.0

    strikes.terminal, strikes.direction = True, -1
    # Angles, their rates, and the hip's velocity.
    start = np.array([*theta, rates[2], rates[3], rates[0], rates[1]])
    return solve_ivp(
        lambda t, y: _rates(scene, y), (0.0, 5.0), start, "DOP853", rtol=1e-12, atol=1e-13,
        events=strikes, dense_output=True,
    )  # fmt: skip


def _rates(scene, y):
    found = rolling_solution(scene, y[:2], y[[4, 5, 2, 3]])
    return np.array([y[2], y[3], found[2], found[3], found[0], found[1]])
