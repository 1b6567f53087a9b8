"""Coulomb friction in the algebra of the active rows: tangential rows that hold, or whose force follows the normal one.

A contact that sticks has its tangential rows among those that are solved. One that slides has

    lam_t = -mu lam_n s,    s = v_t / |v_t|

in the columns, so that with G = H M^-1 H^T of all rows in contact the matrix that is solved,

    A = G - mu (G_.t s) in the column of a sliding normal row

is not symmetric. Rows may depend on each other, as those of a box on its corners do. Then the normal rows are fulfilled
first, by multipliers of least norm, and the sticking ones in their null space, by those of least sum |lam_t|^2 / (mu
lam_n): a load is shared so that no contact is nearer to its bound than it must be.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference.cache import compiled
from crossbody.reference.core.algebra import substitute
from crossbody.reference.core.filters import STAGES_RANGE
from crossbody.reference.core.friction import (
    bound,
    count_from_none,
    has_begun,
    has_friction,
    is_dry,
    is_tangent,
    most_drift,
    slip,
    slip_along,
    small_slip,
)
from crossbody.reference.core.guards import STOP
from crossbody.reference.core.layout import NODES, Model, Work
from crossbody.reference.kinds import Array, Bytes, Floats, Index

CLEAR = 10.0  # times as much as has no direction, or it began with: then a slip counts from none
RANK = 1e-10  # part of a contact's own size below which a pivot is that of a row which depends on others
LIGHT = 1e-12  # part of the largest load at a contact, below which it counts as that
SHARINGS = 3  # times that loads are shared anew: the normal ones follow from the tangential ones
MOST_SPREADS = 200  # times more where a contact would bear more than it can: others may for it
JAMMED = 1e-9  # determinant, of rows of size 1, that counts as none
LINGERS = 10.0  # times as long as friction takes to stop what has no direction: what slides so slowly is held


@compiled
def begin(w: Work) -> None:
    """Forget what another run of the same workspace has left."""
    for left in (w.way, w.rest, w.tolerated, w.open_v, w.open_rate):
        left[:] = 0.0
    w.off[:], w.begins[:], w.since[:], w.within[:] = 0, 0, -np.inf, np.inf


@compiled
def _face(m: Model, w: Work, i: int, rate: Array) -> None:
    """Take the direction of the present slip velocity of contact i for that of reference."""
    size = slip(m, w, i, rate)
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        w.way[t] = (rate[t] - m.drift[t] - w.rest[t]) / size


@compiled
def note_speed(s: Any, m: Model, w: Work, rate: Array) -> None:
    """Keep the largest speed seen at contacts with friction: of their gaps, and of what makes up their slips."""
    for i in range(s.nc):
        if has_friction(m, i):
            s.slip_speed = max(s.slip_speed, slip(m, w, i, rate), abs(rate[i]))
    for j in range(s.na):
        i, size = w.idx[j], 0.0
        for c in range(m.span[i, 0], m.span[i, 1] if is_tangent(m, i) else 0):
            size += abs(w.H[j, c] * w.y[s.nq + c])
        s.slip_speed = max(s.slip_speed, size)


@compiled
def turns_aside(s: Any, m: Model, w: Work) -> bool:
    """Whether a contact whose slip falls to zero along its direction of reference slides on across it; rates in w.rate.

    It has turned by a right angle within the step, and friction with it: too fast for what the step knows of any guard.
    """
    for i in range(s.nc):
        if w.hit[i] <= s.theta and w.kind[i] == STOP:
            along = slip_along(m, w, i, w.rate)
            if slip(m, w, i, w.rate) ** 2 - along * along > small_slip(s) ** 2:
                return True
    return False


@compiled
def _rest(m: Model, w: Work, i: int) -> float:
    """Size of the slip velocity with which contact i began."""
    square = 0.0
    for t in range(m.tangent[i], m.tangent[i] + m.tangents[i]):
        square += w.rest[t] * w.rest[t]
    return float(np.sqrt(square))


@compiled
def _lingers(s: Any, m: Model, w: Work, i: int, rate: Array) -> bool:
    """Whether contact i has been sliding without a direction for far longer than its friction takes to stop it.

    Others hold the body, and what they leave it dies out without ever passing zero. Such a contact is at rest.
    """
    if has_begun(w, i) or slip(m, w, i, rate) > small_slip(s):
        w.within[i] = np.inf
        return False
    w.within[i] = min(w.within[i], s.t)
    c = w.listed[m.tangent[i]]
    brake = bound(m, i, w.lam0[i]) * w.gram[c, c]
    return bool((s.t - w.within[i]) * brake > LINGERS * small_slip(s))


@compiled
def renew(s: Any, m: Model, w: Work, rate: Array) -> bool:
    """Take the directions of the present slip velocities for those of reference, where they are clear of zero.

    Whether contacts have stopped without passing zero: they are marked as if they had passed it.
    """
    note_speed(s, m, w, rate)
    linger = False
    for i in range(s.nc):
        if has_friction(m, i) and w.slides[i]:
            if has_begun(w, i) and slip(m, w, i, rate) > CLEAR * max(small_slip(s), _rest(m, w, i)):
                count_from_none(m, w, i)
                s.watched = 0
            if slip(m, w, i, rate) > small_slip(s):
                _face(m, w, i, rate)
            if m.tangents[i] > 1:
                s.have_jacobian = 0  # it turns at a rate that goes as 1/|v_t|
            if _lingers(s, m, w, i, rate):
                w.hit[i], w.kind[i], linger = 0.0, STOP, True
    if s.na > 0 and s.dependent_rows > 0:
        s.redundant = max(s.redundant, s.dependent_rows)
    return linger


@compiled
def _lengthened(s: Any, m: Model, w: Work, i: int, x: float, y: float) -> tuple[float, float]:
    """Return the slip velocity (x, y) of contact i, one that is small or points back lengthened along its reference.

    So its direction changes steadily to that of reference where it vanishes, and is never more than a right angle off
    it: a jump would end every step. Clear of zero and ahead it is left as it is.
    """
    t, small = m.tangent[i], small_slip(s)
    p, r = w.way[t], w.way[t + 1]
    ahead, aside = x * p + y * r, y * p - x * r
    part = 1.0 - (aside / small) ** 2 if abs(aside) < small else 0.0
    ahead = max(ahead, small * part * part)
    return ahead * p - aside * r, ahead * r + aside * p


@compiled
def _directions(s: Any, m: Model, w: Work, turning: bool) -> None:
    """Leave in w.along the direction in which every sliding contact slides, or that of reference."""
    for j in range(s.na):
        i = w.idx[j]
        if not has_friction(m, i) or not w.slides[i]:
            continue
        t, c = m.tangent[i], w.listed[m.tangent[i]]
        w.along[c] = w.way[t]
        if m.tangents[i] > 1:
            x, y = _lengthened(s, m, w, i, w.hda[c] - w.rest[t], w.hda[c + 1] - w.rest[t + 1])
            size = np.sqrt(x * x + y * y)
            follows = turning and size > 0.0
            w.along[c], w.along[c + 1] = (x / size, y / size) if follows else (w.way[t], w.way[t + 1])


@compiled
def _list_unknowns(s: Any, m: Model, w: Work) -> int:
    """List in w.unknown the places that are solved for, sticking tangential rows last; how many are not of those."""
    count = 0
    for j in range(s.na):
        if not w.off[w.idx[j]] and not is_tangent(m, w.idx[j]):
            w.unknown[count] = j
            count += 1
    normals = count
    for j in range(s.na):
        i = w.idx[j]
        if not w.off[i] and is_tangent(m, i) and not w.slides[i]:
            w.unknown[count] = j
            count += 1
    s.unknowns = count
    return normals


@compiled
def _size(m: Model, w: Work, j: int) -> float:
    """Size of the row in place j, a tangential one by its normal row: it may be none that anything moves."""
    i = w.idx[j]
    normal = w.listed[m.follows[i]] if is_tangent(m, i) else j
    return float(np.sqrt(max(w.gram[normal, normal], w.gram[j, j])))


@compiled
def fill(s: Any, m: Model, w: Work) -> None:
    """A of the unknowns in w.matrix, scaled by their sizes, which stand in w.size."""
    for a in range(s.unknowns):
        w.size[a] = _size(m, w, w.unknown[a])
    for b in range(s.unknowns):
        k = w.unknown[b]
        i = w.idx[k]
        sliding = has_friction(m, i) and w.slides[i]
        first = w.listed[m.tangent[i]] if sliding else 0
        for a in range(s.unknowns):
            j = w.unknown[a]
            total = w.gram[j, k]
            if sliding:
                for c in range(first, first + m.tangents[i]):
                    total -= m.friction[i] * w.along[c] * w.gram[j, c]
            w.matrix[a, b] = total / (w.size[a] * w.size[b])


@compiled
def factor_complete(A: Floats, rows: int, columns: int, down: Index, across: Index) -> int:
    """LU factors with complete pivoting, in place; how many pivots are above RANK of the size 1 that rows have.

    Args:
        A: the matrix, overwritten by both factors; rows and columns as exchanged.
        rows: how many it has.
        columns: how many it has.
        down: which row stands where.
        across: which column stands where.
    """
    for a in range(rows):
        down[a] = a
    for b in range(columns):
        across[b] = b
    for c in range(min(rows, columns)):
        best, most_a, most_b = RANK, -1, -1
        for a in range(c, rows):
            for b in range(c, columns):
                if abs(A[a, b]) > best:
                    best, most_a, most_b = abs(A[a, b]), a, b
        if most_a < 0:
            return c
        if most_a != c:
            for b in range(columns):
                A[c, b], A[most_a, b] = A[most_a, b], A[c, b]
            down[c], down[most_a] = down[most_a], down[c]
        if most_b != c:
            for a in range(rows):
                A[a, c], A[a, most_b] = A[a, most_b], A[a, c]
            across[c], across[most_b] = across[most_b], across[c]
        for a in range(c + 1, rows):
            if A[a, c] != 0.0:
                A[a, c] /= A[c, c]
                for b in range(c + 1, columns):
                    A[a, b] -= A[a, c] * A[c, b]
    return min(rows, columns)


@compiled
def _solve_normal(B: Floats, n: int, x: Array) -> None:
    """X := B^-1 x of a symmetric positive definite B, which is overwritten by its Cholesky factor."""
    for i in range(n):
        for j in range(i + 1):
            total = B[i, j]
            for c in range(j):
                total -= B[i, c] * B[j, c]
            B[i, j] = np.sqrt(total) if i == j else total / B[j, j]
    for i in range(n):
        for c in range(i):
            x[i] -= B[i, c] * x[c]
        x[i] /= B[i, i]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            x[i] -= B[c, i] * x[c]
        x[i] /= B[i, i]


@compiled
def solve_complete(
    A: Floats, n: int, rank: int, down: Index, across: Index, weight: Array, B: Floats, y: Array, x: Array
) -> None:
    """X := the solution of the system that `factor_complete` has factored, of least squares and of least norm.

    Args:
        A: the factors.
        n: size of the system.
        rank: of it.
        down: which row stands where.
        across: which column stands where.
        weight: (n,) squares of entries count over these.
        B: (n, n) scratch.
        y: (n,) scratch.
        x: right-hand side, overwritten.
    """
    for a in range(n):
        y[a] = x[down[a]]
    if rank == n:
        substitute(A, n, y)
        for c in range(n):
            x[across[c]] = y[c]
        return
    for a in range(rank):  # L^T L
        for b in range(a + 1):
            total = 0.0
            for c in range(a, n):
                total += (1.0 if c == a else A[c, a]) * (1.0 if c == b else A[c, b])
            B[a, b] = total
    for a in range(rank):  # L^T y, from above: what is still needed stands below
        total = y[a]
        for c in range(a + 1, n):
            total += A[c, a] * y[c]
        y[a] = total
    _solve_normal(B, rank, y)
    for a in range(rank):  # U W U^T
        for b in range(a + 1):
            total = 0.0
            for c in range(a, n):
                total += A[a, c] * weight[across[c]] * A[b, c]
            B[a, b] = total
    _solve_normal(B, rank, y)
    for c in range(n):
        total = 0.0
        for a in range(min(c + 1, rank)):
            total += A[a, c] * y[a]
        x[across[c]] = weight[across[c]] * total


@compiled
def factor(s: Any, m: Model, w: Work, turning: bool) -> int:
    """Factor A of the rows in contact from G in the lower triangle of w.G; 1 if that is not finite.

    The rates of tangential rows count from here on against what the surface does by itself. Directions of slip are
    those of the present velocities if they are `turning`, else those of reference.
    """
    for j in range(s.na):
        i = w.idx[j]
        w.listed[i] = j
        if m.drift[i] != 0.0:
            w.hda[j] -= m.drift[i]
            w.r[j] += w.law[i, 1] * m.drift[i]
    for j in range(s.na):
        for c in range(j + 1):
            value = w.G[j, c] if c >= w.reach[j] else 0.0
            w.gram[j, c] = value
            w.gram[c, j] = value
    _directions(s, m, w, turning)
    factor_set(s, m, w)
    return int(s.rank == 0 and s.unknowns > 0)


@compiled
def factor_set(s: Any, m: Model, w: Work) -> None:
    """Factor A of the rows that are not off, from w.gram, w.slides and w.along."""
    s.normals = _list_unknowns(s, m, w)
    fill(s, m, w)
    s.rank = factor_complete(w.matrix, s.unknowns, s.unknowns, w.down, w.across)
    s.dependent_rows = s.unknowns - s.rank
    if s.dependent_rows > 0:
        _factor_in_turn(s, m, w)


@compiled
def _factor_in_turn(s: Any, m: Model, w: Work) -> None:
    """Factor the normal rows alone, and what they leave of the sticking ones."""
    count, total = s.normals, s.unknowns
    fill(s, m, w)
    for a in range(count):
        for b in range(count):
            w.first[a, b] = w.matrix[a, b]
        w.weight[a] = 1.0
    s.rank_first = factor_complete(w.first, count, count, w.down, w.across)
    for b in range(count, total):
        for a in range(count):
            w.found[a] = w.matrix[a, b]
        solve_complete(w.first, count, s.rank_first, w.down, w.across, w.weight, w.square, w.beside, w.found)
        for a in range(count, total):
            value = w.matrix[a, b]
            for c in range(count):
                value -= w.matrix[a, c] * w.found[c]
            w.second[a - count, b - count] = value
        for a in range(count):
            w.held[a, b - count] = w.found[a]
    for a in range(count, total):
        for c in range(count):
            w.held[a, c] = w.matrix[a, c]
    s.rank_second = factor_complete(w.second, total - count, total - count, w.down2, w.across2)


@compiled
def solve(s: Any, m: Model, w: Work, r: Array, la: Array) -> None:
    """Fill la of all rows in contact from the right-hand side r and what `factor` left; rows that are off get none.

    Those that slide with a bound of their own get it, and their forces count on the right-hand side.
    """
    for j in range(s.na):
        w.pushed[j] = r[j]
    for c in range(s.na):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            force = -m.friction[w.idx[c]] * w.along[c]
            for j in range(s.na):
                w.pushed[j] -= w.gram[j, c] * force
    _solve_unknowns(s, m, w, w.pushed)
    if s.dependent_rows > 0 and s.rank_second < s.unknowns - s.normals:
        _spread(s, m, w)
    _give(s, m, w, la)
    for c in range(s.na):
        if is_dry(m, w.idx[c]) and w.slides[w.idx[c]]:
            la[c] = -m.friction[w.idx[c]] * w.along[c]


@compiled
def respond(s: Any, m: Model, w: Work, r: Array, la: Array) -> None:
    """Fill la of all rows in contact by how it changes with r: constant forces of rows that slide have no part."""
    _solve_unknowns(s, m, w, r)
    _give(s, m, w, la)


@compiled
def _solve_unknowns(s: Any, m: Model, w: Work, r: Array) -> None:
    """Leave in w.found the unknowns, scaled by their sizes."""
    for a in range(s.unknowns):
        w.found[a] = r[w.unknown[a]] / w.size[a]
    if s.dependent_rows > 0:
        _solve_in_turn(s, m, w)
    else:
        solve_complete(w.matrix, s.unknowns, s.rank, w.down, w.across, w.weight, w.square, w.beside, w.found)


@compiled
def _give(s: Any, m: Model, w: Work, la: Array) -> None:
    """Multipliers of all rows in contact from the unknowns."""
    for j in range(s.na):
        la[j] = 0.0
    for a in range(s.unknowns):
        la[w.unknown[a]] = w.found[a] / w.size[a]
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not (w.off[i] or is_dry(m, i)):
            first = w.listed[m.tangent[i]]
            for c in range(first, first + m.tangents[i]):
                la[c] = -m.friction[i] * la[j] * w.along[c]


@compiled
def _solve_in_turn(s: Any, m: Model, w: Work) -> None:
    """Solve for w.found the normal rows, and in their null space the sticking ones, by loads that suit these."""
    count, sticking = s.normals, s.unknowns - s.normals
    for a in range(count):
        w.weight[a] = 1.0
    solve_complete(w.first, count, s.rank_first, w.down, w.across, w.weight, w.square, w.beside, w.found)
    for a in range(sticking):
        value = w.found[count + a]
        for c in range(count):
            value -= w.held[count + a, c] * w.found[c]
        w.left[a] = value
    for a in range(count):
        w.press[a] = w.found[a]
    for _ in range(SHARINGS if s.rank_second < sticking else 1):
        _weigh(s, m, w)
        _share(s, w)


@compiled
def _share(s: Any, w: Work) -> None:
    """Solve for the sticking rows by w.weight, and for the normal ones beside them."""
    count, sticking = s.normals, s.unknowns - s.normals
    for a in range(sticking):
        w.found[count + a] = w.left[a]
    solve_complete(
        w.second, sticking, s.rank_second, w.down2, w.across2, w.weight, w.square, w.beside, w.found[count:]
    )  # fmt: skip
    for a in range(count):
        value = w.press[a]
        for c in range(sticking):
            value -= w.held[a, c] * w.found[count + c]
        w.found[a] = value


@compiled
def _spread(s: Any, m: Model, w: Work) -> None:
    """Share the loads of sticking contacts anew until none bears more than it can, or it is known that some must.

    Lawson's weights, which grow with what a contact bears of its bound, lead to the sharing whose largest part is the
    least. Squares of the parts, weighted, sum up to no more than the square of that: where they do to 1 none suffices.
    """
    count, sticking = s.normals, s.unknowns - s.normals
    for spread in range(MOST_SPREADS):
        _weigh(s, m, w)
        total, most = 0.0, 0.0
        for a in range(sticking):  # bounds, and parts of them
            w.left2[a] = w.weight[a] / w.size[count + a] ** 2
            square = 0.0
            for c in range(sticking):
                if m.follows[w.idx[w.unknown[count + c]]] == m.follows[w.idx[w.unknown[count + a]]]:
                    square += (w.found[count + c] / w.size[count + c]) ** 2
            unbounded = m.friction[m.follows[w.idx[w.unknown[count + a]]]] == np.inf
            w.part2[a] = 0.0 if unbounded else np.sqrt(square) / w.left2[a]
            most = max(most, w.part2[a])
            if spread == 0:
                w.share2[a] = w.left2[a]
            total += w.share2[a]
        if not most > 1.0:
            return
        sum1, sum2 = 0.0, 0.0
        for a in range(sticking):
            w.share2[a] /= total
            sum1 += w.share2[a] * w.part2[a]
            sum2 += w.share2[a] * w.part2[a] ** 2
        if not sum2 <= 1.0:
            return
        for a in range(sticking):
            w.share2[a] = max(w.share2[a] * w.part2[a] / sum1, LIGHT)
            w.weight[a] = (w.left2[a] * w.size[count + a]) ** 2 / w.share2[a]
        _share(s, w)


@compiled
def _weigh(s: Any, m: Model, w: Work) -> None:
    """Leave in w.weight the bound of every sticking row, mu lam_n, in the scale of its unknown."""
    count, most = s.normals, 0.0
    for a in range(s.unknowns - count):
        n = m.follows[w.idx[w.unknown[count + a]]]
        load = 0.0
        for b in range(count):
            if w.unknown[b] == w.listed[n]:
                load = m.friction[n] * w.found[b] / w.size[b] if m.friction[n] < np.inf else w.found[b] / w.size[b]
        if is_dry(m, n):
            load = m.friction[n]
        w.weight[a] = max(load, 0.0) * w.size[count + a] ** 2
        most = max(most, w.weight[a])
    for a in range(s.unknowns - count):
        w.weight[a] = max(w.weight[a], LIGHT * most) if most > 0.0 else 1.0


@compiled
def _reach(s: Any, m: Model, w: Work, j: int) -> None:
    """Mark in w.reached the places of rows in contact that forces of the row in place j move, or that move with it."""
    for a in range(s.na):
        w.reached[a] = a == j
    grows = True
    while grows:
        grows = False
        for a in range(s.na):
            own = m.follows[w.idx[a]] if is_tangent(m, w.idx[a]) else w.idx[a]
            for c in range(s.na if w.reached[a] else 0):
                i = w.idx[c]
                beside = i == own or (is_tangent(m, i) and m.follows[i] == own)
                if not (w.reached[c] or w.off[i]) and (beside or w.gram[a, c] != 0.0):
                    w.reached[c] = 1
                    grows = True


@compiled
def _signed_product(A: Floats, n: int, down: Index, across: Index, seen: Bytes) -> float:
    """Determinant from the factors of `factor_complete`, of the rows whose places `seen` does not mark; it fills it."""
    product = 1.0
    for a in range(n):
        b, length = a, 0
        while not seen[b]:
            seen[b] = 1
            product *= A[b, b]
            length += 1
            for c in range(n):
                if down[c] == across[b]:
                    b = c
                    break
        if length > 0 and length % 2 == 0:
            product = -product
    return float(product)


@compiled
def _independent(s: Any, w: Work, count: int) -> int:
    """Factor G = L L^T of the unknowns that w.among lists into w.second, their places in w.down2; how many rows."""
    for a in range(count):
        for b in range(count):
            j, k = w.among[a], w.among[b]
            w.square[a, b] = w.gram[w.unknown[j], w.unknown[k]] / (w.size[j] * w.size[k])
    rank = 0
    while rank < count:
        most, best = RANK, -1
        for a in range(count):
            if w.square[a, a] > most:
                most, best = w.square[a, a], a
        if best < 0:
            break
        for a in range(count):
            w.second[a, rank] = w.square[a, best] / np.sqrt(most)
        for a in range(count):
            for b in range(count):
                w.square[a, b] -= w.second[a, rank] * w.second[b, rank]
        w.square[best, best] = 0.0
        w.down2[rank] = best
        rank += 1
    return rank


@compiled
def determinant(s: Any, m: Model, w: Work, j: int) -> float:
    """Determinant of A of the rows that the sliding contact in place j bears on: positive until they jam together.

    Where it vanishes some forces of theirs press none of them, and behind that their forces drive them into each other:
    of one contact alone it is Painleve's p. Of rows that depend on each other only what forces do to independent ones
    counts, as by springs that are all alike: with G = L L^T it is that of L^+ A L. Less JAMMED: two that come near that
    place together press in turn, ever faster.
    """
    _reach(s, m, w, j)
    if s.dependent_rows == 0:
        for a in range(s.unknowns):
            w.seen[a] = not w.reached[w.unknown[w.down[a]]]
        return _signed_product(w.matrix, s.unknowns, w.down, w.across, w.seen) - JAMMED
    fill(s, m, w)
    count = 0
    for a in range(s.unknowns):
        if w.reached[w.unknown[a]]:
            w.among[count] = a
            count += 1
    rank = _independent(s, w, count)
    for b in range(count):
        for a in range(rank):
            value = w.matrix[w.among[w.down2[a]], w.among[b]]
            for c in range(a):
                value -= w.second[w.down2[a], c] * w.held[c, b]
            w.held[a, b] = value / w.second[w.down2[a], a]
    for a in range(rank):
        for b in range(rank):
            w.first[a, b] = 0.0
            for c in range(count):
                w.first[a, b] += w.held[a, c] * w.second[c, b]
    if factor_complete(w.first, rank, rank, w.down, w.across) < rank:
        return -JAMMED
    w.seen[:] = 0
    return _signed_product(w.first, rank, w.down, w.across, w.seen) - JAMMED


@compiled
def without_pull(s: Any, m: Model, w: Work) -> None:
    """Solve again without what pulls sticking rows back, whose noise would move the instant at which they slip."""
    for j in range(s.na):
        i = w.idx[j]
        if is_tangent(m, i) and not w.slides[i]:
            w.r[j] += w.law[i, 1] * w.hda[j]
    solve(s, m, w, w.r, w.la)


@compiled
def watch_friction(s: Any, m: Model, w: Work, out: Array) -> None:
    """Write how far every contact is from sliding, or one that slides from a jam, after an evaluation."""
    without_pull(s, m, w)
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and not w.slides[i]:
            out[i] = margin(m, w, i, w.la)
    value, known = 0.0, False
    for j in range(s.na):
        i = w.idx[j]
        if has_friction(m, i) and w.slides[i] and not is_dry(m, i):
            if not (known and w.reached[j]):
                value, known = determinant(s, m, w, j), True
            out[i] = value


@compiled
def _across(m: Model, w: Work, i: int) -> tuple[float, float]:
    """Across the direction of slip of contact i: its part along both tangential rows."""
    first = w.listed[m.tangent[i]]
    return -w.along[first + 1], w.along[first]


@compiled
def _turning_slip(s: Any, m: Model, w: Work, i: int) -> float:
    """Size of the slip velocity at the step's start by which contact i turns."""
    t = m.tangent[i]
    x, y = w.rates[0, t] - m.drift[t] - w.rest[t], w.rates[0, t + 1] - m.drift[t + 1] - w.rest[t + 1]
    x, y = _lengthened(s, m, w, i, x, y)
    return float(np.sqrt(x * x + y * y))


