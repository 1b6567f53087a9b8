"""What a mode problem ends with: motion, motions, or a jam, as the enumeration of all sets of modes has it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from friction_scenes import HALF, box_body, box_on_floor, linear, pair, run, sphere_on_floor
from mode_enumeration import Contact, enumerated

from crossbody import cases
from crossbody.cases import Outcome, Tier
from crossbody.cases.scene import Joint, RowLaw, Scene, Shape
from crossbody.reference import simulate
from crossbody.reports.judging.reach import tight
from crossbody.reports.judging.truth import truth_of
from crossbody.reports.judging.truth_row import truth_row
from crossbody.reports.measuring.truth import from_run

CLEAR = 1e-3  # m/s^2, or of a determinant: below it the law is all but undecided
CLOSING, DAMPING = 1e-3, 200.0  # m/s and 1/s, of contacts that touch


def drawn(rng: np.random.Generator, ways: int) -> tuple[Any, Any, Any, float, list[Contact]]:
    """Return rows, forces, velocities and mu of contacts that slide and stand, some pressed by friction of the next."""
    k, mu = int(rng.integers(1, 4)), float(rng.uniform(0.3, 3.0))
    rows = k * (1 + ways)
    n = rows + int(rng.integers(0, 3))
    H = rng.normal(size=(rows, n)) * 0.6 + np.eye(rows, n)
    force = rng.normal(size=n) * 2.0 - H[:k].T @ np.abs(rng.normal(size=k)) * 2.0
    slip = rng.normal(size=(k, ways))
    slip *= (rng.random(k) < 0.6)[:, None] / np.linalg.norm(slip, axis=1)[:, None]
    for i in np.flatnonzero(slip.any(axis=1)):
        H[k + ways * i : k + ways * (i + 1)] -= slip[i][:, None] * rng.uniform(0.0, 2.0) / mu * H[(i + 1) % k]
    v0 = np.linalg.lstsq(H, np.concatenate([np.full(k, -CLOSING), slip.ravel()]), rcond=None)[0]
    places = [k + ways * i + np.arange(ways) for i in range(k)]
    contacts = [Contact(i, places[i].tolist(), mu, slip[i] if slip[i].any() else None) for i in range(k)]
    return H, force, v0, mu, contacts


@pytest.mark.parametrize("solver", ["compiled", "cvode"])
@pytest.mark.parametrize("ways", [1, 2])
@pytest.mark.parametrize("seed", [3, *(pytest.param(k, marks=pytest.mark.slow) for k in (*range(3), *range(4, 40)))])
def test_a_mode_problem_ends_as_all_its_sets_have_it(seed: int, ways: int, solver: str) -> None:
    """One motion, several, or none because contacts jam: never that no set was found where there is one."""
    rng, ends = np.random.default_rng(seed), set[Outcome]()
    for _ in range(10):
        H, force, v0, mu, contacts = drawn(rng, ways)
        bare = -H @ force
        bare[: len(contacts)] += CLOSING * DAMPING
        tried = enumerated(H @ H.T, bare, contacts)
        if min(min(abs(one.margin), abs(one.jam)) for one in tried) < CLEAR:
            continue
        if any(one.margin > 0.0 and one.jam > 0.0 and one.pressing for one in tried):  # an even number of them: no jam
            continue  # that forces come to gradually, which is all that a determinant tells
        sets = {one.modes: one.excess for one in tried if one.margin > 0.0 and one.jam > 0.0}
        motions = {tuple(np.round(excess, 6)) for excess in sets.values()}  # of one set one direction is looked for
        made = linear(H, force, mu, len(contacts), a1=DAMPING)
        found = simulate(made, np.zeros(len(force)), v0, 1e-9, rtol=1e-6, max_steps=400, solver=solver)
        assert found.outcome is (Outcome.FINISHED if motions else Outcome.PAINLEVE), found.message
        assert ("not_unique" in found.counts) == (len(motions) > 1)
        assert (found.unique_until == 0.0) == (len(motions) > 1)
        ends.add(found.outcome)
    assert ends


def test_where_a_second_motion_is_not_looked_for_is_told() -> None:
    """Of four corners that stand there are too many sets; one contact of a sphere leaves no doubt."""
    start = np.zeros(6), 0.1
    box = run(box_on_floor(0.5), [0, 0, 0.1, 1, 0, 0, 0], *start)
    case = cases.from_scene(box_on_floor(0.5), q0=[0, 0, 0.1, 1, 0, 0, 0], t_end=0.1)
    (row,) = truth_row(case, replace(from_run(box, Tier.D, "itself"), allowed=1e-6), "")
    assert box.counts["not_searched"] == 1
    assert "too many contacts could change to search for a second motion" in row.why
    sphere = run(sphere_on_floor(0.5, 0.1), [0, 0, 0.1, 1, 0, 0, 0], *start)
    assert "not_searched" not in sphere.counts


def stood(*places: tuple[float, float]) -> cases.Case:
    """Boxes that fall flat: on the floor, and on the one before where they are above it; (x, z) of each."""
    names = [f"box{k}" for k in range(len(places))]
    shapes, pairs, law = [Shape(name="floor", type="plane")], [], RowLaw(a0=1e4, a1=100.0)
    for k, ((_, z), name) in enumerate(zip(places, names, strict=True)):
        shapes += [
            Shape(name=name, body=name, type="box", size=HALF),
            Shape(name=f"{name} top", body=name, type="plane", position=(0.0, 0.0, HALF[2])),
        ]
        pairs.append(pair(f"box{k - 1} top" if z > 2.0 * HALF[2] else "floor", name, 0.5, law))
    scene = Scene(
        bodies=tuple(box_body(name, HALF) for name in names), shapes=tuple(shapes), pairs=tuple(pairs),
        joints=tuple(Joint(name=name, body=name, type="free") for name in names),
    )  # fmt: skip
    return cases.from_scene(scene, q0=np.concatenate([[x, 0, z, 1, 0, 0, 0] for x, z in places]), t_end=0.03)


def test_a_truth_looks_for_a_second_motion_further_than_a_run_and_ends_where_it_cannot() -> None:
    """Four corners have 256 sets, those of each of two boxes apart as well; eight that act on each other 65536."""
    above = HALF[2] + 1e-3
    beside, piled = stood((0.0, above), (1.0, above)), stood((0.0, above), (0.0, above + 2.0 * HALF[2] + 1e-3))
    assert tight(beside).searched_until == np.inf
    cut = truth_of(piled)
    assert cut.horizon is not None
    assert cut.horizon.until == cut.trajectory.searched_until < 0.03
    assert "too many contacts" in cut.horizon.why


def test_what_switches_for_ever_is_named() -> None:
    """A can without friction lies on a box that rubs; whether its rows jam is asked too, which must not forget them."""
    law, bodies = RowLaw(a0=2e4, a1=50.0), (box_body("box", HALF), box_body("can", HALF))
    scene = Scene(
        bodies=bodies, joints=tuple(Joint(name=body.name, body=body.name, type="free") for body in bodies),
        shapes=(
            Shape(name="floor", type="plane"), Shape(name="box", body="box", type="box", size=HALF),
            Shape(name="top", body="box", type="plane", position=(0.0, 0.0, 0.1)),
            Shape(name="can", body="can", type="cylinder", size=(0.15, 0.1, 0.0)),
        ),
        pairs=(pair("floor", "box", 0.9, law), pair("top", "can", 0.0, law)),
    )  # fmt: skip
    box, can = [0.0, 0.0, 0.0905, 1.0, 4.1e-4, -5.1e-4, 8e-5], [-1.1e-4, -9e-5, 0.2904, 1.0, -4e-5, -4e-4, -5e-5]
    v0 = [-0.01, 0.03, 0.11, -0.04, -0.03, -0.07, -0.11, -0.04, 0.14, -0.02, 0.1, -0.02]
    found = run(scene, [*box, *can], v0, 0.01, rtol=1e-6, max_steps=3000)
    assert "Rows []" not in found.message
    assert found.outcome is not Outcome.MODE_CYCLE or "Rows [9]" in found.message  # the can's, at its second place
