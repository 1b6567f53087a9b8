"""An engine's error in parts: of its importer, of its model, of its step.

Errors are vectors (samples, components), relative as in the metric `position`, on the truth's
clock: events are laid on each other, so that behind an event that moved states are compared at
equal time since it. At every sample

    whole = importer + model + step

    importer    the engine's reader against the same engine and step on the model that is built from the scene
    model       the engine's converged motion against the truth
    step        the engine at its step against its own converged motion

The converged motion is the truth of the equations that the engine follows, where those are known;
else it follows from three steps or more, each half of the one before, by the order that they
show. Without one nothing is extrapolated: it is the finest run, known to what further differences
sum to at most where those of the finest runs fall, else it is not known. Of an engine with a
tolerance instead of a step it is the run at the tightest. What a part is known to stands beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crossbody.cases import Case, Trajectory
from crossbody.cases.arrays import Floats, distinct
from crossbody.cases.rotations import turned
from crossbody.reports.measuring.alignment import clock, matched, which_laid
from crossbody.reports.measuring.apart import LOOKS, far_apart, rate_of_error
from crossbody.reports.measuring.scale import scale_of
from crossbody.reports.measuring.truth import Truth, taken

PARTS = ("importer", "model", "step")
LARGEST = "largest"
"""Before the name of a part: its largest anywhere, which may have a limit; without, its share of the worst error."""
SPLIT = ("position", "event_times")  # metrics whose error is split
RATIO = 2.0  # of one step of a study to the next
FLAT = 1e-10  # differences of runs below it, relative, are rounding that has added up: they show no order
LEAST_RATIO, FALLEN = 2.0**0.5, (3, 5)
"""Of the differences of neighbouring steps: with less, half an order, nothing can be predicted; and how many of the
finest tell how they fall where they show no order, at least and at most."""
SETTLED = 0.05  # part of the largest error to which finer steps must not change it
UNLIKE = 0.3  # part of the differences that may be other than a power of the step (root of the mean square)
ROUNDING = 1e-12  # what runs of two models that are the same to rounding may differ by, relative or s
SAMPLES = 2000  # samples at which runs are compared
REACHED = 1e-9  # part of the horizon by which the last sample of a run may miss it


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Runs of one engine that tell the parts of its error.

    Attributes:
        setting: what differs between them: "dt" or "rtol".
        sizes: of it, falling: three steps or more in the ratio 2, or two tolerances, the last of
            which is the tightest.
        runs: one for each.
        built: the engine at its own settings on the model that is built from the scene; None
            without its own reader.
        why: why there are no runs, in a sentence.
        why_built: why there is no such run although the engine has a reader of its own.
    """

    setting: str = ""
    sizes: tuple[float, ...] = ()
    runs: tuple[Trajectory, ...] = ()
    built: Trajectory | None = None
    why: str = ""
    why_built: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """The parts of one metric's error.

    Attributes:
        where: component and instant at which the whole error is largest, in words.
        there: part -> its share of the whole error there, along that; they add up to it.
        largest: part -> its largest anywhere.
        known: part -> what both are known to.
        says: how the converged motion is known.
        missing: part -> why it is not known.
        shorter: whether it is of less than all that is judged.
    """

    where: str
    there: Mapping[str, float]
    largest: Mapping[str, float]
    known: Mapping[str, float]
    says: str
    missing: Mapping[str, str]
    shorter: bool = False


def part_of(metric: str, part: str) -> str:
    """Name of the row that says how much of the worst error of a metric a part is."""
    return f"{metric} ({part})"


class NotMeasuredError(Exception):
    """A part of an error that is not known, with the sentence that says why."""


def splits(case: Case, truth: Truth, run: Trajectory, study: Study, own: Truth | None = None) -> dict[str, Split]:
    """Tell the parts of the errors of an engine: metric -> its parts, without those where there is nothing to compare.

    Args:
        case: what was run.
        truth: what the whole error is measured against.
        run: the engine as it was judged.
        study: its other runs.
        own: the truth of the equations that the engine follows, where they are not the case's.
    """
    positions = Positions(case, truth, truth.compared(run), math.inf if own is None else own.trusted)
    positions.expect([*study.runs, *filter(None, (study.built,))])
    laid: dict[str, Positions | Events] = {"position": positions, "event_times": Events(case, truth, run)}
    told = {metric: _split(one, metric, positions, study, own) for metric, one in laid.items() if one.whole.size}
    return told if positions.whole.size else {}


