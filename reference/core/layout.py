"""What a run remembers between calls, and its workspace: nothing is allocated after the start."""

from __future__ import annotations

from typing import Any

import numpy as np

from crossbody.reference import kernels
from crossbody.reference.core.bundles import FunctionsType, bundle_type, opener
from crossbody.reference.core.dop853_table import DENSE_STAGES, DENSE_TERMS
from crossbody.reference.kinds import Bytes, Bytes2, Floats, Floats2, Index, Index2

# Return codes of `advance`; the Python side turns them into outcomes.
DONE, MORE, ROWS_FULL, EVENTS_FULL = 0, 1, 2, 3
STEP_TOO_SMALL, NOT_FINITE, ILL_POSED, MODE_CYCLE, DIVERGED, LOST, INCONSISTENT = -1, -2, -3, -4, -5, -6, -7
PAINLEVE, NO_CONSISTENT_MODES = -8, -9
TOO_LONG = 4  # of a scan: the step tells too little of its guards

# Machines, rules for several contacts, methods.
LEVEL, EDGE, MEMORYLESS = 0, 1, 2
SEQUENTIAL, SIMULTANEOUS, RESOLVED = 0, 1, 2
EXPLICIT, IMPLICIT, EXACT, SHORT = 0, 1, 2, 3

# Modes, as in crossbody.cases.Mode.
FREE, CONTACT, BALLISTIC, COLLISION, COLLISION_SEPARATION, BILATERAL, STICK, SLIP = 0, 1, 2, 3, 4, 5, 6, 7

NODES = 5  # a step is watched at its ends and at three points between
STAGES_MOST = 12  # of any method, the start counted
BETWEEN = 3  # stages at which gaps and guards are looked at
WINDOW_LEVELS = 26  # times that a step is halved in search of an event, and once: a dip as narrow is rounding
FUNCTIONS_MOST = 4  # that make up one guard
HANDOVER_PART = 0.01  # elastic part of lam at which a COLLISION hands over to CONTACT
STANDSTILL = 20  # switches at one instant, beside one for every row, from which on time is said not to go on
SETS = 64  # of modes that are remembered while those of friction are decided
OF_FRICTION = (
    "way", "rest", "kept_way", "kept_other", "kept_excess", "along", "slides", "off", "listed", "decides", "stands",
    "state", "wants", "begins", "since", "bare", "excess", "unknown", "size", "down", "across", "reached", "among",
    "seen", "down2", "across2", "weight", "found", "beside", "left", "press", "full", "load", "chosen", "tolerated",
    "turn_by", "bent", "turning", "turned", "pushed", "within", "slid", "left2", "part2", "share2", "loop", "drawn",
    "borne", "even", "carried", "known", "off_by", "course", "island", "packed", "calm", "spot",
    "begin_at", "end_at", "digit",
    "calm_place", "calm_size", "isle_unknowns", "isle_normals", "isle_rank", "isle_second", "isle_held", "isle_grown",
    "remains", "pivots", "taken", "root_weight", "asked", "touch_work", "touch_given",
    "touch_open", "deepest", "taken_in",
)  # fmt: skip
NEVER = 2.0  # an event's place in units of the step, when there is none

