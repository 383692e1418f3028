#!/usr/bin/env python3
"""Substeps of an elastic body, as docs/method.md has them, from forces to positions; contact is left out.

    substep.py FILE...

A FILE is JSON: a body, its state, and where the package led it; held.json is one (test/world/substep_test.cpp writes
them). Symbols, units and numbers in brackets are those of the page. Prints how far this script and the package are
apart, over the longest way of a particle in the substep, and fails above 1e-9.
"""
import json
import sys

import numpy as np

MOST = 1e-9
TINY = 1e-30  # of a complex step: derivatives to rounding
BITS = np.arange(8)[:, None] >> np.arange(3) & 1  # of a corner or of a product of coordinates: its axes
AXES, PAIRS, TRIPLE = [1, 2, 4], [3, 5, 6], 7


class Body:
    """Constants of a body, as arrays: one row a particle, or a cell."""

    def __init__(self, data):
        for name, value in data.items():
            setattr(self, name, np.array(value, dtype=None if value else int) if isinstance(value, list) else value)
        o, xi = 2 * BITS[None, None, :, :] - 1, self.xi[:, None, None, :]
        self.B = np.prod(np.where(BITS[None, :, None, :] == 1, o / 2, (1 + o * xi) / 2), axis=-1)  # (1)
        self.S = np.zeros((len(self.m), len(self.m)))
        for cell, at, area in zip(self.clamp_cell, self.clamp_at, self.clamp_area):  # (12)
            N = np.prod(np.where(BITS == 1, at, 1 - at), axis=1)
            corners = self.corners[cell]
            self.S[np.ix_(corners, corners)] += 40 * self.m0 / self.s ** 2 * area * np.outer(N, N)
        self.clamped = np.flatnonzero(np.diag(self.S))
        self.answer = 1 / self.m  # (15)
        self.answer[self.fixed] = 0
        self.held = len(self.clamped) > 0

    def coefficients(self, p):
        """(2) one cell a row, then the products of its axes, then x y z."""
        return 2 / self.s * np.einsum('cPk,ckd->cPd', self.B, p[self.corners])


def gradient(c):
    """(2) F"""
    return np.stack([c[:, axis] for axis in AXES], axis=-1)


def rotations(F):
    """R: of all rotations the one with the largest tr(R^T F)."""
    u, _, v = np.linalg.svd(F)
    u[:, :, 2] *= np.linalg.det(u @ v)[:, None]
    return u @ v


def square(a, axes=(1, 2)):
    return np.sum(a * a, axis=axes)  # without conjugates: a may have a complex step


def held_volume(F):
    """(4) J and kappa"""
    beyond = square(F) / 12 - 1
    kappa = (1 + np.where(beyond.real > 0, beyond, 0) ** 2) ** -0.75
    return kappa * np.linalg.det(F), kappa


def volume_strain(J):
    """(4) dU/dJ"""
    return np.where(J > 1.5, 0.5 * (1.5 / np.maximum(J, 1.5)) ** (2 / 3), np.maximum(J, -0.8) - 1)


def volume_energy(J):
    """(4) U"""
    torn = np.where(J.real > 1.5, J, 1.5) / 1.5
    return np.where(J.real > 1.5, 0.125 + 2.25 * (torn ** (1 / 3) - 1),
                    np.where(J.real < -0.8, 1.62 - 1.8 * (J + 0.8), (J - 1) ** 2 / 2))


def energy(body, c, R):
    """(3) of each cell, over its volume."""
    F, mu, lam = gradient(c), body.mu, body.lam
    J, _ = held_volume(F)
    C = np.swapaxes(F, 1, 2) @ F
    length = np.sqrt(square(C) / square(F) + 2 / 3 * square(c[:, PAIRS]))
    e = np.zeros((len(c), 8, 3), dtype=complex)
    e[:, PAIRS] = c[:, PAIRS] @ F / length[:, None, None]  # (5)
    q = lam / (lam + 2 * mu)
    plates = 0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        ik, jk = 1 << i | 1 << k, 1 << j | 1 << k
        trace, shear = e[:, ik, i] + e[:, jk, j], (e[:, ik, j] + e[:, jk, i]) / 2
        plates = plates + body.sigma[:, k] * (e[:, ik, i] ** 2 + e[:, jk, j] ** 2 + 2 * shear ** 2 + q * trace ** 2)
    least = body.sigma.min(axis=1)
    common = least * ((square(c[:, PAIRS]) - square(e[:, PAIRS])) / 2 + square(c[:, TRIPLE], 1))
    return mu * square(F - R) + lam * volume_energy(J) + mu * (plates + common)  # (3)


