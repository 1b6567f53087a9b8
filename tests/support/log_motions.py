"""Motions of the scale of real rigs, sampled, with noise or on the grid of an encoder: what a clean log holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
KINDS = ("sines", "moves", "swing", "spin", "bounces", "rest", "constant")


@dataclass(frozen=True)
class Motion:
    """One coordinate, sampled.

    Attributes:
        t, q, v: time, s, coordinate, rad or m, and its rate.
        step: sample time, s.
        grid: of the encoder; 0 for numbers with noise.
        noise: standard deviation.
        kind: what it is.
    """

    t: Floats
    q: Floats
    v: Floats
    step: float
    grid: float
    noise: float
    kind: str


def draw(seed: int, kind: str, rows: int = 4000) -> Motion:
    """A random motion of a kind, between 0.2 and 5 kHz, resolved by at least 40 samples a period."""
    random = np.random.default_rng(seed)
    step = float(np.exp(random.uniform(np.log(2e-4), np.log(5e-3))))
    t = np.arange(rows) * step
    q, v = _smooth(kind, random, t, step)
    grid, noise = 0.0, 0.0
    match random.integers(3):
        case 0:
            grid = 2.0 * np.pi / 2.0 ** random.integers(12, 21)
            q = grid * np.rint(q / grid)
        case 1:
            noise = float(np.exp(random.uniform(np.log(1e-6), np.log(1e-3))))
            q = q + noise * random.standard_normal(rows)
    return Motion(t, q, v, step, grid, noise, kind)


def _smooth(kind: str, random: np.random.Generator, t: Floats, step: float) -> tuple[Floats, Floats]:
    fastest = 2.0 * np.pi / (40.0 * step)
    match kind:
        case "sines":
            rates = np.exp(random.uniform(np.log(2.0 / t[-1]), np.log(fastest), 4))
            sizes, phases = random.uniform(0.02, 1.0, 4) / (rates / rates.min()), random.uniform(0.0, 6.3, 4)
            q = sum(a * np.sin(w * t + p) for a, w, p in zip(sizes, rates, phases, strict=True))
            v = sum(a * w * np.cos(w * t + p) for a, w, p in zip(sizes, rates, phases, strict=True))
        case "moves":
            return _moves(random, t)
        case "swing":  # a decaying swing, which turns ever closer to rest
            w, d = np.exp(random.uniform(np.log(20.0 / t[-1]), np.log(fastest))), random.uniform(0.5, 8.0) / t[-1]
            a = random.uniform(0.1, 2.0)
            q, v = a * np.exp(-d * t) * np.cos(w * t), -a * np.exp(-d * t) * (d * np.cos(w * t) + w * np.sin(w * t))
        case "spin":  # many turns, not wrapped
            w = random.uniform(0.2, 0.6 * np.pi) / step / 4.0
            q, v = w * t + 0.3 * np.sin(w * t / 7.0), w + 0.3 * w / 7.0 * np.cos(w * t / 7.0)
        case "bounces":
            return _bounces(random, t)
        case "rest":
            q, v = np.full(len(t), random.uniform(-1.0, 1.0)), np.zeros(len(t))
        case _:
            q, v = np.full(len(t), random.choice([0.0, 1.0, -0.7])), np.zeros(len(t))
    return np.asarray(q), np.asarray(v)


def _moves(random: np.random.Generator, t: Floats) -> tuple[Floats, Floats]:
    """Moves of least jerk with rests between them, as of a pick-and-place robot."""
    q, v, at, here = np.zeros(len(t)), np.zeros(len(t)), 0, float(random.uniform(-1.0, 1.0))
    while at < len(t):
        rest, move = random.integers(5, 600), random.integers(60, 600)
        there = float(random.uniform(-1.5, 1.5))
        q[at : at + rest] = here
        s = (np.arange(move) + 1.0)[: max(len(t) - at - rest, 0)] / move
        span = slice(at + rest, at + rest + len(s))
        q[span] = here + (there - here) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        v[span] = (there - here) * (30 * s**2 - 60 * s**3 + 30 * s**4) / (move * (t[1] - t[0]))
        at, here = at + rest + move, there
    return q, v


def _bounces(random: np.random.Generator, t: Floats) -> tuple[Floats, Floats]:
    """A ball that bounces for some while and then lies."""
    gravity = 9.81 * (random.uniform(0.5, 1.0) * 4000.0 * 2.5e-4 / (t[-1])) ** 2
    bounce, h, speed, restitution = 0.0, random.uniform(0.2, 1.0), 0.0, random.uniform(0.6, 0.9)
    q, v = np.zeros(len(t)), np.zeros(len(t))
    for i, now in enumerate(t):
        while (s := now - bounce) > (end := (speed + np.sqrt(speed**2 + 2.0 * gravity * h)) / gravity):
            if speed + gravity * end < 40.0 * gravity * (t[1] - t[0]):
                return q, v  # too fast to be resolved: it lies
            bounce, h, speed = bounce + end, 0.0, restitution * (gravity * end - speed)
        q[i], v[i] = h + speed * s - 0.5 * gravity * s * s, speed - gravity * s
    return q, v