STATE = np.dtype(
    [
        # options, set once
        ("n", "i8"),  # velocities
        ("nq", "i8"),  # positions
        ("has_velocity", "i8"),  # q' is not v
        ("nc", "i8"),
        ("nu", "i8"),
        ("k", "i8"),
        ("nz", "i8"),
        ("fsm", "i8"),
        ("rule", "i8"),
        ("frozen", "i8"),  # rows with fast constants collide at one instant
        ("ng", "i8"),
        ("nd", "i8"),
        ("latched", "i8"),
        ("kinks", "i8"),  # p ends with the tolerance and the inputs in force
        ("has_solve", "i8"),
        ("constant_mass", "i8"),
        ("affine", "i8"),
        ("implicit", "i8"),
        ("natural", "i8"),
        ("ledger", "i8"),
        ("audited", "i8"),  # the energy account is closed at every step,
        ("judged", "i8"),  # and ends a run where it stays open
        ("sharing", "i8"),  # some rows may depend on each other and share a load
        ("loops", "i8"),  # rows that are always on, by the general algebra: they may lose rank on the way
        ("keep_events", "i8"),
        ("has_energy", "i8"),
        ("has_control", "i8"),
        ("has_switch", "i8"),
        ("frictional", "i8"),  # some rows in contact have friction
        ("dry", "i8"),  # and some have it by themselves, with a bound of their own
        ("friction_code", "i8"),  # where the code stands that answers for them
        ("instant_code", "i8"),  # and that which settles modes
        ("rtol", "f8"),
        ("atol", "f8"),
        ("t_end", "f8"),
        ("h_max", "f8"),
        ("tick", "f8"),
        # the run
        ("started", "i8"),
        ("unsettled", "i8"),
        ("t", "f8"),
        ("t_old", "f8"),
        ("h", "f8"),
        ("hs", "f8"),
        ("h_free", "f8"),
        ("h_active", "f8"),
        ("stop", "f8"),
        ("method", "i8"),
        ("end", "i8"),  # the stage whose derivative is that of the step's end
        ("switching", "i8"),
        ("hold_short", "i8"),
        ("na", "i8"),
        ("idle", "i8"),  # rows in contact that carry nothing: the active ones hold them
        ("dependent", "i8"),  # active rows that depend on those before them
        ("contradiction", "f8"),  # times what is allowed by which such rows are off their laws, as evaluated last
        ("lenient", "f8"),  # the most that an evaluation may find of it
        ("parting", "i8"),  # at the step's end it is more than is allowed
        ("strict", "i8"),  # no rows that stick may contradict each other where modes are decided
        ("drifts", "i8"),  # contacts that stick have been found to move: they contradict each other, however slightly
        ("barred", "i8"),  # 1 + the contact that lets go for ever as long as it may press at this instant, 0 for none
        ("redundant", "i8"),  # the most rows at one instant that follow from others
        ("have_dense", "i8"),
        ("have_mass", "i8"),
        ("have_free", "i8"),
        ("have_laws", "i8"),
        ("longest_flight", "f8"),
        ("stalled", "i8"),
        ("cautious", "i8"),  # accepted steps until the last one that was rejected is forgotten
        ("hold", "i8"),
        ("standing", "i8"),  # switches since time last went on
        ("flurry", "i8"),  # instants at which contacts switched,
        ("flurry_t", "f8"),  # since this one
        ("promised", "f8"),  # an implicit step, by the last explicit one
        ("trial_steps", "i8"),
        ("trial_rhs", "i8"),
        ("trial_t", "f8"),
        ("explicit_rate", "f8"),
        ("row_rate", "f8"),  # fastest pole of the active rows, at an explicit step's start
        ("slip_rate", "f8"),  # fastest at which friction turns slips that have begun, or that its stages show
        ("blurred", "i8"),  # the last step was so short that its stages show no rate
        ("have_jacobian", "i8"),
        ("full_jacobian", "i8"),
        ("jacobian_scale", "f8"),
        ("speed", "f8"),
        ("collision_t", "f8"),
        ("collisions_now", "i8"),
        ("unsure", "f8"),  # by how much rounding may move v', in the norm of M; as the rows were last weighed
        ("touch", "f8"),  # a gap below this is closed as far as rounding tells
        ("theta", "f8"),
        ("history", "i8"),
        ("history_t", "f8"),
        ("one_by_one", "i8"),
        ("next_input", "i8"),
        ("next_tick", "i8"),
        ("next_sample", "i8"),
        ("rows", "i8"),
        ("spoilt", "i8"),  # a row holds what is not finite
        ("events", "i8"),
        ("switches", "i8"),
        ("watched", "i8"),  # w.cones has the end of the last step
        ("jumps", "i8"),  # loads may do so at this instant, so that slips without a direction are decided anew
        ("slip_speed", "f8"),  # largest speed seen at contacts with friction
        ("unknowns", "i8"),  # of the algebra of friction: how many,
        ("normals", "i8"),  # and how many are no sticking rows
        ("rank", "i8"),
        ("dependent_rows", "i8"),
        ("short", "i8"),  # of these, rows of the system that is solved
        ("calm_dependent", "i8"),  # and those of calm islands
        ("islands", "i8"),  # of rows in contact, -1 if they have not been looked for since rows were listed,
        ("calm", "i8"),  # of which so many have nothing that slides,
        ("island", "i8"),  # and the one whose system is taken, -1 for the rest
        ("held_calm", "i8"),  # unknowns of calm islands when modes were decided
        ("calm_growth", "f8"),
        ("closed", "i8"),  # rows of loops that were eliminated before
        ("rank_first", "i8"),
        ("rank_second", "i8"),
        ("most_second", "i8"),  # at most so many were asked for
        ("spent_factors", "i8"),  # their memory has served for something else since
        ("held_unknowns", "i8"),  # when modes were decided: which sticking rows depend on others stays,
        ("held_rank", "i8"),  # of so many that do not
        ("grown", "f8"),  # the pivot at which that is decided anew,
        ("growth", "f8"),  # and what part of it the largest one is
        ("sets", "i8"),  # of modes that were tried
        ("indeterminate", "i8"),  # the law did not say how some contacts that slide share their load, and it matters,
        ("loops_press", "i8"),  # because loops hold one of them,
        ("determined_until", "f8"),  # s: from then on
        ("open_t", "f8"),  # up to when that was followed,
        ("open_way", "f8"),  # by how much it may have moved anything,
        ("open_for", "f8"),  # s: how long the present share may have done so,
        ("open_slip", "f8"),  # the fastest slip at its start,
        ("open_gain", "f8"),  # how fast a share changes any,
        ("open_lever", "f8"),  # and what of a slip that is beside the coordinates' velocities
        ("not_unique", "i8"),  # instants at which more than one set of modes was consistent,
        ("unmet", "i8"),  # instants at which sticks contradicted each other in every set that was found,
        ("unique_until", "f8"),  # s: and the first of either
        ("most_sets", "i8"),  # that are all tried to see whether another is consistent
        ("not_searched", "i8"),  # instants at which there were too many sets to see whether another was
        ("searched_until", "f8"),  # s: and the first of these
        ("push_scale", "f8"),  # size of the terms behind the rows' right-hand sides
        ("jam", "i8"),  # contacts have just come to where they jam together
        ("near_jam", "i8"),  # what has fired is that of contacts so near to a jam that their forces are not known
        ("jammed", "i8"),  # contacts that slide have passed a jam in the step just taken
        ("pressed_in", "i8"),  # a contact that jams in a set that was tried, -1 if none does
        ("leeway", "f8"),  # what accelerations of rows may be off by beyond rounding
        (
            "unsteady",
            "i8",
        ),  # a contact that would turn away from the direction in which it begins to slide, or -1
        ("energy_start", "f8"),
        ("energy_unit", "f8"),  # kinetic energy of unit velocities
        ("energy_size", "f8"),
        ("energy_open", "f8"),  # what the account misses
        ("energy_added", "f8"),  # what all steps may have added
        ("energy_allowed", "f8"),  # by how much it may be open
        ("touches_that_gained", "i8"),  # touches with friction that gave out more energy than they took in,
        ("energy_gained", "f8"),  # J: and by how much in all
        ("starts_inside", "i8"),  # touches with friction that began below the surface, which gave out
        ("energy_handed", "f8"),  # J: from there
        # counters
        ("steps", "i8"),
        ("rejected", "i8"),
        ("rhs", "i8"),
        ("implicit_steps", "i8"),
        ("exact_steps", "i8"),
        ("factorisations", "i8"),
        ("collisions", "i8"),
        ("guards", "i8"),
        ("dropped", "i8"),
    ]
)