def forces(body, p, f):
    """(6) on the particles at p, and the stretch z that they show (9)."""
    c = body.coefficients(p)
    F = gradient(c)
    R = rotations(F)
    slope, steep = np.zeros_like(c), np.zeros_like(c)  # of W / vol and of J
    for product in AXES + PAIRS + [TRIPLE]:
        for d in range(3):
            shifted = c.astype(complex)
            shifted[:, product, d] += TINY * 1j
            slope[:, product, d] = energy(body, shifted, R).imag / TINY
            if product in AXES:
                steep[:, product, d] = held_volume(gradient(shifted))[0].imag / TINY
    J, kappa = held_volume(F)
    z2 = square(steep) + abs(volume_strain(J)) * kappa * np.sqrt(square(F))
    total = np.zeros_like(p)
    on_corners = -2 / body.s * f * np.einsum('c,cPk,cPd->ckd', body.vol, body.B, slope)
    np.add.at(total, body.corners, on_corners)
    return total, np.sqrt(max(3, z2.max()) / 3)


def highest_frequency(body):
    """(7) of the body at rest, by the eigenvalues of its stiffness."""
    n, step = body.X.size, 1e-5 * body.s
    stiffness = np.zeros((n, n))
    for dof in range(n):
        by = step * np.eye(1, n, dof).reshape(body.X.shape)
        stiffness[:, dof] = (forces(body, body.X - by, 1)[0] - forces(body, body.X + by, 1)[0]).ravel() / (2 * step)
    root = np.repeat(np.sqrt(body.m), 3)
    return np.sqrt(np.linalg.eigvalsh((stiffness + stiffness.T) / 2 / np.outer(root, root)).max())


def inverse_inertia(body, r):
    return np.linalg.inv(np.einsum('i,ij,ij->', body.m, r, r) * np.eye(3) - np.einsum('i,ij,ik->jk', body.m, r, r))


def substep(body, state, u):
    """From x, v, z and f of the last substep to those of this one."""
    x, v, z, f_last = state
    h, m = body.h, body.m[:, None]
    longest = 1.4 / (1.1 * z * body.omega)  # (7)
    f, tau = min(1, (longest / h) ** 2), max(h, longest) / 4
    r = x - np.sum(m * x, axis=0) / m.sum()
    V = np.zeros_like(v)
    if not body.held:  # (8)
        turn = inverse_inertia(body, r)
        V = np.sum(m * v, axis=0) / m.sum() + np.cross(turn @ np.sum(m * np.cross(r, v), axis=0), r)
    v = V + np.exp(-body.d * h) * np.sqrt(f / f_last) * (v - V)
    on_particles, z = forces(body, x + tau * v, f)  # (9)
    a = on_particles / m
    if not body.held:  # (10)
        a -= np.cross(turn @ np.sum(np.cross(r, m * a), axis=0), r)
    y = x + h * (v + h * (a + (f if body.held else 1) * body.g))  # (11)
    y[body.fixed] = x[body.fixed]
    if body.held:  # (12)
        phi, on = min(1, (1.1 * h * body.omega / 1.4) ** 2), body.clamped
        masses = np.diag(body.m[on])
        y[on] = body.X[on] + np.linalg.solve(masses + phi * body.S[np.ix_(on, on)], masses @ (y[on] - body.X[on]))
    y = pull(body, r, y, f, u)  # (13)
    return y, (y - x) / h, z, f  # (14)


def pull(body, r, y, f, u):
    """(18) and (15), of the spring of a pick."""
    on, b, stiff = body.grasp, body.w[:, None], body.K * body.h ** 2
    A = f * np.sum(body.w ** 2 * body.answer[on]) * np.eye(3)
    if not body.held:
        M, turn, r_b = body.m.sum(), inverse_inertia(body, r), np.sum(b * r[on], axis=0)
        across = np.cross(np.eye(3), r_b)  # across @ j is r_b x j
        A += (1 - f) * (np.eye(3) / M - across @ turn @ across)
    j = np.linalg.solve(np.eye(3) + stiff * A, stiff * (u - np.sum(b * y[on], axis=0)))
    y[on] += f * b * body.answer[on][:, None] * j
    return y if body.held else y + (1 - f) * (j / M + np.cross(turn @ np.cross(r_b, j), r))


def main(files):
    if not files:
        sys.exit(__doc__)
    worst = 0
    for name in files:
        with open(name) as file:
            data = json.load(file)
        body = Body(data['body'])
        exact = highest_frequency(body)
        assert 0.99 * exact < body.omega < 1.00001 * exact, 'omega is %g of %g 1/s' % (body.omega, exact)
        state = tuple(np.array(data['state'][key]) for key in ('x', 'v', 'z', 'f_last'))
        for number, (after, u) in enumerate(zip(data['x_after'], data['u'])):
            before = state[0]
            state = substep(body, state, np.array(u))
            apart = np.abs(state[0] - after).max() / np.linalg.norm(state[0] - before, axis=1).max()
            print('%s, substep %d: f %.3f, z %.2f, apart %.1e' % (name, number + 1, state[3], state[2], apart))
            worst = max(worst, apart) if apart <= MOST else np.inf
    sys.exit('more than %g apart' % MOST if not worst <= MOST else 0)


if __name__ == '__main__':
    main(sys.argv[1:])