@compiled
def turning_rate(s: Any, m: Model, w: Work, begun: bool) -> float:
    """Fastest rate, 1/s, at which friction turns a slip into its own direction: mu lam_n / |v_t| over the mass there.

    From the last evaluation and what stands at the step's start. It grows without bound as a slip dies out.
    """
    fastest = 0.0
    for i in range(s.nc):
        if has_friction(m, i) and w.slides[i] and m.tangents[i] > 1 and (not begun or has_begun(w, i)):
            c, (x, y), size = w.listed[m.tangent[i]], _across(m, w, i), _turning_slip(s, m, w, i)
            light = x * x * w.gram[c, c] + 2.0 * x * y * w.gram[c, c + 1] + y * y * w.gram[c + 1, c + 1]
            if size > 0.0:
                fastest = max(fastest, m.friction[i] * w.lam0[i] * light / size)
    return float(fastest)


@compiled
def turn_part(s: Any, m: Model, w: Work, i: int) -> float:
    """Fill w.la with what a turn of the slip of contact i by one radian makes of all multipliers; 1/|v_t|, or 0.

    Times the slip velocity across it is the turn. w.lam0 has the multipliers of the present instant.
    """
    size = _turning_slip(s, m, w, i) if w.slides[i] and m.tangents[i] > 1 else 0.0
    if not size > 0.0:
        return 0.0
    c, (x, y) = w.listed[m.tangent[i]], _across(m, w, i)
    force = -m.friction[i] * w.lam0[i]
    for j in range(s.na):
        w.r[j] = -force * (w.gram[j, c] * x + w.gram[j, c + 1] * y)
    respond(s, m, w, w.r, w.la)
    w.la[c] += force * x
    w.la[c + 1] += force * y
    return float(1.0 / size)


