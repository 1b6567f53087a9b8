"""Driving the compiled loop: slices, growing buffers, bounds, and the result as a Trajectory."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Event, Ledger, Mode, Outcome, Switch, Trajectory
from crossbody.cases.control import Control, NotFinite
from crossbody.reference import _dense
from crossbody.reference._activations import Live
from crossbody.reference._blame import KEEP_OUT, STUCK, buried, dependence, not_finite, undirected, vanished, whirling
from crossbody.reference._dense import Marks, Motion
from crossbody.reference._elapsed import Elapsed
from crossbody.reference._interrupt import LONG_S, Interrupts
from crossbody.reference._program import entry, friction_code, instant_code
from crossbody.reference._redundant import watched
from crossbody.reference._system import System, initial_modes
from crossbody.reference.ahead import ask
from crossbody.reference.core import layout
from crossbody.reference.core.bundles import table
from crossbody.reference.kinds import Floats, Index
from crossbody.reference.notes import AMOUNTS, NOTES, noted
from crossbody.reference.options import COLLISIONS, FSMS, Options
from crossbody.reference.systems import absent

SLICE, SLICE_S = 200, 0.05  # first steps between two looks at the clock, and the time aimed at, s
ROWS, EVENTS, HISTORY = 256, 256, 64
RESOLUTION = 64.0 * float(np.finfo(np.float64).eps)  # part of the whole time by which instants differ
OUTCOMES = {
    layout.DONE: Outcome.FINISHED,
    layout.MORE: Outcome.STEP_LIMIT,
    layout.STEP_TOO_SMALL: Outcome.STEP_TOO_SMALL,
    layout.NOT_FINITE: Outcome.NOT_FINITE,
    layout.ILL_POSED: Outcome.ILL_POSED,
    layout.MODE_CYCLE: Outcome.MODE_CYCLE,
    layout.DIVERGED: Outcome.DIVERGED,
    layout.LOST: Outcome.LOST,
    layout.INCONSISTENT: Outcome.INCONSISTENT,
    layout.PAINLEVE: Outcome.PAINLEVE,
    layout.NO_CONSISTENT_MODES: Outcome.NO_CONSISTENT_MODES,
}
_ACTIVE = (layout.CONTACT, layout.COLLISION, layout.BILATERAL, layout.STICK, layout.SLIP)
_COUNTERS = ("rejected", "rhs", "implicit_steps", "exact_steps", "factorisations", "collisions", "guards")
_EVENT_BUFFERS = ("events_t", "events", "impulses", "switches_t", "switches")


def start_row(system: System, q0: Floats, v0: Floats) -> Floats:
    """The start as a row of a motion: t, q, v, gap, lam (NaN: none is known), energy (2,)."""
    energy = np.zeros(2)
    system.energy(q0, v0, np.array(system.p), energy)
    return np.concatenate([[0.0], q0, v0, system.gap(q0, v0)[0], np.full(system.nc, np.nan), energy])


class CompiledRun:
    """One prepared run of the compiled loop; `start` and `go` may be repeated, with the same result.

    Args:
        system: the mechanism.
        q0, v0 (n,): start.
        options: what is asked.
    """

    def __init__(self, system: System, q0: Floats, v0: Floats, options: Options) -> None:
        self.system, self.options = system, options
        if system.frictional:  # this and modes first: another process may still be compiling the loop
            ask("modes")
            friction_code()
        instant_code()
        self.call = entry(tuple(system.kernels.values()))
        self.start_state = np.concatenate([q0, v0])
        samples, (inputs_t, inputs_u) = options.grid(), options.schedule(system)
        n, nq, nc = system.n, system.nq, system.nc
        self.nz = nc + 2 if options.ledger or system.frictional else 0  # what touches with friction gain is told
        self.work = layout.workspace(
            n, nq, system.velocity is not None, nc, system.inputs,
            system.mass_block, self.nz, system.memory, system.scratch, system.guards,
            len(np.atleast_1d(system.discrete)), system.frictional,
        )  # fmt: skip
        self.work["atol"][:] = options.absolute(system)
        natural = options.samples is None
        rows, events = (ROWS + len(inputs_t) if natural else len(samples) + 1), EVENTS + 16 * nc  # steps end at inputs
        self.buffers: dict[str, NDArray[Any]] = {
            "inputs_t": np.array(inputs_t), "inputs_u": np.array(inputs_u), "samples": np.array(samples),
            "mode": np.zeros(nc, np.int8), "history": np.zeros((max(HISTORY, 4 * nc) + 1, nc), np.int8),
            "out": np.zeros((rows, 1 + nq + n + 2 * nc + 2 + self.nz)), "modes": np.zeros((rows, nc), np.int8),
            "events_t": np.zeros(events), "events": np.zeros((events, 3), np.int64),
            "impulses": np.zeros(events), "switches_t": np.zeros(EVENTS), "switches": np.zeros((EVENTS, 3), np.int64),
        }  # fmt: skip
        self.model = [np.array(getattr(system, name)) for name in layout.Model.__annotations__]
        self.tables = [table(self.model), table([*self.work.values()]), table([*self.buffers.values()])]
        self.template = self._state_template(natural)
        self.state = self.template.copy()
        self._bytes, self._blank = (array.view(np.uint8) for array in (self.state, self.template))
        self._modes = initial_modes(system, q0, v0)
        self.callback: Any = None
        self.marks: Marks | None = None

    def _state_template(self, natural: bool) -> Any:
        system, options = self.system, self.options
        state = np.zeros(1, layout.STATE)
        values = {
            "n": system.n, "nq": system.nq, "has_velocity": system.velocity is not None,
            "nc": system.nc, "nu": system.inputs, "k": system.mass_block, "nz": self.nz,
            "fsm": FSMS.index(options.fsm), "rule": COLLISIONS.index(options.collisions),
            "frozen": options.freezes(system), "has_switch": system.switch is not None,
            "ng": system.guards, "nd": np.size(system.discrete), "latched": system.latched,
            "kinks": system.kinks,
            "has_solve": system.solve is not None, "constant_mass": system.constant_mass,
            "affine": system.affine and options.shortcuts and not system.frictional,
            "implicit": options.implicit, "natural": natural,
            "ledger": self.nz > 0, "audited": self.nz > 0 and _books_everything(system),
            "judged": options.ledger,
            "frictional": system.frictional, "dry": np.count_nonzero(system.dry),
            "friction_code": friction_code() if system.frictional else 0,
            "instant_code": instant_code(),
            "loops": system.solve is None and bool(np.any(system.held)),
            "keep_events": options.events, "has_energy": system.energy is not absent.energy,
            "has_control": system.control is not None,
            "most_sets": options.most_sets,
            "rtol": options.rtol, "atol": options.tolerance, "t_end": options.t_end, "h_max": options.max_step,
            "tick": system.tick,
        }  # fmt: skip
        for name, value in values.items():
            state[name] = value
        return state

    def start(self) -> None:
        """Back to the beginning."""
        self._bytes[:] = self._blank  # a record is copied field by field, which costs more than a short run
        self.buffers["mode"][:] = self._modes
        self.model[0][:] = self.system.p
        for name in ("u", "s", "z"):
            self.work[name][:] = 0.0
        self.work["y"][:] = self.start_state
        if self.callback is not None:
            self.work["s"][0] = self.callback.address

    def slice(self, budget: int) -> int:
        """Advance by at most `budget` steps; the loop's return code."""
        return int(self.call(self.state, *self.tables, budget))

    def warm(self) -> None:
        """Prepare for many repetitions: take one step."""
        if not isinstance(self.system.control, Control):  # a controller is asked by runs alone
            self.start()
            self.slice(1)

    def go(self, progress: Callable[[float], None] | None = None) -> tuple[Outcome, float]:
        """Run to the end; how it ended, and the wall time in s."""
        self._begin_control()
        self.marks = Marks(self, _dense.ROOM) if self.options.dense else None
        began = time.perf_counter()
        self.start()
        outcome = self._slices(progress)
        took = time.perf_counter() - began
        failure = None if self.callback is None else self.callback.failure
        if failure is None:
            return outcome, took
        if isinstance(failure, (NotFinite, KeyboardInterrupt)):
            return Outcome.NOT_FINITE if isinstance(failure, NotFinite) else Outcome.INTERRUPTED, took
        raise failure

    def _begin_control(self) -> None:
        """Make this run's own copy of a controller in Python."""
        system, state = self.system, self.state
        if not isinstance(system.control, Control):
            return
        from crossbody.reference._callback import Callback

        def end(t: float) -> None:
            state["t_end"] = t

        live = Live(system.activations) if system.activations is not None else None
        self.callback = Callback(system.control.begin(system.inputs), system.nq, system.n, end, live)

    def _slices(self, progress: Callable[[float], None] | None) -> Outcome:
        try:
            with Interrupts() as interrupts:
                return self._advance(progress, interrupts)
        except KeyboardInterrupt:
            return Outcome.INTERRUPTED

    def _advance(self, progress: Callable[[float], None] | None, interrupts: Interrupts) -> Outcome:
        limit, budget, elapsed = self.options.max_steps, SLICE, Elapsed()
        while True:
            steps, before = int(self.state["steps"][0]), time.perf_counter()
            if steps >= limit:
                return Outcome.STEP_LIMIT
            some = budget if self.marks is None else min(budget, self.marks.put())
            code = self.slice(min(some, limit - steps))
            if code == layout.DONE:
                return Outcome.FINISHED
            if code < 0:
                return self._ended(code)
            if code == layout.MORE and self._whirling():
                return Outcome.ILL_POSED
            self._grow(code)
            interrupts.answer()
            now = time.perf_counter()
            if elapsed.exceeds(self.options.time_limit):
                return Outcome.TIME_LIMIT
            if now - before > LONG_S and self.callback is None:  # a controller in Python may hang
                interrupts.hold()
            if code == layout.MORE and self.marks is None:
                budget = max(1, int(budget * min(4.0, SLICE_S / (now - before))))
            if progress is not None:
                progress(float(self.state["t"][0]) / self.options.t_end)

    def _ended(self, code: int) -> Outcome:
        """The outcome of a code; an account or a pivot that a kernel spoilt by NaN is neither open nor vanished.

        Where steps fell to nothing because nothing moves a row any more, the equations are ill
        posed, not stiff.
        """
        spoilt = code == layout.INCONSISTENT and not np.isfinite(self.state["energy_open"][0])
        if code == layout.ILL_POSED:
            step = float(self.state["h"][0]) + RESOLUTION * float(self.options.t_end)
            q, v = np.split(self.work["y"], [self.system.nq])
            spoilt = self._blamed(q, v, step) != ""
        if code == layout.STEP_TOO_SMALL and (self._vanished() or self._whirling()):
            return Outcome.ILL_POSED
        return Outcome.NOT_FINITE if spoilt else OUTCOMES[code]

    def _active(self) -> Index:
        """Rows that bear now."""
        return np.flatnonzero(np.isin(self.buffers["mode"], _ACTIVE))

    def _vanished(self) -> list[int]:
        q, v = np.split(self.work["y"], [self.system.nq])
        return vanished(self.system, self._active(), self.start_state[: self.system.nq], q, v)

    def _whirling(self) -> list[int]:
        q, v = np.split(self.work["y"], [self.system.nq])
        v0, t = self.start_state[self.system.nq :], float(self.state["t"][0])
        return whirling(self.system, self._active(), v0, q, v, t) if np.isfinite(self.work["y"]).all() else []

    def _finite_rows(self) -> int:
        """Rows before the first one that holds NaN or infinity: energies and powers steer no step, but are told."""
        rows = self.buffers["out"][: int(self.state["rows"][0])]
        known = np.ones(rows.shape[1], dtype=bool)
        if self.system.energy is absent.energy:
            start = 1 + self.system.nq + self.system.n + 2 * self.system.nc
            known[start : start + 2] = False
        good = np.isfinite(rows[:, known]).all(axis=1)
        return len(rows) if good.all() else int(np.argmin(good))

    def _grow(self, code: int) -> None:
        """Double the buffers that are full."""
        full = {layout.ROWS_FULL: ("out", "modes"), layout.EVENTS_FULL: _EVENT_BUFFERS}.get(code, ())
        for name in full:
            self.buffers[name] = np.concatenate([self.buffers[name], np.zeros_like(self.buffers[name])])
        if full:
            self.tables[2] = table([*self.buffers.values()])

    def trajectory(self, outcome: Outcome, wall_s: float) -> Trajectory:
        """What was recorded, as a Trajectory."""
        n, nq, nc = self.system.n, self.system.nq, self.system.nc
        state = self.state[0]
        broken = outcome is Outcome.NOT_FINITE
        rows = self.buffers["out"][: self._finite_rows() if broken else int(state["rows"])]
        if not len(rows):  # it ended before its first row, or none was asked for: the start is known at least
            rows = np.concatenate([start_row(self.system, *np.split(self.start_state, [nq])), np.zeros(self.nz)])[None]
            self.buffers["modes"][0] = self._modes
        cuts = np.cumsum([1, nq, n, nc, nc, 2])
        t, q, v, gap, lam, energy, ledger = np.split(rows, cuts, axis=1)
        run = Trajectory(
            t=t[:, 0], q=self.system.normalised("run", q), v=v,
            gap=gap, lam=lam, energy=energy, mode=self.buffers["modes"][: len(rows)],
            events=self._event_list(), switches=self._switch_list(), outcome=outcome, message=self._message(outcome),
            steps=int(state["steps"]), wall_s=wall_s,
            counts=MappingProxyType(
                {name: int(state[name]) for name in _COUNTERS}
                | {"events": int(state["events"] + state["dropped"])}
                | {name: int(state[name]) for name in ("redundant", "not_searched", *NOTES) if state[name]}
            ),
            ledger=Ledger(contact=ledger[:, :nc], input=ledger[:, nc], dissipated=ledger[:, nc + 1])
            if self.options.ledger
            else None,
            determined_until=float(state["determined_until"]) if state["indeterminate"] else np.inf,
            undetermined_by=float(state["open_way"]) if state["indeterminate"] and not state["loops_press"] else 0.0,
            unique_until=float(state["unique_until"]) if state["not_unique"] or state["unmet"] else np.inf,
            energy_gained=float(state["energy_gained"]),
            energy_handed=float(state["energy_handed"]),
            searched_until=float(state["searched_until"]) if state["not_searched"] else np.inf,
        )  # fmt: skip
        if self.callback is not None:
            controller = self.callback.controller
            given = controller.given(self.buffers["inputs_t"], self.buffers["inputs_u"])
            run = replace(run, inputs=given, control_s=controller.seconds)
        if self.marks is not None:
            self.marks.put()
            q0, v0 = np.split(self.start_state, [nq])
            player = CompiledRun(self.system, q0, v0, self.options)
            run = replace(run, sol=Motion(self.marks, player, self.start_state))
        return watched(self.system, run)

    def _event_list(self) -> tuple[Event, ...]:
        """Return the transitions; what was tried at an instant at which it sticks as before is none."""
        count = int(self.state["events"][0]) if self.options.events else 0
        times, rows, impulses = (self.buffers[name][:count].tolist() for name in _EVENT_BUFFERS[:3])
        return tuple(
            Event(t=t, contact=i, before=Mode(before), after=Mode(after), impulse=impulse)
            for t, (i, before, after), impulse in zip(times, rows, impulses, strict=True)
            if not before == after == Mode.STICK
        )

    def _switch_list(self) -> tuple[Switch, ...]:
        count = int(self.state["switches"][0]) if self.options.events else 0
        times, changes = (self.buffers[name][:count].tolist() for name in _EVENT_BUFFERS[3:])
        jumping = np.size(self.system.discrete) - self.system.kinks
        return tuple(
            Switch(t=t, variable=i, before=before, after=after, smooth=i >= jumping)
            for t, (i, before, after) in zip(times, changes, strict=True)
        )

    def _message(self, outcome: Outcome) -> str:
        if outcome is Outcome.FINISHED:
            state = {name: self.state[name][0] for name in (*NOTES, *AMOUNTS)}
            return noted(state, bool(self.state["loops_press"][0]))
        q, v = np.split(self.work["y"], [self.system.nq])
        where = f"t = {float(self.state['t'][0]):.12g} s, q = {q.tolist()}, v = {v.tolist()}"
        if outcome in STUCK and (deep := buried(self.system, self._active(), q, v)):
            return f"At {where}, {deep}. {KEEP_OUT}"
        return f"{self._cause(outcome, q, v)}{where}. {outcome.advice}"

    def _cause(self, outcome: Outcome, q: Floats, v: Floats) -> str:
        """What an outcome's message names before time and state; empty if nothing."""
        state, marked = self.state[0], np.flatnonzero(self.buffers["history"][-1]).tolist()
        if self.callback is not None and isinstance(self.callback.failure, NotFinite):
            return f"{self.callback.failure} "
        if outcome is Outcome.NOT_FINITE:
            return self._blamed(q, v)
        if outcome in (Outcome.MODE_CYCLE, Outcome.PAINLEVE, Outcome.NO_CONSISTENT_MODES):
            return f"Rows {marked} at "
        if outcome is Outcome.ILL_POSED:
            if rows := self._whirling():
                return undirected(rows)
            active = self._vanished() or self._active()
            return dependence(self.system, np.array(active), q, v)
        if outcome is Outcome.INCONSISTENT and abs(state["energy_open"]) > state["energy_allowed"]:
            why = (
                "energy, power and dynamics contradict each other"
                if abs(state["energy_open"]) > state["energy_added"]
                else "there was far more energy before, so the remaining energy is not known accurately"
            )
            return (
                f"The energy account is open by {state['energy_open']:.3g} J, where {state['energy_allowed']:.3g} J "
                f"are admitted: {why}, at "
            )
        if outcome is Outcome.INCONSISTENT:
            return f"The accelerations do not follow the law of rows {marked}, as `rows` has them, after "
        return ""

    def _blamed(self, q: Floats, v: Floats, within: float = np.inf) -> str:
        """The kernel that gave what is not finite, at the first bad row or else `within` s of the motion's end."""
        nq, state, t = self.system.nq, self.state[0], float(self.state["t"][0])
        row, end = self._finite_rows(), 1 + nq + self.system.n
        if row < state["rows"] and np.all(np.isfinite(self.buffers["out"][row, :end])):
            t, (q, v) = self.buffers["out"][row, 0], np.split(self.buffers["out"][row, 1:end], [nq])
        ahead = min(max(float(self.options.t_end) - t, 0.0), within)
        return not_finite(self.system, t, np.concatenate([q, v]), self.work["u"], self.model[0], self._active(), ahead)


def _books_everything(system: System) -> bool:
    """Whether the system says what its energy is and what changes it; one that nothing drives need not name a power."""
    driven = system.inputs > 0 or system.jumps
    return system.energy is not absent.energy and (system.power is not absent.power or not driven)