class Model:
    """A system as the compiled code sees it."""

    p: Floats
    alpha: Floats2  # (nc, 3) a0, a1, a2
    beta: Floats2  # (nc, 3) the fast constants; a0 = 0 where the row has none
    unilateral: Bytes
    follows: Index  # the row whose activity this row shares; -1 for none
    span: Index2  # (nc, 2) first column, and one past the last, of each row of H, in whole blocks of M,
    trees: Index2  # and in whole trees of what M couples
    above: Index  # nearest lower coordinate that M couples each one to; -1 for none
    friction: Floats  # (nc,) coefficient of each normal row; of one with dry friction of its own the bound itself
    tangent: Index  # (nc,) its first tangential row, of one with dry friction itself,
    tangents: Index  # and how many there are, one behind the other; 0 without friction
    drift: Floats  # (nc,) velocity of a surface along a tangential row


class Buffers:
    """What Python and the loop share besides the workspace."""

    inputs_t: Floats
    inputs_u: Floats2
    samples: Floats
    mode: Bytes
    history: Bytes2  # mode sets seen at one instant; the last line marks the rows that changed
    out: Floats2
    modes: Bytes2
    events_t: Floats
    events: Index2
    impulses: Floats
    switches_t: Floats
    switches: Index2


class Work:
    """The workspace."""

    y: Floats  # (nq + n,) q and v
    y1: Floats
    ys: Floats
    k: Floats2  # (16, nq + n) stage derivatives
    F: Floats2  # (7, nq + n) dense output
    atol: Floats  # (nq + n,) absolute tolerances
    z: Floats  # (nz,) ledger: work of every row, of the inputs, of the damping
    z1: Floats
    kz: Floats2  # (16, nz)
    Fz: Floats2  # (7, nz)
    e: Floats  # (2,)
    u: Floats
    s: Floats  # controller state
    M: Floats2  # (n, k)
    L: Floats2  # (n, k) factors of M, 1/D on the diagonal
    f: Floats
    w: Floats
    H: Floats2  # (nc, n) active rows, compact
    X: Floats2  # (nc, n) M^-1 H^T, transposed
    right: Floats2  # (n, nc) H^T of active rows, and
    solved: Floats2  # (n, nc) M^-1 H^T, where they are solved at once
    X0: Floats2  # (nc, n) M^-1 H^T at the step's start, of the rows that are always on
    pivot0: Floats  # (nc,) their pivots at the start
    overlap: Floats2  # (nc, nc) H_1 M_0^-1 H_0^T
    G: Floats2  # (nc, nc)
    Hdv: Floats
    r: Floats
    scale: Floats  # size of the terms behind each row's right-hand side
    noise: Floats  # (nc,) what rounding alone may make of each multiplier
    own_noise: Floats  # (nc,) that of the active rows, while another one is tried beside them
    pull: Floats  # (n,) sum of |H^T lam|, term by term, of active rows as they were last weighed
    shift: Floats  # (n,) likewise of |M^-1 H^T lam|
    ha: Floats  # active rows, compact: gap, rate, multiplier
    hda: Floats
    la: Floats
    vd: Floats
    free: Floats  # (n,) M^-1 f of an affine scene: constant between inputs
    law: Floats2  # (nc, 3) in force now; written where the modes are, and nowhere else
    null: Floats2  # (nc, nc) multipliers that together exert nothing, of active rows that depend on each other
    gram: Floats2  # (nc, nc) H M^-1 H^T of all rows in contact
    part: Floats2  # (nc, nc) factor of that of the rows which carry
    share: Floats  # (nc,) what each of them carries
    trial: Floats  # (nc,) what it would carry without bounds
    allowed: Floats  # (nc,) by how much a row may be off its law
    let_go: Floats  # (nc,) instant at which others lifted a row off that shared a load with them, or friction let it go
    lam: Floats  # (nc,) of all rows at the last evaluation
    lam0: Floats  # at the step's start
    lam_at: Floats2  # (12, nc) multipliers at the stages, 0 left out
    slip_at: Floats2  # (12, nc) slips along their directions of reference, likewise; empty without friction
    gap_at: Floats2  # (3, nc) gaps at three of the stages
    gap: Floats
    rate: Floats
    gaps: Floats2  # (5, nc) at the nodes of the step
    rates: Floats2
    lams: Floats2
    peak: Floats  # (nc,) where in the step each multiplier is largest; NEVER if at an end, or lower than before
    highest: Floats  # (nc,) largest multiplier of the present contact that is written down
    hit: Floats  # (nc,) where in the step each contact switches
    J: Floats2  # (n, n)
    Jq: Floats2
    Jv: Floats2
    d: Floats
    g: Floats
    discrete: Floats  # (nd,) discrete variables before a switch
    guard: Floats  # (ng,) guards of the discrete variables
    guard_at: Floats2  # (3, ng) at three of the stages
    guards: Floats2  # (5, ng) at the nodes of the step
    guard_hit: Floats
    window: Floats2  # (26, 33) intervals of a search, each half of the one before: functions, bounds, slopes
    parts: Floats  # (4,) functions of a guard
    bands: Floats  # (4,) below which they count as zero
    tiny: Floats  # (4,) closer than which they are not told apart
    order: Index  # (nc,) rows as they are listed: of those that depend on each other the most independent ones first
    idx: Index  # active rows
    reach: Index  # first column of each row of the Schur complement's factor
    ends: Index  # largest column past an active row and all before it
    struck: Index  # (nc,) how each row takes part in a frozen collision
    before: Bytes  # modes before a switch
    settled: Bytes  # modes that rows left in the last pass
    shares: Bytes  # rows that may depend on others
    idle_rows: Bytes  # rows in contact that carry nothing
    tied: Bytes  # open rows that depend on the active ones, as far as they were asked
    spent: Bytes  # rows that share a load and whose multiplier has just vanished
    carries: Bytes  # places of a smallest set of rows that carries the load
    holds: Bytes  # these rows
    gained: Floats  # (nc,) speed that what drives a row's trees gives while rows with friction return to their laws
    kind: Index  # (nc,) which guard fired
    pivot: Index
    # Where q' is not v, and empty elsewhere:
    tangent: Floats2  # (nq, n) N of q' = N v + r, at the step's start
    stage_v: Floats2  # (6, n) v at the stages of a method without a dense output of its own
    travel: Floats  # (n,) integral of v over such a step
    bend: Floats2  # (2, nq) q'' at both its ends
    place: Floats  # (nq,) a stage's position without its own part; scratch
    turn: Floats  # (nq,) scratch
    slip: Floats  # (n,) scratch
    # Where contacts have friction, and empty elsewhere:
    way: Floats  # (nc,) by tangential row: direction of slip of reference
    rest: Floats  # (nc,) slip velocity with which one began that counted as none, until it is far faster
    kept_way: Floats
    kept_other: Floats
    kept_excess: Floats
    borne: Floats  # (nc,) by place: multipliers on the way to those of a set
    along: Floats  # (nc,) by place: direction of slip
    slides: Bytes  # rows of contacts that slide
    off: Bytes  # rows that are left out while modes are decided
    listed: Index  # where each row stands among those in contact
    decides: Bytes  # rows on which the search for modes decides
    stands: Bytes  # contacts without a slip velocity
    state: Bytes  # mode that is tried
    wants: Bytes  # mode that each contact would rather have
    sets: Bytes2  # (64, nc) sets that were tried
    begins: Bytes  # contacts that have reached their bounds at this instant
    digit: Bytes  # which of the modes that a contact may have is tried
    since: Floats  # (nc,) instant since which a slip has just begun, at w.rest; -inf for one like any other
    cones: Floats2  # (5, nc) at the nodes of the step: how far a contact is from sliding, or one that slides from a jam
    bare: Floats  # (nc,) right-hand sides without what pulls sticking rows back
    excess: Floats  # (nc,) by how much faster than its law each row moves
    unknown: Index  # places that are solved for, sticking rows last
    size: Floats  # their sizes
    matrix: Floats2  # the system that is solved, and its factors
    down: Index
    across: Index
    reached: Bytes  # places of rows that bear on each other,
    among: Index  # the unknowns among them,
    seen: Bytes  # and what is counted of these; scratch
    first: Floats2  # the same of the normal rows alone,
    second: Floats2  # and of what they leave of the sticking ones
    down2: Index
    across2: Index
    held: Floats2  # what couples both
    square: Floats2  # scratch
    weight: Floats
    even: Floats
    found: Floats
    known: Floats
    off_by: Floats
    beside: Floats
    left: Floats
    press: Floats
    full: Floats  # (nc,) right-hand sides with what pulls back those that are tried to stick,
    load: Floats  # and their multipliers
    chosen: Floats  # excess of the set that was found first
    tolerated: Floats  # by how much a force may be beyond its bound where modes are decided
    turns: (
        Floats2  # how accelerations across contacts that begin to slide change with their directions, and its factors
    )
    turn_by: Floats  # by how much each turns, or what it makes of multipliers
    bent: Floats  # by how much the direction of a sliding contact turns with the rate of its tangential row
    turning: Index  # their places
    turned: Index  # pivots
    course: Floats  # (nc,) angle of a slip where it was last clear of zero, or first known; inf before
    within: Floats  # (nc,) instant since which a contact slides without a direction; inf for one that has one
    slid: Bytes  # contacts that slide before modes are decided
    left2: Floats  # bounds of sticking rows,
    part2: Floats  # what they bear of them,
    share2: Floats  # and weights by which their loads are shared
    open_v: Floats  # (n,) by how much velocities may differ for what shares of loads did before,
    open_rate: Floats  # and accelerations by those of now
    pushed: Floats  # (nc,) right-hand sides less what forces of rows do that slide with a bound of their own
    loop: Index  # places of rows of loops,
    closing: Floats2  # the factor L of G = L L^T of these,
    carried: Floats  # (nc,) what a tangential row is asked for that nothing can hold
    led: Floats2  # L^-1 G of these and all others, by columns,
    drawn: Floats  # and L^-1 of their right-hand sides
    root: Index  # (n,) by coordinate: a lower one that rows in contact let it move with
    slid_on: Bytes  # (n,) whether anything slides in the island of a coordinate
    island: Index  # (nc,) by place: the lowest coordinate of its island
    packed: Index  # places by islands,
    begin: Index  # (nc + 1,) where each begins,
    begin_at: Index  # its first coordinate,
    end_at: Index  # and one past the last,
    calm: Bytes  # and by place whether it is one in which nothing slides
    spot: Index  # by place of a normal row: where it stands among the unknowns of its system
    calm_place: Index  # places of the unknowns of calm islands,
    calm_size: Floats  # and their sizes
    isle_unknowns: Index  # by calm island: how many unknowns it has,
    isle_normals: Index  # that are no sticking rows,
    isle_rank: Index  # that are independent,
    isle_second: Index  # and sticking ones that are,
    isle_held: Index  # when modes were decided,
    isle_grown: Floats  # and from which pivot on that is decided anew
    remains: Floats  # what is left of a diagonal
    ldl: Floats2  # L of A = L D L^T of calm islands, by columns,
    pivots: Floats  # D,
    taken: Index  # which unknown each pivot is of,
    small: Floats2  # and factors of L^T L
    root_weight: Floats  # square roots of weights,
    asked: Floats  # and what sticking rows are asked for where they are shared
    touch_work: Floats  # (nc,) z of a contact where its touch began; inf where it does not touch
    touch_given: Floats  # what its depth may hand out then,
    touch_open: Floats  # what steps had added by then,
    deepest: Floats  # the lowest gap since,
    taken_in: Floats  # and how much energy it had taken in by then