@compiled
def _within_bound(m: Model, i: int, lam: Array, normal: int, first: int) -> float:
    """By how much friction of contact i is below its bound; its rows stand at `normal` and from `first` on in lam."""
    square = 0.0
    for t in range(first, first + m.tangents[i]):
        square += lam[t] * lam[t]
    return float(bound(m, i, lam[normal]) - np.sqrt(square))


@compiled
def holds_on(s: Any, m: Model, w: Work, i: int) -> bool:
    """Whether a contact that sticks stays clear of its bound, as far as the stages tell, and where it is."""
    if slip(m, w, i, w.rates[NODES - 1]) > most_drift(s):
        return False
    low, high = np.inf, -np.inf
    for stage in range(s.end + 1):
        lam = w.lams[0] if stage == 0 else (w.lam_at[stage] if stage < s.end else w.lams[NODES - 1])
        value = _within_bound(m, i, lam, i, m.tangent[i])
        low, high = min(low, value), max(high, value)
    return bool(low > 0.0 and low > STAGES_RANGE * (high - low))


@compiled
def margin(m: Model, w: Work, i: int, la: Array) -> float:
    """By how much friction of contact i is below its bound, from the multipliers of the rows in contact."""
    return float(_within_bound(m, i, la, w.listed[i], w.listed[m.tangent[i]]))