def _split(laid: Positions | Events, metric: str, positions: Positions, study: Study, own: Truth | None) -> Split:
    here, says = laid.whole, ""
    errors: dict[str, Floats] = {}
    known: dict[str, float] = {}
    missing = {"importer": study.why_built} if study.why_built else {}
    try:
        if study.built is not None:
            here = laid(study.built)
            errors["importer"], known["importer"] = laid.whole - here, ROUNDING
        errors["step"], known["step"], says = _step(laid, positions, here, study, own)
    except NotMeasuredError as why:
        missing |= dict.fromkeys(PARTS[1:], str(why))
    else:
        errors["model"] = here - errors["step"]
        known["model"] = max(known["step"], laid.truth.agreement.get(metric, 0.0))
    where, along = laid.worst()
    return Split(
        where=where, there={part: along(error) for part, error in errors.items()},
        largest={part: float(np.max(laid.sizes(error))) for part, error in errors.items()},
        known=known, says=says, missing=missing, shorter=positions.shorter,
    )  # fmt: skip


def _step(
    laid: Positions | Events, positions: Positions, here: Floats, study: Study, own: Truth | None
) -> tuple[Floats, float, str]:
    """Return the step's error, what it is known to, and how its converged motion is.

    Raises:
        NotMeasuredError: where it is not known.
    """
    if own is not None:
        return laid.against(own), max(own.agreement.values(), default=0.0), own.source
    if not study.runs:
        raise NotMeasuredError(study.why)
    errors = [laid(run) for run in study.runs]
    if study.setting != "dt":
        looser, tight = errors
        text = f"Converged at {study.setting} = {study.sizes[-1]:g}."
        return here - tight, _most(looser - tight), text
    try:
        ratio, seen = observed([positions(run) for run in study.runs], study.sizes)
    except NotMeasuredError as why:
        if math.isnan(rest := remaining(errors)):
            raise
        falling = f"but on the whole they fall: if they go on to, they sum to {rest:.1e} at most."
        return here - errors[-1], rest, f"{str(why).removesuffix('.')}; {falling}"
    limit, known = extrapolated(errors[-3:], ratio)
    if math.isinf(ratio):
        return here - limit, known, f"Runs at steps of {_listed(study.sizes)} s differ only by rounding."
    order = f"Order {math.log(ratio) / math.log(RATIO):.2f}, observed between steps of {_listed(seen)} s"
    return here - limit, known, f"{order}; the limit is known to {known:.1e}."


def observed(errors: Sequence[Floats], sizes: Sequence[float]) -> tuple[float, Sequence[float]]:
    """Return by how much differences fall from one pair of runs to the next, and the three steps that tell it.

    It is the factor that makes both fields of differences most alike, of the finest three runs
    that differ by more than rounding; infinite where none do.

    Args:
        errors: of three runs or more (samples, components), the coarsest first.
        sizes: their steps, which fall by `RATIO`.

    Raises:
        NotMeasuredError: where the fields are not alike, or the factor is too small: there is no order.
    """
    for k in range(len(errors) - 3, -1, -1):
        first, second = errors[k] - errors[k + 1], errors[k + 1] - errors[k + 2]
        if max(_most(first), _most(second)) > FLAT:
            break
    else:
        return math.inf, sizes
    tiny = np.finfo(float).tiny
    ratio = float(np.sum(first * second) / max(float(np.sum(second * second)), tiny))
    unlike = float(np.linalg.norm(first - ratio * second) / max(float(np.linalg.norm(first)), tiny))
    if ratio >= LEAST_RATIO and unlike <= UNLIKE:
        return ratio, sizes[k : k + 3]
    falls = f"fall {ratio:.2g} times" if ratio > 1.0 else "do not fall"
    raise NotMeasuredError(
        f"No order between steps of {_listed(sizes[k : k + 3])} s, so nothing is extrapolated: "
        f"the differences {falls} from one pair to the next, and {unlike:.0%} of their size "
        "does not follow a power of the step."
    )


