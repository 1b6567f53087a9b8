"""One linear contact against its closed forms, integrated and by shortcut."""

import itertools
import math

import numpy as np
import pytest
from mechanisms import ball

from crossbody.cases import Mode, closed_forms
from crossbody.reference import simulate

SPEED, HEIGHT = 1.3, 0.01
GRID = list(itertools.product([0.02, 0.1, 0.5, 0.9, 0.999, 1.0, 1.001, 1.5, 3.0], [1e2, 1e4, 1e6, 1e8, 1e10]))


def impact(a0, zeta, shortcuts):
    """Restitution, contact time, gap at separation, depth of one impact without gravity."""
    a1 = 2.0 * zeta * math.sqrt(a0)
    time = closed_forms.contact_time(a0, a1)
    end = HEIGHT / SPEED + time + 2.0 * a1 / a0 + time
    system = ball(a0=a0, a1=a1, a2=0.0, gravity=0.0)
    run = simulate(system, [HEIGHT], [-SPEED], end, rtol=1e-13, shortcuts=shortcuts)
    touch, release = run.events[:2]
    deepest = HEIGHT / SPEED + 0.5 * time
    middle = simulate(system, [HEIGHT], [-SPEED], end, rtol=1e-13, shortcuts=shortcuts, samples=[deepest])
    at = np.searchsorted(run.t, release.t)
    return np.array([run.v[-1, 0] / SPEED, release.t - touch.t, run.gap[at, 0], -middle.gap[0, 0]])


def closed(a0, zeta):
    a1 = 2.0 * zeta * math.sqrt(a0)
    forms = closed_forms
    return np.array(
        [
            forms.restitution(zeta),
            forms.contact_time(a0, a1),
            forms.separation_gap(a0, a1, SPEED),
            forms.depth(a0, a1, SPEED),
        ]
    )


@pytest.mark.parametrize(("zeta", "a0"), GRID)
def test_integrated_impact_meets_the_closed_forms(a0, zeta):
    assert np.abs(impact(a0, zeta, False) / closed(a0, zeta) - 1.0).max() < 1e-9


@pytest.mark.parametrize(("zeta", "a0"), GRID)
def test_shortcuts_agree_with_integration(a0, zeta):
    assert np.abs(impact(a0, zeta, True) / impact(a0, zeta, False) - 1.0).max() < 1e-11


@pytest.mark.parametrize("shortcuts", [True, False])
@pytest.mark.parametrize("zeta", [0.05, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("part", [0.999, 1.001])
def test_threshold_speed_from_both_sides(zeta, part, shortcuts):
    a0 = 1e4
    a1 = 2.0 * zeta * math.sqrt(a0)
    speed = part * closed_forms.threshold_speed(a0, a1, 9.81)
    run = simulate(ball(a0=a0, a1=a1, a2=0.0), [0.0], [-speed], 1.0, rtol=1e-12, shortcuts=shortcuts)
    left = any(e.before is Mode.CONTACT for e in run.events)
    assert left == (part > 1.0)


@pytest.mark.parametrize("shortcuts", [True, False])
def test_double_pole_below_its_threshold_never_bounces(shortcuts):
    run = simulate(ball(a0=100.0, a1=20.0, a2=0.0), [1.0], [0.0], 5.0, shortcuts=shortcuts)
    assert [e.after for e in run.events] == [Mode.CONTACT]
    assert run.lam[run.mode[:, 0] == Mode.CONTACT].min() > 0.0
