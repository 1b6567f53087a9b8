"""Motions that a mode problem has, of more contacts than have all their sets tried: Newton's method from many starts.

What a contact bears is a fixed point of the projection on what it can bear: lam_n of max(0, lam_n - r w_n), lam_t of
those that stand of the disc of mu lam_n, by lam_t - r w_t, and lam_t = -mu lam_n s of those that slide (Alart and
Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991)). None is missed for having many contacts, though some may be.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mode_enumeration import OFF, SLIP, STICK, Contact, Tried, tried

STEPS, HALVINGS = 60, 6
SOLVED = 1e-9  # part of the largest acceleration asked for


def motions(G: np.ndarray, bare: np.ndarray, contacts: list[Contact], starts: int, seed: int = 0) -> Iterator[Tried]:
    """Yield the sets of modes that Newton's method comes to from so many random loads."""
    rng, scale = np.random.default_rng(seed), np.sqrt(np.diag(G))
    for one in contacts:  # alike across, so that a disc stays one
        scale[one.along] = np.linalg.norm(scale[one.along])
    A, b = G / np.outer(scale, scale), bare / scale
    weights = [float(scale[one.along[0]] / scale[one.normal]) for one in contacts]
    for k in range(starts):
        x = np.linalg.norm(b) * rng.normal(size=len(b)) * (k > 0)
        x = _solved(A, b, contacts, weights, x)
        if np.abs(_residual(A, b, contacts, weights, x)[0]).max() < SOLVED * np.abs(b).max():
            yield _set_of(G, bare, contacts, x / scale)


def _solved(A: np.ndarray, b: np.ndarray, contacts: list[Contact], weights: list[float], x: np.ndarray) -> np.ndarray:
    """Newton's method, shortened where it does not come nearer."""
    value, slope = _residual(A, b, contacts, weights, x)
    for _ in range(STEPS):
        step = np.linalg.lstsq(slope, -value, rcond=1e-11)[0]
        part = 1.0
        for _ in range(HALVINGS):
            after, slope_after = _residual(A, b, contacts, weights, x + part * step)
            if np.linalg.norm(after) < np.linalg.norm(value):
                break
            part *= 0.5
        x, value, slope = x + part * step, after, slope_after
        if np.abs(value).max() < 1e-3 * SOLVED * np.abs(b).max():
            break
    return x


def _residual(
    A: np.ndarray, b: np.ndarray, contacts: list[Contact], weights: list[float], x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far multipliers, each times the size of its row, are from a fixed point, and the derivative of that."""
    w, unit = A @ x - b, np.eye(len(b))
    value, slope = x.copy(), unit.copy()  # of what is off: no force
    for one, weight in zip(contacts, weights, strict=True):
        n, t = one.normal, one.along
        if x[n] - w[n] <= 0.0:
            continue
        value[n], slope[n] = w[n], A[n]
        most, d_most = one.mu * weight * x[n], one.mu * weight * unit[n]
        if one.slip is not None:
            way = one.slip / np.linalg.norm(one.slip)
            value[t] = x[t] + most * way
            slope[t] = unit[t] + np.outer(way, d_most)
            continue
        y, dy = x[t] - w[t], unit[t] - A[t]
        size = np.linalg.norm(y)
        if size <= most:
            value[t], slope[t] = w[t], A[t]
        else:
            way = y / size
            value[t] = x[t] - most * way
            slope[t] = unit[t] - np.outer(way, d_most)
            slope[t] -= most / size * (dy - np.outer(way, way @ dy))
    return value, slope


def _set_of(G: np.ndarray, bare: np.ndarray, contacts: list[Contact], lam: np.ndarray) -> Tried:
    """The set of modes of such multipliers, solved for anew."""
    modes, ways = list[str](), dict[int, np.ndarray]()
    for i, one in enumerate(contacts):
        heavy, near = G[one.normal, one.normal], SOLVED * np.abs(bare).max()
        force = np.linalg.norm(lam[one.along])
        if not lam[one.normal] * heavy > near:
            modes.append(OFF)
        elif one.slip is None and one.mu * lam[one.normal] - force > 1e-9 * force:
            modes.append(STICK)
        else:
            modes.append(SLIP)
            ways[i] = -lam[one.along] / force if one.slip is None else one.slip / np.linalg.norm(one.slip)
    return tried(G, bare, contacts, tuple(modes), ways)