def remaining(errors: Sequence[Floats]) -> float:
    """Return what all further differences sum to at most, if they go on to fall; NaN where those of the runs do not.

    Events that a step rounds to its own instants leave differences that fall with the step, but neither as
    a power of it nor each below the one before. The finest must fall by `LEAST_RATIO` on the whole (by a
    line through their logarithms, least squares), and no faster fall is counted on: each allows the last
    what it would have fallen to, and the largest of these bounds what follows.

    Args:
        errors: of four runs or more (samples, components), the coarsest first; of fewer it is NaN.
    """
    least, most = FALLEN
    sizes = np.array([_most(one - other) for one, other in pairwise(errors)])[-most:]
    if len(sizes) < least or not np.isfinite(sizes).all():
        return math.nan
    age = np.arange(len(sizes))[::-1]
    fall = np.polyfit(age, np.log(np.maximum(sizes, np.finfo(float).tiny)), 1)[0]
    if fall < math.log(LEAST_RATIO):
        return math.nan
    last: float = np.max(sizes / LEAST_RATIO**age)
    return float(last / (LEAST_RATIO - 1.0))


def settled(positions: Positions, study: Study) -> bool:
    """Return whether finer steps than those of a study would tell little more of the parts of an error.

    They show an order, or what follows is a small part (`SETTLED`) of the whole error.

    Args:
        positions: errors of the run that is judged; what was laid for a shorter study is laid there already.
        study: its runs at falling steps.
    """
    if not positions.whole.size:
        return True
    positions.expect(study.runs)
    try:
        errors = [positions(one) for one in study.runs]
    except NotMeasuredError:  # one ends too early, and finer ones would too
        return True
    try:
        observed(errors, study.sizes)
    except NotMeasuredError:
        return remaining(errors) <= SETTLED * _most(positions.whole)
    return True


def _listed(sizes: Sequence[float]) -> str:
    return ", ".join(f"{size:.4g}" for size in sizes)


def extrapolated(errors: Sequence[Floats], ratio: float) -> tuple[Floats, float]:
    """Return the limit of three runs whose differences fall by a ratio, and what it is known to.

    That is the distance between the limits of the coarser pair and of the finer one: what the
    coarser one is off by.
    """
    coarse, middle, fine = errors
    if math.isinf(ratio):
        return fine, 2.0 * max(_most(coarse - middle), _most(middle - fine))
    limit = fine - (middle - fine) / (ratio - 1.0)
    return limit, _most(middle - (coarse - middle) / (ratio - 1.0) - limit)


def _most(error: Floats) -> float:
    return float(np.max(np.abs(error), initial=0.0))


def _around(t: Floats, instants: Floats) -> NDArray[np.intp]:
    """Return the samples at t (n,) before and behind instants (m,): (2, m)."""
    behind = np.clip(np.searchsorted(t, instants), 0, len(t) - 1)
    return np.stack([np.maximum(behind - 1, 0), behind])


def _asked(t: Floats, samples: NDArray[np.intp], truth: Truth) -> Floats:
    """Return when a truth is asked for at samples: it ends where it ends."""
    return np.minimum(t[samples], float(truth.trajectory.t[-1]))


