"""The picture of the README, from a real run: `make picture` writes docs/ball.svg."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from scipy.interpolate import CubicHermiteSpline

from crossbody import cases, engines

RUNS = {
    "reference": ("reference", "compiled", "-"),
    "MuJoCo matched": ("mujoco", "matched", "--"),
    "MuJoCo default": ("mujoco", "default", "-."),
    "Pinocchio law": ("pinocchio", "law", (0, (4, 1, 1, 1, 1, 1))),
    "Pinocchio impulse": ("pinocchio", "impulse", ":"),
}


def main() -> None:
    """Run, draw, write."""
    mpl.rcParams["svg.hashsalt"] = "crossbody"  # the same file from the same numbers
    case, reference = cases.load("bouncing_ball", t_end=2.0), engines.load("reference")
    grid = np.linspace(0.0, case.t_end, 801)
    truth = reference.prepare(case, "compiled", rtol=1e-13, samples=grid).run().q[:, 0]
    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(8, 5), height_ratios=(3, 2), layout="constrained")
    for label, (engine, profile, dash) in RUNS.items():
        if engine == "reference":
            height = reference.prepare(case, profile, samples=grid).run().q[:, 0]
        else:
            run = engines.load(engine).prepare(case, profile).run()
            t, rows = np.unique(run.t, return_index=True)
            height = CubicHermiteSpline(t, run.q[rows, 0], run.v[rows, 0])(grid)
        above.plot(grid, height, linestyle=dash, label=label)
        below.semilogy(grid, np.maximum(np.abs(height - truth), 1e-16), linestyle=dash)
    above.set(ylabel="height [m]", title="One bouncing ball, the same law asked of every engine")
    below.set(ylabel="|height - truth| [m]", xlabel="time [s]", ylim=(1e-14, 3.0))
    above.legend(frameon=False)
    for axes in (above, below):
        axes.grid(alpha=0.3)
    figure.savefig(Path(__file__).with_name("ball.svg"), metadata={"Date": None})


if __name__ == "__main__":
    main()
