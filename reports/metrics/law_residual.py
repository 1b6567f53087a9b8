"""Multipliers against the case's law at the run's own states, over the largest.

The residual of the law (docs/explanation, contact law), recomputed by us from q and v:

    (H M^-1 H^T) lam = -(H M^-1 f + H'v + a1 h' + a0 h + a2 h^3)

on the rows that the run has closed, with b0 and b1 where they are in COLLISION; of rows that
depend on each other the part that exerts a force. Friction that slides is mu lam_n in size;
`friction_angle` has its direction, which a slip that vanishes turns at any tolerance. It tells
an engine that follows another law from one that follows this one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Inputs, Mode, Trajectory
from crossbody.cases.arrays import Floats
from crossbody.cases.contacts import CLOSED
from crossbody.reference import System
from crossbody.reports.measuring.equations import equations, finite, spread
from crossbody.reports.measuring.friction import directed, off_bound, rubbing, whole
from crossbody.reports.measuring.impulse import told
from crossbody.reports.measuring.scale import idle
from crossbody.reports.measuring.truth import Truth

UNIT = "1"
CLAIMED = False
NEEDS = "lam"
DEPENDENT = 1e-10
"""Eigenvalue of H M^-1 H^T, rows scaled to 1 there, over the largest: below it rows depend on each
other, as in the reference. What such rows carry together is unique, how they share it is not."""


def multipliers(
    system: System,
    case: Case,
    run: Trajectory,
    at: NDArray[np.intp],
    rows: NDArray[np.intp],
    slides: NDArray[np.intp],
    fast: NDArray[np.bool_],
    inputs: Inputs | None,
) -> tuple[Floats, Floats]:
    """Multipliers that the law asks for with some rows active, and what makes of any the part that exerts a force.

    Args:
        system: the equations.
        case: with the law.
        run: the motion, whose rows that slide carry what it says.
        at: samples of it (m,), in all of which the same rows are closed.
        rows: active ones (k,).
        slides: those that slide.
        fast: which of all rows are in COLLISION.
        inputs: those that act, if any.

    Returns:
        lam (m, k), and projections (m, k, k).
    """
    t, q, v = run.t[at], run.q[at], run.v[at]
    M, f, H, h, Hdv = system.equations_along(t, q, v, None if inputs is None else inputs.at(t))
    f += np.einsum("msn,ms->mn", H[:, slides], run.lam[np.ix_(at, slides)])
    H, h, Hdv = H[:, rows], h[:, rows], Hdv[:, rows]
    law = case.law
    a0, a1 = (np.where(fast, b, a)[rows] for a, b in ((law.a0, law.b0), (law.a1, law.b1)))
    a2 = np.where(fast, 0.0, law.a2)[rows]
    rate = np.einsum("mkn,mn->mk", H, v) - np.asarray(system.drift)[rows]
    inverse = np.linalg.solve(M, np.concatenate([f[..., None], H.swapaxes(1, 2)], axis=2))
    G = H @ inverse[..., 1:]
    size, first = _sizes(system, np.diagonal(G, axis1=1, axis2=2), rows)
    G = G / (size[:, :, None] * size[:, None, :])
    b = -(np.einsum("mkn,mn->mk", H, inverse[..., 0]) + Hdv + a1 * rate + a0 * h + a2 * h**3) / size
    whole = _inverse(G)
    found = _times(whole, b) if first.all() else _one_after_the_other(G, b, first)
    moving: Floats = (whole @ G) * size[:, None, :] / size[:, :, None]
    return found / size, moving


def _times(A: Floats, x: Floats) -> Floats:
    """Return the products (m, i) of matrices (m, i, j) and vectors (m, j)."""
    product: Floats = np.einsum("mij,mj->mi", A, x)
    return product


def _one_after_the_other(G: Floats, b: Floats, first: NDArray[np.bool_]) -> Floats:
    """Return x with G x = b on the first rows, and on the others as near as that leaves."""
    N, S = np.flatnonzero(first), np.flatnonzero(~first)
    at_N, at_S, between = G[:, N[:, None], N], G[:, S[:, None], S], G[:, N[:, None], S]
    turn = _inverse(at_N)
    held = between.swapaxes(1, 2) @ turn
    found = np.zeros(b.shape)
    found[:, S] = _times(_inverse(at_S - held @ between), b[:, S] - _times(held, b[:, N]))
    found[:, N] = _times(turn, b[:, N] - _times(between, found[:, S]))
    return found


def _sizes(system: System, own: Floats, rows: NDArray[np.intp]) -> tuple[Floats, NDArray[np.bool_]]:
    """Return what rows are measured by (m, k), and which are fulfilled first: all but those of friction that holds.

    Those of contacts of a body that rocks contradict each other, and are met by least squares in
    what the others leave, each by the size of its contact.
    """
    size, leader = np.sqrt(own), np.asarray(system.follows)[rows]
    first = np.array([i < 0 or not system.tangents[i] for i in leader], dtype=bool)
    place = {row: k for k, row in enumerate(rows.tolist())}
    for k in np.flatnonzero(~first):
        size[:, k] = np.maximum(size[:, k], size[:, place.get(int(leader[k]), int(k))])
    return np.where(size == 0.0, 1.0, size), first


def _inverse(G: Floats) -> Floats:
    """Return the inverses of symmetric matrices (m, k, k), each on the part of it that has one."""
    if not G.shape[1]:
        return G
    values, ways = np.linalg.eigh(G)
    kept = values > DEPENDENT * values[:, -1:]
    turned = np.divide(1.0, values, out=np.zeros(values.shape), where=kept)
    inverse: Floats = (ways * turned[:, None, :]) @ ways.swapaxes(1, 2)
    return inverse


def measure(truth: Truth, run: Trajectory, case: Case) -> float | None:
    """Max |lam - lam_law(q, v)| over max |lam_law| on at most 400 closed samples; NaN where lam is not known.

    Where all carry next to nothing it is over what `idle` rows are measured by.

    Where contacts slide the law of the other rows is asked for with the friction that the run
    has, and friction for its size. None where nothing closes, and where a
    controller or discrete variables act that a row of the run does not show.
    """
    system = equations(case)
    if system is None or (system.control is not None and run.inputs is None) or system.jumps:
        return None
    known = told(run)
    if known is None or not finite(run):
        return math.nan
    closed = known & (np.isin(run.mode, CLOSED) if (run.mode >= 0).all() else run.lam > 0.0)
    looked = np.asarray(closed.any(axis=1))
    inputs = case.inputs if run.inputs is None else run.inputs
    if system.activations is not None and inputs is not None:
        inputs = system.activations.extended(inputs)
    if inputs is not None:  # where they jump, a sample does not say on which side it stands
        looked &= ~np.isin(run.t, inputs.times)
    looked &= ~np.isin(run.t, [switch.t for switch in run.switches])  # nor where the curvature of a gap jumps
    worst, scale = off_bound(run, case), 0.0
    slides = (run.mode == Mode.SLIP) & (np.asarray(system.follows) >= 0)
    chosen = spread(run, looked)
    if (rubs := rubbing(run, case)) is not None:
        chosen = chosen[directed(run, rubs)[chosen]]
    patterns, which = np.unique(
        np.stack([closed & ~slides, slides, run.mode == Mode.COLLISION], axis=1)[chosen], axis=0, return_inverse=True
    )
    for k, (active, sliding, fast) in enumerate(patterns):
        at, rows = chosen[which.ravel() == k], np.flatnonzero(active)
        if not len(rows):  # dry friction that slides, which has no law but its bound
            scale = max(scale, float(np.max(np.asarray(system.friction)[sliding & system.dry], initial=0.0)))
            continue
        lam, moving = multipliers(system, case, run, at, rows, np.flatnonzero(sliding), fast, inputs)
        sizes = np.zeros((2, len(at), run.lam.shape[1]))
        sizes[..., rows] = _times(moving, run.lam[np.ix_(at, rows)] - lam), _times(moving, lam)
        off, most = (float(np.max(whole(one, case))) for one in sizes)
        worst, scale = max(worst, off), max(scale, most)
    return worst / max(scale, idle(truth.trajectory)) if scale else None