class Positions:
    """Errors of positions of the runs of one engine, at the same samples.

    A rotation is three components, the vector in body axes that leads from the truth's to the
    run's, rad, in the first three entries of its quaternion.

    Attributes:
        whole: that of the run that is judged (samples, components).
        shorter: whether not all of that run is compared, as another ends before by the truth's clock.
    """

    def __init__(self, case: Case, truth: Truth, run: Trajectory, until: float = math.inf) -> None:
        self.case, self.truth, self.run = case, truth, run
        self.laid: dict[int, Floats] = {}
        self.scale = scale_of(truth.trajectory, case)
        for at in case.quaternions:
            self.scale[at : at + 4] = 1.0  # rad
        t, end = self._clock(truth, run), min(float(truth.trajectory.t[-1]), truth.trusted, until)
        inside = np.flatnonzero(t <= end)
        error = self._error(run.q[inside], truth.at(t[inside]).q) if len(inside) else np.zeros((0, 0))
        kept = distinct(np.linspace(0, max(len(inside) - 1, 0), min(len(inside), SAMPLES)).astype(np.intp))
        if error.size:  # the worst sample is one of them
            kept = distinct(kept, [np.unravel_index(int(np.argmax(self.sizes(error))), error.shape)[0]])
        self.samples, self.end = inside[kept], end
        self.long = far_apart(run.t[inside], case)
        between = self._between(t)
        self.t = np.concatenate([t[self.samples], between])
        self.kept, self.shorter, self._rounding = np.arange(len(self.t)), False, REACHED * case.t_end
        self.whole = np.concatenate([error[kept], self._lay(run, truth, between)]) if len(between) else error[kept]

    def _clock(self, truth: Truth, run: Trajectory) -> Floats:
        """Return the clock (n,) of a run, s, laid on the touches on which that of the judged one is.

        Else parts would tell by how much clocks are apart.
        """
        return clock(truth, run, self.case, laid=which_laid(self.truth, self.run, self.case))

    def _between(self, t: Floats) -> Floats:
        """Return the instants (m,) inside of long steps of the judged run, by a clock (n,) that its samples have."""
        return np.concatenate([np.zeros(0), *(t[i] + LOOKS * (t[i + 1] - t[i]) for i in self.long)])

    def __call__(self, run: Trajectory) -> Floats:
        """Return the error of a run at the same instants of the truth's clock; each is laid there once.

        Raises:
            NotMeasuredError: if it ends before.
        """
        if id(run) not in self.laid:
            self.laid[id(run)] = self._lay(run, self.truth, self.t)
        return self.laid[id(run)]

    def expect(self, runs: Sequence[Trajectory]) -> None:
        """Have the truth found at once for all runs that will be laid on it, but for those that are.

        One that touches late ends earlier on the truth's clock than on its own: there the comparison of all ends.
        """
        if not self.whole.size:
            return
        fresh = [run for run in runs if len(run.t) and id(run) not in self.laid]
        clocks = [self._clock(self.truth, run) for run in fresh]
        whole = self.run.t[-1] - self._rounding
        self._end(min((t[-1] for run, t in zip(fresh, clocks, strict=True) if run.t[-1] >= whole), default=math.inf))
        self.truth.expect(_asked(t, distinct(_around(t, self.t)), self.truth) for t in clocks)

    def _end(self, end: float) -> None:
        """Compare up to an instant, s, but keep one."""
        inside = self.t <= max(end + self._rounding, self.t.min())
        if not inside.all():
            self.shorter = True
            self.t, self.whole, self.kept = self.t[inside], self.whole[inside], self.kept[inside]
            self.laid = {run: error[inside] for run, error in self.laid.items()}

    def _lay(self, run: Trajectory, truth: Truth, instants: Floats) -> Floats:
        """Return the error of a run at instants (m,) of the truth's clock.

        Between its samples the error is interpolated, which is smaller and smoother than the motion: by a
        cubic through the rates of both.
        """
        t = self._clock(truth, run)
        if not len(t) or t[-1] < instants.max() - self._rounding:
            ends = f"{float(run.t[-1]) if len(t) else 0.0:.6g} s"
            raise NotMeasuredError(f"Another run of the engine, which the parts need, ends too early, at t = {ends}.")
        before, behind = around = _around(t, instants)
        needed = distinct(around)
        exact = truth.at(_asked(t, needed, truth))
        error = self._error(run.q[needed], exact.q)
        a, b = (np.searchsorted(needed, side) for side in (before, behind))
        width = (t[behind] - t[before])[:, None]
        wide = np.where(width > 0.0, width, 1.0)
        x = np.clip(np.where(width > 0.0, (instants - t[before])[:, None] / wide, 1.0), 0.0, 1.0)
        own = (run.t[behind] - run.t[before])[:, None] / wide  # the run's clock over the truth's
        sides = ((taken(run, needed[i]), taken(exact, i)) for i in (a, b))
        left, right = (self._filled(rate_of_error(truth, *side, own, self.case)) for side in sides)
        slope = error[b] - error[a]
        found: Floats = error[a] + x * slope
        found += x * (1.0 - x) * ((1.0 - x) * (width * left - slope) + x * (slope - width * right))
        return found

    def against(self, own: Truth) -> Floats:
        """Return the error of the judged run against another truth, on its clock."""
        t = self._clock(own, self.run)
        exact = own.at(np.minimum(t[self.samples], float(own.trajectory.t[-1])))
        error, between = self._error(self.run.q[self.samples], exact.q), self._between(t)
        found = np.concatenate([error, self._lay(self.run, own, between)]) if len(between) else error
        return found[self.kept]

    def _filled(self, rates: Floats) -> Floats:
        """Return rates (n, nv) as errors count: relative, with a zero behind those of each rotation (n, components)."""
        filled = [at - i + 3 for i, at in enumerate(self.case.quaternions)]
        return np.insert(rates, filled, 0.0, axis=1) / self.scale

    def _error(self, q: Floats, exact: Floats) -> Floats:
        error = q - exact
        for at in self.case.quaternions:
            entries = slice(at, at + 4)
            error[:, at : at + 3] = turned(q[:, entries], exact[:, entries])
            error[:, at + 3] = 0.0
        return error / self.scale

    def sizes(self, error: Floats) -> Floats:
        """Return |error|, that of a rotation in the first entry of its quaternion."""
        sizes = np.abs(error)
        for at in self.case.quaternions:
            sizes[:, at] = np.linalg.norm(error[:, at : at + 3], axis=1)
            sizes[:, at + 1 : at + 4] = 0.0
        return sizes

    def worst(self) -> tuple[str, Callable[[Floats], float]]:
        """Return where the whole error is largest, in words, and what gives the share of a part there."""
        sizes = self.sizes(self.whole)
        i, j = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
        entries = slice(j, j + 3) if j in self.case.quaternions else slice(j, j + 1)
        along = self.whole[i, entries] / (sizes[i, j] or 1.0)
        where = f"{self.case.coordinates[j].name} at t = {self.t[i]:.6g} s"
        return where, lambda error: float(error[i, entries] @ along)


