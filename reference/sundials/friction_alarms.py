"""What is watched along an arc with friction: guards of every contact by its mode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from crossbody.cases import Mode
from crossbody.reference.kinds import Floats
from crossbody.reference.sundials.balance import Balance
from crossbody.reference.sundials.mode_problem import JAMMED

if TYPE_CHECKING:
    from crossbody.reference.sundials.friction_machine import FrictionMachine

TERMS = {"TOUCH": 2, "CATCH": 2, "STOP": 2}  # of a guard; one of all others


@dataclass(frozen=True, slots=True)
class Alarm:
    """A guard: a contact, what it tells (`RELEASE`, ...), and where its terms stand."""

    row: int
    tells: str
    terms: slice
    armed: bool = True


def alarms(machine: FrictionMachine, guards: int) -> list[Alarm]:
    """List what may fire until the next event, in the order of `values`; `guards` are those of the mechanism."""
    told = list[tuple[int, str, bool]]()
    for i in machine.rows:
        told += [(i, tells, i not in machine.flush) for tells in _told(machine.modes[i], i in machine.sliding.dry)]
    if len(pressing := machine.contacts()) > 1:
        told.append((pressing[0], "PART", True))
    told += [(k, "WATCH", False) for k in range(guards)]
    found, count = list[Alarm](), 0
    for i, tells, armed in told:
        terms = TERMS.get(tells, 1)
        found.append(Alarm(i, tells, slice(count, count + terms), armed))
        count += terms
    return found


def _told(mode: Mode, dry: bool) -> list[str]:
    """What contacts tell by their modes."""
    if mode == Mode.FREE:
        return ["TOUCH"]
    if mode == Mode.BALLISTIC:
        return ["LEAVE", "CATCH"]
    along = {Mode.STICK: ["CONE", "AWAY"], Mode.SLIP: ["STOP", "JAM"]}.get(mode, [])
    return along[:1] if dry else ["RELEASE", *along]


def values(machine: FrictionMachine, times: list[float], q: Floats, v: Floats) -> Floats:
    """All terms (b, k) of the machine's alarms at b instants, positions (b, nq) and velocities (b, n)."""
    states, count = list(zip(times, q, v, strict=True)), sum(alarm.tells == "WATCH" for alarm in machine.alarms)
    gap, rate = np.array([[a.copy() for a in machine.equations.gaps(*state)] for state in states]).swapaxes(0, 1)
    opened = {alarm.row for alarm in machine.alarms if alarm.tells == "CATCH"}
    seen = machine.sliding.see_all(times, q, v, sorted({*machine.contacts(), *opened}))
    balance, found = machine.balance(seen), list[Floats]()
    lam = balance.forces()
    bare = balance.forces(pulled=False) if any(alarm.tells == "CONE" for alarm in machine.alarms) else lam
    for alarm in machine.alarms:
        i, tells = alarm.row, alarm.tells
        if tells == "TOUCH":
            found += [gap[:, i], rate[:, i]]
        elif tells == "LEAVE":
            found.append(-gap[:, i])
        elif tells == "CATCH":
            found += [rate[:, i], machine.above_law(seen, balance, lam, i)]
        elif tells == "PART":  # rows that depend on each other have come to contradict each other
            found.append(1.0 - balance.contradiction(lam))
        elif tells != "WATCH":
            found += _along(machine, balance, alarm, lam, bare)
    watched = np.zeros((len(times), count))
    for state, row in zip(states, watched if machine.watch is not None and count else (), strict=False):
        machine.watch(*state, machine.equations.p, row)
    return np.column_stack([*found, watched])


def _along(machine: FrictionMachine, balance: Balance, alarm: Alarm, lam: Floats, bare: Floats) -> list[Floats]:
    """Terms (b,) of an alarm of a contact that presses, by its multipliers with and without what pulls it back."""
    i, tells, at, sliding = alarm.row, alarm.tells, balance.seen.at, machine.sliding
    if tells == "RELEASE":
        return [lam[:, at[i]]]
    if tells == "CONE":
        most = sliding.mu[i] * (1.0 if i in sliding.dry else bare[:, at[i]])
        return [most - np.linalg.norm(bare[:, [at[w] for w in sliding.ways[i]]], axis=1)]
    if tells == "JAM":
        return [np.prod(balance.jam(i), axis=-1).real - 0.5 * JAMMED]
    slip = sliding.slip(balance.seen, i)
    size = np.linalg.norm(slip, axis=1)
    if tells == "AWAY":
        return [machine.still - size]
    near = size - machine.still if slip.shape[1] > 1 else np.full(len(size), -1.0)
    return [slip @ machine.ways[i] + machine.leave(i), near]