MODEL, BUFFERS, WORK = bundle_type(Model), bundle_type(Buffers), bundle_type(Work)
KERNELS = FunctionsType("Kernels", tuple((name, kernels.function_type(name)) for name in kernels.NAMES))
open_model, open_buffers, open_work, open_kernels = opener(MODEL), opener(BUFFERS), opener(WORK), opener(KERNELS)


def workspace(
    n: int, nq: int, has_velocity: bool, nc: int, nu: int, k: int, nz: int, ns: int, nw: int, ng: int, nd: int,
    frictional: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Allocate the workspace: one array a field of `Work`, in its order."""
    ny, turns, sliding = nq + n, int(has_velocity), nc * frictional
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("y", "y1", "ys", "atol"), (ny,)), "k": (DENSE_STAGES, ny), "F": (DENSE_TERMS, ny),
        "tangent": (turns * nq, n), "stage_v": (6 * turns, n), "bend": (2 * turns, nq),
        **dict.fromkeys(("place", "turn"), (turns * nq,)),
        **dict.fromkeys(("open_v", "open_rate"), (frictional * n,)), "slip": (turns * n,),
        "travel": (max(turns, frictional) * n,),
        "z": (nz,), "z1": (nz,), "kz": (DENSE_STAGES, nz), "Fz": (DENSE_TERMS, nz),
        "e": (2,), "u": (nu,), "s": (ns,), "w": (nw,),
        "M": (n, k), "L": (n, k), "H": (nc, n), "X": (nc, n), "X0": (nc, n),
        **dict.fromkeys(("right", "solved"), (n, nc)),
        **dict.fromkeys(("G", "overlap", "null", "gram", "part"), (nc, nc)), "law": (nc, 3),
        **dict.fromkeys(("f", "vd", "free", "d", "g", "pivot", "pull", "shift"), (n,)),
        **dict.fromkeys(("J", "Jq", "Jv"), (n, n)),
        **dict.fromkeys(("gaps", "rates", "lams"), (NODES, nc)),
        "lam_at": (STAGES_MOST, nc), "slip_at": (STAGES_MOST * frictional, nc),
        "gap_at": (BETWEEN, nc), "guard_at": (BETWEEN, ng),
        "window": (WINDOW_LEVELS, FUNCTIONS_MOST * (NODES + 2) + NODES),
        **dict.fromkeys(("parts", "bands", "tiny"), (FUNCTIONS_MOST,)),
        **dict.fromkeys(("guard", "guard_hit"), (ng,)),
        "guards": (NODES, ng), "discrete": (nd,), "sets": (SETS * frictional, nc), "cones": (NODES * frictional, nc),
        **dict.fromkeys(OF_FRICTION, (sliding,)),
        **dict.fromkeys(("root", "slid_on"), (frictional * n,)), "begin": (sliding + 1,),
        **dict.fromkeys(
            ("matrix", "first", "second", "held", "square", "turns", "closing", "led", "ldl", "small"),
            (sliding, sliding)),
    }  # fmt: skip
    types = {"Index": np.int64, "Bytes": np.int8}
    return {
        name: np.zeros(shapes.get(name, (nc,)), dtype=types.get(kind, np.float64))
        for name, kind in Work.__annotations__.items()
    }