class Events:
    """Errors of the instants of touches and releases that a run shares with the truth, s: (events, 1).

    Attributes:
        whole: that of the run that is judged.
    """

    def __init__(self, case: Case, truth: Truth, run: Trajectory) -> None:
        self.case, self.truth, self.run = case, truth, run
        self.shared = self._shared(truth, run)
        self.whole = _shifts(self.shared)

    def __call__(self, run: Trajectory) -> Floats:
        """Return the error of the same instants of another run.

        Raises:
            NotMeasuredError: if it has others.
        """
        return self._same(self._shared(self.truth, run), _IN_TRUTH)

    def against(self, own: Truth) -> Floats:
        """Return the error of the judged run against another truth.

        Raises:
            NotMeasuredError: if that has other events.
        """
        return self._same(self._shared(own, self.run), _IN_RUN)

    def _shared(self, truth: Truth, run: Trajectory) -> Floats:
        """Return rows, and instants in the truth and in the run, s, of all that both have (events, 3): touches first.

        A run may go on behind the time to which the truth is known: what it does there is none of them.
        """
        pairs = matched(truth, truth.compared(run))
        found = [(a.row, a.touch, b.touch) for a, b in pairs]
        found += [(a.row, a.release, b.release) for a, b in pairs if np.isfinite(a.release) and np.isfinite(b.release)]
        shared = np.array(found).reshape(-1, 3)
        return shared if np.isfinite(shared).all() else np.zeros((0, 3))

    def _same(self, shared: Floats, by: list[int]) -> Floats:
        """Return the errors of instants that are those of the judged run, each at its place.

        Of as many that are others the difference is no part of an error: they may be any time apart.
        """
        if not np.array_equal(shared[:, by], self.shared[:, by]):
            raise NotMeasuredError("A run of its study does not share the same events with the truth.")
        return _shifts(shared)

    def sizes(self, error: Floats) -> Floats:
        """Return |error|."""
        return np.abs(error)

    def worst(self) -> tuple[str, Callable[[Floats], float]]:
        """Return where the whole error is largest, in words, and what gives the share of a part there."""
        i = int(np.argmax(np.abs(self.whole)))
        sign = -1.0 if self.whole[i, 0] < 0.0 else 1.0
        touches = len(matched(self.truth, self.truth.compared(self.run)))
        said = f"{'touch' if i < touches else 'release'} at t = {self.shared[i, 1]:.6g} s"
        return said, lambda error: sign * float(error[i, 0])


_IN_TRUTH, _IN_RUN = [0, 1], [0, 2]
"""What tells events apart (`Events`): by which instants, beside their rows."""


def _shifts(shared: Floats) -> Floats:
    """Return by how much instants are later in a run than in the truth (events, 1), s."""
    return shared[:, 2:] - shared[:, 1:2]
