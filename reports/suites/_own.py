"""The stress suites of crossbody itself, a family a row: cases, axes and what is asked of the reference on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from crossbody.reports.suites import _scenes as scenes
from crossbody.reports.suites.axis import Axis, Levels, Linear, Log, Whole, decades
from crossbody.reports.suites.contract import TIGHT, Family, Ladder, Suite

ball = partial(Family, case="bouncing_ball", variant="linear", scene=scenes.damped)
cubic = partial(Family, case="bouncing_ball", variant="listing")
sliders = partial(Family, case="newtons_cradle", variant="sliders")
pendulums = partial(Family, case="newtons_cradle", variant="pendulums")
box = partial(Family, case="red_body")
maze = partial(Family, case="ball_maze")

STIFFNESS = Ladder(rtol=(1e-4, 1e-6, 1e-8, 1e-10, 1e-12), dt=(1e-2, 3e-3, 1e-3, 3e-4, 1e-4))
FINE = Ladder(rtol=(1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
              dt=(1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5))  # fmt: skip
RULES = Levels(("sequential", "simultaneous"))
GAPS = Levels((0.0, 1e-3))
IMPACT = {"gravity": 0.0, "height": 0.0, "a2": 0.0, "t_end": 100.0}
LAW: dict[str, Axis] = {"a0": Log(1.0, 1e12), "mass": Log(1e-6, 1e6), "speed": Log(1e-6, 1e3)}
FALL: dict[str, Axis] = {
    "drop": Log(1e-5, 1e-1), "tilt": Linear(-0.6, 0.6), "spin": Linear(-5.0, 5.0),
    "speed_x": Linear(-1.0, 1.0), "speed_y": Linear(-2.0, 0.0), "mass": Log(1e-1, 1e1),
    "slab_tilt": Linear(-0.05, 0.05), "zeta3": Linear(0.0, 2.0), "zeta4": Linear(0.0, 2.0),
    "zeta5": Linear(0.0, 2.0),
}  # fmt: skip
CORNERS: dict[str, Axis] = {"zeta3": Linear(0.0, 2.0), "zeta4": Linear(0.0, 2.0)}
LEVEL = {"tilt": 0.0, "spin": 0.0}
ANYWHERE: dict[str, Axis] = {
    "angle": Linear(-0.6, 0.6), "theta": Linear(0.0, 2.0 * math.pi), "rings": Whole(1, 50),
}  # fmt: skip
ROLLING = {"rolling": Levels((True, False))}
SIZES = [10.0**k for k in range(-12, -2)]

SUITES: Mapping[str, Suite] = {
    "balls": Suite(
        about="Rows of up to 200 balls, touching and apart.", runs=8,
        families=(
            sliders(scene=scenes.lifted, axes={"n": Whole(2, 200)}, grid={"gap": GAPS, "collisions": RULES},
                    time_limit=4.0, share=4),
            sliders(scene=scenes.lifted, axes={"n": Whole(2, 12), "zeta": Linear(0.0, 1.0)}, grid={"gap": GAPS},
                    time_limit=4.0, share=8),
            sliders(axes={"n": Whole(2, 60), "zeta": Linear(0.0, 0.5)}, time_limit=4.0,
                    fixed={"collisions": "resolved", "gap": 5e-3}),
        ),
    ),
    "bounces": Suite(
        about="Up to 1e5 bounces of one ball in a run.", runs=1, engines=("reference:compiled",),
        families=(
            ball(scene=scenes.bouncing_on, ladder=TIGHT, max_steps=2_000_000, time_limit=60.0,
                 axes={"bounces": Log(1e1, 1e5), "height": Log(1e-2, 1e1), "a0": Log(1e6, 1e12)}),
        ),
    ),
    "cubic": Suite(
        about="Floors with a cubic term up to 1e12 1/(m^2 s^2), compared with an independent integrator.",
        runs=120,
        families=(
            cubic(scene=scenes.damped, second=5, fixed={"t_end": 2.0},
                  axes={"a0": Log(1.0, 1e8), "zeta": Log(1e-2, 10.0), "a2": Log(1.0, 1e12), "mass": Log(1e-6, 1e6),
                        "height": Log(1e-3, 1e1), "speed": Linear(0.0, 5.0)}),
        ),
    ),
    "damping": Suite(
        about="One impact without gravity, damping ratio 0 to 10 and stiffness 1 to 1e12 1/s^2: end states in closed "
        "form.",
        runs=1400,
        families=(
            ball(ends=True, fixed=IMPACT, axes={**LAW, "zeta": Linear(0.0, 10.0)}),
            ball(ends=True, fixed=IMPACT, axes={**LAW, "zeta": Log(1e-8, 1.0)}),
            ball(ends=True, fixed=IMPACT, axes=LAW, grid={"zeta": Levels((0.0, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.0))}),
        ),
    ),
    # A hard floor that damps little is bounced on more often than any bound allows. A ball that hardly falls comes to
    # rest 1e-10 m deep: a relative error of 1e-6 there asks for an absolute tolerance below the default 1e-12 m.
    "drops": Suite(
        about="Drops under gravity on linear floors of any stiffness, damping, mass and speed: bounces, captures and "
        "rest.",
        runs=500,
        families=(
            ball(axes={"a0": Log(1.0, 1e12), "zeta": Log(1e-3, 10.0), "mass": Log(1e-6, 1e6), "height": Log(1e-6, 1e1),
                       "gravity": Log(1e-3, 1e3), "speed": Linear(-5.0, 5.0)},
                 fixed={"t_end": 1.0}, max_steps=500_000, finishes=False),
            ball(ends=True, share=12, ladder=TIGHT, fixed={"t_end": 1.0},
                 axes={"a0": LAW["a0"], "zeta": Linear(0.5, 10.0), **LAW},
                 grid={"gravity": Levels((9.81,)), "height": Levels((0.0, 0.1))}),
            ball(fixed={"t_end": 0.5}, share=12,
                 axes={"a0": Log(1.0, 1e12), "zeta": Linear(0.0, 2.0), "height": Linear(-0.1, 0.0),
                       "speed": Linear(-1, 1)}),
        ),
    ),
    # Balls that overlap leave at nearly the same speed, and when they meet again is known the worse for it.
    "gap": Suite(
        about="Gaps between neighbours from 0 to 0.1 m, from overlapping collisions to collisions one by one.",
        runs=160,
        families=(
            sliders(scene=scenes.lifted, grid={"collisions": RULES},
                    axes={"n": Whole(2, 10), "gap": Log(1e-9, 1e-1), "speed": Log(1e-3, 1e2)}),
            sliders(scene=scenes.lifted, fixed={"collisions": "resolved"}, second=20, ladder=TIGHT,
                    axes={"n": Whole(2, 7), "gap": Log(1e-9, 1e-1), "a0": Log(1e4, 1e8), "zeta": Linear(0.0, 1.0)}),
            pendulums(scene=scenes.lifted, second=20, fixed={"t_end": 1.5},
                      axes={"n": Whole(2, 5), "gap": Log(1e-6, 1e-1), "angle": Linear(-1.0, -0.01)}),
        ),
    ),
    "grasp": Suite(
        about="A soft grasp with any gains, compliances and delays of its touch sensors: stable loops and unstable "
        "ones.",
        runs=16,
        families=(
            Family(case="soft_contact", variant="axis", finishes=False, second=20,
                   axes={"kstar": Linear(0.0, 60.0), "ks": Log(1e1, 1e3), "kp": Log(1e3, 1e5), "cp": Log(1.0, 1e2),
                         "block_mass": Log(1e-2, 1e1), "bt": Log(1e-1, 1e2), "offset": Linear(-0.008, 0.008)}),
        ),
    ),
    # The speed at a touch is the square root of how deep the pass would be, and an error of the swing comes out as one
    # of its square root. At passes closer than the tolerance even whether they touch is open: motions diverge there.
    "grazing": Suite(
        about="Passes that barely touch or barely miss: a pendulum whose far end of the swing is where its neighbour "
        "hangs.",
        runs=150,
        families=(
            pendulums(scene=scenes.passing, second=10, ladder=TIGHT, axes={"swing": Linear(0.05, 0.6)},
                      fixed={"radius": scenes.RADIUS, "length": scenes.LENGTH, "t_end": 1.5},
                      grid={"off": Levels((*(-size for size in SIZES), *SIZES))}),
        ),
    ),
    "impulses": Suite(
        about=("Impulses of 1e-6 to 1e4 N s on the delta robot's flange, as pulses of any length and "
            "instantaneous ones."),
        runs=12,
        families=(
            Family(case="delta_impulse", variant="light", scene=scenes.anywhere, fixed={"t_end": 0.5, "start": 0.0},
                   axes={"impulse": Log(1e-6, 1e4), "length": Log(1e-6, 1e-1)}, second=20, finishes=False),
            Family(case="delta_impulse", variant="dirac", scene=scenes.anywhere, fixed={"t_end": 0.5}, second=20,
                   axes={"impulse": Log(1e-6, 1e4)}, grid={"z": Levels((0.5, 0.6, 0.7))}, finishes=False),
        ),
    ),
    # A light ball between heavy ones collides pi sqrt(ratio) / 2 times: three and more balls stop at a ratio of 1e6.
    "mass_ratio": Suite(
        about="Rows of balls with mass ratios of up to 1e12, instantaneous collisions and collisions in real time.",
        runs=200,
        families=(
            sliders(scene=scenes.uneven, grid={"collisions": RULES, "gap": GAPS}, fixed={"n": 2},
                    axes={"ratio": Log(1.0, 1e12), "speed": Log(1e-6, 1e3)}),
            sliders(scene=scenes.uneven, grid={"collisions": RULES, "gap": GAPS},
                    axes={"n": Whole(3, 4), "ratio": Log(1.0, 1e6), "speed": Log(1e-6, 1e3)}),
            sliders(scene=scenes.uneven, fixed={"n": 2, "collisions": "resolved"}, second=10,
                    axes={"ratio": Log(1.0, 1e12), "a0": Log(1e2, 1e10), "zeta": Linear(0.0, 2.0)}),
        ),
    ),
    "modes": Suite(
        about="Boxes that land on any corner of a slab on two supports: switches in every order, and cycles of modes.",
        runs=120,
        families=(
            box(variant="resolved", axes={**FALL, "b0": Log(1e3, 1e8)}, second=20, finishes=False),
            box(variant="frozen", axes=FALL, finishes=False),
        ),
    ),
    "poses": Suite(
        about="Poses of the delta robot up to the edge of what it reaches, and singular ones on the way.",
        runs=80,
        families=(
            Family(case="delta_free", variant="light", scene=scenes.at_the_edge, fixed={"t_end": 0.3}, second=10,
                   axes={"azimuth": Linear(0.0, 2.0 * math.pi), "elevation": Linear(-1.5, 1.5), "off": Log(1e-9, 1.0)},
                   finishes=False),
            Family(case="delta_free", variant="light", fixed={"t_end": 1.0}, second=10, finishes=False,
                   axes={"x": Linear(-0.4, 0.4), "y": Linear(-0.4, 0.4), "z": Linear(0.1, 0.9)}),
        ),
    ),
    "rings": Suite(
        about="Mazes of up to 50 rings, locked and free, rolling and frictionless, from any angle.", runs=30,
        families=(
            maze(variant="inside", axes=ANYWHERE, fixed={"t_end": 0.5, "ring": 0}, second=20, grid=ROLLING),
            maze(variant="outside", axes=ANYWHERE, fixed={"t_end": 0.5, "ring": 0}, second=20, grid=ROLLING),
            maze(variant="free", axes={**ANYWHERE, "maze_inertia": Log(1e-5, 1e3)}, second=20, fixed={"t_end": 0.5}),
            maze(variant="balanced", fixed={"t_end": 1.0}, finishes=False,
                 axes={"angle": Linear(-0.4, 0.4), "wn": Log(5.0, 200.0), "pole": Log(1.0, 20.0)}),
        ),
    ),
    "simultaneous": Suite(
        about="Several contacts at one instant: touching rows of balls, and a box that lands on both corners.",
        runs=160,
        families=(
            sliders(scene=scenes.uneven, fixed={"gap": 0.0}, grid={"collisions": RULES},
                    axes={"n": Whole(3, 6), "ratio": Log(1.0, 1e2)}),
            sliders(scene=scenes.lifted, fixed={"collisions": "resolved", "gap": 0.0}, second=20,
                    axes={"n": Whole(3, 8), "a0": Log(1e4, 1e10), "zeta": Linear(0.0, 1.0)}),
            box(variant="frozen", fixed=LEVEL, axes={"drop": Log(1e-6, 1e-1), "mass": Log(1e-2, 1e2), **CORNERS}),
            box(variant="resolved", fixed=LEVEL, second=20, ladder=TIGHT,
                axes={"drop": Log(1e-6, 1e-1), "mass": Log(1e-1, 1e1), **CORNERS}),
        ),
    ),
    # At 1e-6 m/s the default absolute tolerance of 1e-12 is a millionth of all there is. A hard floor that damps little
    # is bounced on at such speeds more often than the bound on steps allows.
    "speed": Suite(
        about=("Speeds of impact from 1e-6 to 1e3 m/s, with and without gravity, around the speed below which "
            "a ball does not leave."),
        runs=560,
        families=(
            ball(fixed={"height": 0.0, "t_end": 0.5}, ladder=TIGHT, finishes=False,
                 axes={"speed": Log(1e-6, 1e3), "a0": Log(1.0, 1e12), "zeta": Linear(0.05, 2.0)},
                 grid={"gravity": Levels((0.0, 9.81))}),
            ball(scene=scenes.about_threshold, fixed={"height": 0.0, "t_end": 0.5}, ladder=TIGHT,
                 axes={"a0": Log(1e2, 1e10), "zeta": Linear(0.0, 2.0)},
                 grid={"near": Levels((0.5, 0.9, 0.99, 1.0 - 1e-6, 1.0 + 1e-6, 1.01, 1.1, 2.0))}),
            sliders(fixed={"n": 2, "collisions": "resolved"}, second=10, ladder=TIGHT,
                    axes={"speed": Log(1e-6, 1e3), "a0": Log(1.0, 1e12), "zeta": Linear(0.0, 2.0)}),
        ),
    ),
    # Its truth is exact between events and looks for them in a way of its own. Contacts of stiff walls multiply an
    # error: where the scene beside it parts from it by as much, a run is judged up to there.
    "springs_and_walls": Suite(
        about="Masses on springs near one to three walls: a touch or a release in a window of any width, somewhere "
        "in a step.",
        runs=200, engines=("reference:compiled",),
        families=(
            Family(case=str(Path(__file__).with_name("_springs_and_walls.py")), variant="outside", ladder=TIGHT,
                   axes={"n": Whole(1, 3), "walls": Whole(1, 3), "draw": Whole(0, 2**32 - 1), "a0": Log(1e2, 1e5),
                         "zeta": Linear(0.0, 1.0), "stiffness": Log(1.0, 30.0)}),
        ),
    ),
    "stiffness": Suite(
        about="Stiffness from 1 to 1e12 1/s^2 against damping, tolerance and step: the stability map of every engine.",
        runs=260, engines=("reference:compiled", "mujoco:matched", "mujoco:default", "pinocchio:law"),
        families=(
            ball(ladder=STIFFNESS, fixed={"t_end": 1.0, "height": 0.3}, max_steps=20_000,
                 grid={"a0": decades(0, 12), "zeta": Levels((0.0, 0.1, 1.0, 10.0))}),
        ),
    ),
    "tolerance": Suite(
        about="Tolerances from 1e-3 to 1e-12 and steps from 1e-2 to 1e-5 s on every case with contacts.",
        runs=70,
        families=(
            Family(case="bouncing_ball", variant="linear", ladder=FINE, fixed={"t_end": 1.0},
                   axes={"height": Linear(0.01, 0.5)}, grid={"a0": Levels((1e2, 1e4, 1e6))}),
            cubic(ladder=FINE, fixed={"t_end": 2.0}, second=10, axes={"height": Linear(0.5, 2.0)}),
            sliders(ladder=FINE, second=10, fixed={"collisions": "resolved", "n": 3}, axes={"gap": Linear(1e-4, 3e-3)}),
            pendulums(ladder=FINE, fixed={"t_end": 1.0, "n": 3}, second=10, axes={"angle": Linear(-0.8, -0.1)}),
            box(variant="resolved", ladder=FINE, axes={"drop": Linear(5e-3, 2e-2)}, second=10),
            maze(variant="inside", ladder=FINE, fixed={"t_end": 1.0}, axes={"angle": Linear(1e-3, 0.5)}, second=10),
            Family(case="delta_impulse", variant="light", ladder=FINE, fixed={"t_end": 0.5}, second=10,
                   axes={"jx": Linear(0.0, 0.06)}),
        ),
    ),
    # Servos move within a step or two here, and the energy account is a quadrature beside the motion, which sets the
    # steps.
    "torque": Suite(
        about=("Steps of torque on the delta robot: servos of any gain pulled out of place, also towards its "
            "singular pose."),
        runs=12,
        families=(
            Family(case="delta_impulse", variant="servos", fixed={"t_end": 0.5}, second=20, finishes=False,
                   axes={"kp": Log(1.0, 1e4), "kd": Log(1e-3, 1e2), "x": Linear(-0.1, 0.1), "z": Linear(0.45, 0.7)}),
            Family(case="delta_singularity", variant="light", fixed={"t_end": 2.0, "start": 1.0}, second=20,
                   finishes=False, ladder=TIGHT,
                   axes={"kp": Log(1.0, 1e4), "kd": Log(1e-2, 1e2), "ramp": Log(1e-4, 1.0),
                         "offset": Linear(-0.2, 0.2)}),
            Family(case="delta_tracking", variant="circle", fixed={"t_end": 0.3}, finishes=False,
                   axes={"radius": Linear(0.01, 0.15), "frequency": Log(0.1, 20.0), "limit": Log(1e-2, 1e2)}),
        ),
    ),
}  # fmt: skip
