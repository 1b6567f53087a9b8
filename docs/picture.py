"""The figures of the pages, from the commands on them: `make picture` writes docs/ball.svg and docs/figures.

`python docs/picture.py rig stress` draws some. A figure is white paper, so that it is read on light and on dark pages.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from textwrap import wrap
from xml.sax.saxutils import escape

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator
from scipy.interpolate import CubicHermiteSpline

from crossbody import cases, engines
from crossbody.cases import Mode, installed
from crossbody.cases.contacts import contacts as touching

DOCS = Path(__file__).parent
FIGURES = DOCS / "figures"
COLUMNS = 108
"""Widest line of a picture of a terminal, characters."""
RUNS = {
    "reference": ("reference", "compiled", "-"),
    "MuJoCo matched": ("mujoco", "matched", "--"),
    "MuJoCo default": ("mujoco", "default", "-."),
    "Pinocchio law": ("pinocchio", "law", (0, (4, 1, 1, 1, 1, 1))),
    "Pinocchio impulse": ("pinocchio", "impulse", ":"),
}
DRAWN: dict[str, Callable[[], None]] = {}
"""Page -> what draws its figure in a folder that has the files of the page."""


def drawn(draw: Callable[[], None]) -> Callable[[], None]:
    """Have the figure of a page called like the function drawn."""
    DRAWN[draw.__name__.replace("_", "-")] = draw
    return draw


def sh(*commands: str, codes: Sequence[int] = (0,)) -> str:
    """Run commands as a reader would type them; what they print."""
    said = ""
    for command in commands:
        words = shlex.split(command)
        program = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"] if words[0] == "pytest" else [
            str(Path(sys.executable).with_name(words[0]))
        ]  # fmt: skip
        done = subprocess.run([*program, *words[1:]], capture_output=True, text=True, check=False)
        assert done.returncode in codes, done.stderr
        said += f"$ {command}\n{done.stdout}{done.stderr if done.returncode == 0 else ''}"
    return re.sub(r"\S*" + re.escape(str(Path.cwd())) + "/", "", said)


def terminal(text: str, lines: int = 40) -> None:
    """Write what was printed as a picture: long lines folded, and of many the first and the last."""
    rows = [part for row in text.rstrip().splitlines() for part in wrap(row, COLUMNS, subsequent_indent="    ") or [""]]
    rows = rows if len(rows) <= lines else [*rows[: lines - 2], "…", rows[-1]]
    wide, tall = 7.25 * max(map(len, rows)) + 24, 16 * len(rows) + 20
    told = "".join(
        f'<tspan x="12" y="{24 + 16 * i}"{" font-weight=" + chr(34) + "bold" + chr(34) if row.startswith("$") else ""}>'
        f"{escape(row)}</tspan>"
        for i, row in enumerate(rows)
    )
    write(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {tall}" width="{wide:.0f}" height="{tall}">'
        f'<rect width="100%" height="100%" rx="6" fill="#f6f8fa" stroke="#d0d7de"/><text xml:space="preserve" '
        f'font-family="ui-monospace, Menlo, Consolas, monospace" font-size="12" fill="#1f2328">{told}</text></svg>\n'
    )


def write(text: str) -> None:
    """Leave the figure of this page."""
    Path("figure.svg").write_text(text, encoding="utf-8")


def plots(rows: int = 1, cols: int = 1, **more: object) -> tuple[plt.Figure, np.ndarray]:
    """Open a figure of small plots."""
    more = {"figsize": (8, 1.2 + 2.3 * rows), "layout": "constrained", "squeeze": False} | more
    figure, axes = plt.subplots(rows, cols, **more)
    for one in axes.ravel():
        one.grid(alpha=0.3)
    return figure, axes


def save(figure: plt.Figure, to: str | Path = "figure.svg") -> None:
    """Write a figure; the same file from the same numbers."""
    figure.savefig(to, metadata={"Date": None})
    plt.close(figure)
    if Path(to).suffix == ".svg":  # hundredths of a point are enough in tags
        short = r"<!--.*?-->|(?<=\d\.\d\d)\d+(?=[^<>]*>)|^ +|; stroke-linecap: square| transform=\"rotate\(-0 [^\"]*\""
        text = re.sub(short, "", Path(to).read_text(encoding="utf-8"), flags=re.MULTILINE)
        Path(to).write_text(re.sub(r"\n+", "\n", text), encoding="utf-8")


def fine(run: cases.Trajectory, t: np.ndarray, k: int = 0) -> np.ndarray:
    """Positions between the rows of a run."""
    at, rows = np.unique(run.t, return_index=True)
    return CubicHermiteSpline(at, run.q[rows, k], run.v[rows, k])(t)


def shade(axes: Axes, run: cases.Trajectory) -> None:
    """Shade when the first contact touches and when it flies below the surface."""
    for k, (mode, colour) in enumerate({Mode.CONTACT: "#0072B2", Mode.BALLISTIC: "#E69F00"}.items()):
        axes.fill_between(run.t, 0, 1, where=run.mode[:, 0] == mode, transform=axes.get_xaxis_transform(), alpha=0.2,
                          color=colour, label=mode.name, lw=0, step="post", zorder=-k)  # fmt: skip


def ball() -> None:
    """Draw the bouncing ball of the first page in five engines."""
    case, reference = cases.load("bouncing_ball", t_end=2.0), engines.load("reference")
    grid = np.linspace(0.0, case.t_end, 801)
    truth = reference.prepare(case, "compiled", rtol=1e-13, samples=grid).run().q[:, 0]
    figure, axes = plots(2, sharex=True, figsize=(8, 5), height_ratios=(3, 2))
    above, below = axes[:, 0]
    for label, (engine, profile, dash) in RUNS.items():
        if engine == "reference":
            height = reference.prepare(case, profile, samples=grid).run().q[:, 0]
        else:
            height = fine(engines.load(engine).prepare(case, profile).run(), grid)
        above.plot(grid, height, linestyle=dash, label=label)
        below.semilogy(grid, np.maximum(np.abs(height - truth), 1e-16), linestyle=dash)
    above.set(ylabel="height [m]", title="One bouncing ball, the same law asked of every engine")
    below.set(ylabel="|height - truth| [m]", xlabel="time [s]", ylim=(1e-14, 3.0))
    above.legend(frameon=False)
    save(figure, DOCS / "ball.svg")


@drawn
def tutorial() -> None:
    """Height and force of the first bounce, and its modes."""
    case = cases.load("bouncing_ball", "linear", t_end=0.6)
    run = engines.load("reference").prepare(case, samples=np.linspace(0.44, 0.5, 240)).run()
    figure, axes = plots(2, sharex=True)
    for one, values, name in zip(
        axes[:, 0], (run.q[:, 0], run.lam[:, 0]), ("height [m]", "force lam [N]"), strict=True
    ):
        one.plot(run.t, values, color="black", lw=1.2)
        one.set(ylabel=name)
        shade(one, run)
    axes[0, 0].legend(frameon=False, loc="upper center")
    axes[1, 0].set(xlabel="time [s]")
    save(figure)


@drawn
def robot_file() -> None:
    """The cart, drawn by the command itself."""
    sh("crossbody run cart.py --variant short -e reference:compiled --out cart -q",
       "crossbody picture cart cart.svg --at 0.35 -q")  # fmt: skip
    write(Path("cart.svg").read_text(encoding="utf-8"))


@drawn
def report() -> None:
    """The ball in its first contact, drawn by the command itself."""
    sh("crossbody run bouncing_ball --variant linear -e reference:compiled --out ball -q",
       "crossbody picture ball ball.svg --at 0.46 -q")  # fmt: skip
    write(Path("ball.svg").read_text(encoding="utf-8"))


@drawn
def audit() -> None:
    """What the command prints of a file that one reader takes for another robot."""
    terminal(sh("crossbody audit arm.xml -e mujoco -e pinocchio", codes=(1,)))


@drawn
def outside() -> None:
    """What a run prints that is outside."""
    asked = "crossbody run bouncing_ball --variant linear -e mujoco:matched --set-engine dt=4e-3 --out ball"
    terminal(sh(asked, codes=(1,)))


@drawn
def pytest() -> None:
    """One test for every limit."""
    Path("test_ball.py").unlink()  # which stands on the page too
    terminal(
        sh("pytest --crossbody-case bouncing_ball:linear --crossbody-engine reference:compiled -v --no-header"), 24
    )


@drawn
def ci() -> None:
    """What a run prints in the log of a CI."""
    terminal(sh("crossbody run bouncing_ball --variant linear -e reference:compiled -e mujoco --out report"))


@drawn
def log_format() -> None:
    """What is seen in a log of the new format."""
    t = np.arange(500) * 1e-3
    np.savez("swing.npz", t=t, angle=np.rad2deg(np.sin(t)))
    terminal(sh("crossbody log info swing.npz --columns swing.toml --plugin npz.py"))


@drawn
def cache() -> None:
    """What the first run of an installation says while it compiles, and what is kept."""
    os.environ["CROSSBODY_CACHE"] = "cache"
    try:
        command, said, *rest = sh("crossbody run bouncing_ball --variant listing -e reference:compiled").splitlines()
        counted = [row for row in rest if "compiling the reference" in row]
        terminal("\n".join([command, counted[0], "…", counted[-1], said, "…", sh("crossbody cache")]))
    finally:
        del os.environ["CROSSBODY_CACHE"]


@drawn
def case() -> None:
    """The pendulum at its wall."""
    run = engines.load("reference").prepare(cases.load("wall_pendulum.py"), samples=np.linspace(0, 2, 500)).run()
    figure, axes = plots(2, sharex=True)
    for one, values, name in zip(
        axes[:, 0], (run.q[:, 0], run.lam[:, 0]), ("angle [rad]", "force lam [N]"), strict=True
    ):
        one.plot(run.t, values, color="black", lw=1.2)
        one.set(ylabel=name)
    axes[1, 0].set(xlabel="time [s]")
    save(figure)


@drawn
def engine() -> None:
    """Errors of Euler's method at two steps."""
    installed.use(["euler.py"])
    linear = cases.load("bouncing_ball", variant="linear")
    grid = np.linspace(0.0, linear.t_end, 400)
    truth = engines.load("reference").prepare(linear, rtol=1e-13, samples=grid).run().q[:, 0]
    figure, axes = plots()
    for dt, dash in ((1e-3, "-"), (1e-4, "--"), (1e-5, ":")):
        run = engines.load("euler").prepare(linear, dt=dt).run()
        axes[0, 0].semilogy(
            grid, np.maximum(np.abs(np.interp(grid, run.t, run.q[:, 0]) - truth), 1e-8), dash, label=f"dt = {dt:g} s"
        )
    axes[0, 0].set(xlabel="time [s]", ylabel="|height - truth| [m]")
    axes[0, 0].legend(frameon=False)
    save(figure)


@drawn
def metric() -> None:
    """What the metric measures."""
    linear = cases.load("bouncing_ball", variant="linear", t_end=1.2)
    figure, axes = plots()
    for name, profile, dash in (("reference", "compiled", "-"), ("mujoco", "default", "--")):
        run = engines.load(name).prepare(linear, profile).run()
        grid = np.linspace(0.0, run.t[-1], 500)
        height = fine(run, grid)
        (line,) = axes[0, 0].plot(grid, height, dash, label=f"{name}:{profile}")
        rebound = float(np.max(height[grid > touching(run)[0].touch]))
        axes[0, 0].axhline(rebound, color=line.get_color(), lw=0.8, ls=":")
    axes[0, 0].set(xlabel="time [s]", ylabel="height [m]")
    axes[0, 0].legend(frameon=False)
    save(figure)


@drawn
def work_precision() -> None:
    """The diagram of two engines."""
    bench = "crossbody bench bouncing_ball --variant listing"
    sh(f"{bench} -e reference:compiled -e mujoco:matched --repeats 2 --out bench -q")
    rows = pd.read_parquet("bench/bench.parquet")
    figure, axes = plots(figsize=(8, 4))
    for (name, profile), line in rows.groupby(["engine", "profile"], sort=False):
        axes[0, 0].loglog(line["error"], line["median_ms"], "o-", label=f"{name}:{profile}", ms=4)
    axes[0, 0].set(xlabel="relative error of position and event times", ylabel="run time, median [ms]")
    axes[0, 0].legend(frameon=False)
    save(figure)


CLOSED_FORMS = (
    "sliding_block:stops", "sliding_block:turns", "sliding_block:askew", "sliding_block:flat",
    "rolling_sphere:straight", "rolling_sphere:side_spin", "block_on_belt:grazes", "dry_oscillator:swings",
    "dry_oscillator:stops", "held_weight:slips", "stacked_blocks:apart", "rocking_block:falls",
)  # fmt: skip
"""Cases with friction whose motion is known exactly."""
RUBBING = {
    "reference:compiled": "", "reference:cvode": "sksundae", "mujoco:default": "mujoco", "pinocchio:admm": "pinocchio",
    "dart:matched": "dartpy", "drake:matched": "pydrake",
}  # fmt: skip
"""Engines with friction, and what each needs."""


STEPS = (8e-3, 4e-3, 2e-3, 1e-3, 5e-4)
LONGEST = 0.3  # s: a ladder ends with a run that takes longer


def off(run: cases.Trajectory, case: cases.Case) -> float:
    """How far a run is from the exact motion at its own times, over the largest of each coordinate; places alone."""
    names = [coordinate.name for coordinate in case.coordinates]
    places = [k for k, name in enumerate(names) if name.split()[-1] not in ("qw", "qx", "qy", "qz")]
    exact = case.closed_form(np.asarray(run.t)).q[:, places]
    size = np.abs(exact).max(axis=0)
    moves = size > 1e-6 * size.max()
    return float((np.abs(run.q[:, places] - exact)[:, moves] / size[moves]).max())


def ladder(case: cases.Case, engine: str, profile: str) -> np.ndarray:
    """Settings from coarse to fine, errors, and run times in ms (m, 3)."""
    found, one = [], engines.load(engine)
    for knob, settings in (("rtol", 10.0 ** -np.arange(4, 13)), ("dt", STEPS)):
        if knob not in one.prepare(case, profile).settings:
            continue
        for value in settings:
            prepared = one.prepare(case, profile, **{knob: float(value)})
            runs = [prepared.run() for _ in range(2)]
            if not runs[0].outcome.ok:
                break
            found.append((value, max(off(runs[0], case), 1e-16), 1e3 * min(run.wall_s for run in runs)))
            if runs[0].wall_s > LONGEST:
                break
    return np.array(found).reshape(-1, 3)


@drawn
def contacts() -> None:
    """Error against step and against cost, beside the reference's: a closed form a pair of panels."""
    rows = len(CLOSED_FORMS) // 2
    figure, axes = plots(rows, 4, figsize=(10, 1.7 * rows), sharex="col", sharey=True)
    for name, (step, cost) in zip(CLOSED_FORMS, axes.reshape(-1, 2), strict=True):
        case = cases.load(*name.split(":"))
        for k, (who, package) in enumerate(RUBBING.items()):
            engine, profile = who.split(":")
            if (package and find_spec(package) is None) or engines.load(engine).why_not(case, profile):
                continue
            setting, error, took = ladder(case, engine, profile).T
            for panel, x in ((step, setting), (cost, took)):
                panel.loglog(x, error, color=f"C{k}", lw=1.5, marker="." if len(x) == 1 else "", label=who)
        step.set(title=name, ylim=(3e-17, 30.0))
    for step, cost in axes[-1].reshape(-1, 2):
        step.set(xlabel="step [s], or rtol")
        cost.set(xlabel="run time [ms]")
    for panel in axes.flat:
        panel.minorticks_off()
        panel.tick_params(bottom=False, left=False)
        panel.grid(visible=False)
        panel.spines[["top", "right"]].set_visible(False)
        panel.xaxis.set_major_locator(LogLocator(numticks=4))
        panel.yaxis.set_major_locator(LogLocator(numticks=5))
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_formatter("{x:.0e}")
    figure.supylabel("error of position, over the largest")
    handles = {text: line for one in axes.flat for line, text in zip(*one.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=6, frameon=False)
    save(figure)


@drawn
def stress() -> None:
    """Errors of the suite of the page."""
    sh("crossbody stress slopes.py --runs 120 --jobs 1 -e reference:compiled --out slopes -q")
    rows = pd.read_parquet("slopes/stress.parquet")
    told = pd.DataFrame([json.loads(text) for text in rows["parameters"]])
    figure, axes = plots()
    for stiffness, mark in zip(sorted(told["a0"].unique(), key=float), "osv", strict=True):
        mine = (told["a0"] == stiffness).to_numpy()
        axes[0, 0].semilogy(
            told["height"][mine].astype(float),
            rows["error"][mine].astype(float),
            mark,
            ms=4,
            label=f"a0 = {float(stiffness):g} 1/s²",
        )
    axes[0, 0].set(xlabel="height [m]", ylabel="relative error")
    axes[0, 0].legend(frameon=False)
    save(figure)


@drawn
def rig() -> None:
    """Measured, and predicted before and after identification."""
    page = (DOCS / "how-to" / "rig.md").read_text(encoding="utf-8")
    scope: dict[str, object] = {}
    for text in re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)[:3]:
        exec(text, scope)
    from crossbody import hw

    log, fit = scope["log"], scope["fit"]
    figure, axes = plots(2, sharex=True, height_ratios=(2, 1))
    for name, parameters, dash in (("at the start", None, "--"), ("identified", fit.parameters, "-")):
        found = hw.replay(log, "single_pendulum", restart=2.0, parameters=parameters)
        colour, at = ("C0" if parameters else "C1"), slice(None, None, 16)
        for k, (window, y) in enumerate(zip(found.windows, found.predictions[0].y, strict=True)):
            axes[0, 0].plot(window.t[at], y[at, 0], dash, color=colour, label=name if k == 0 else None, lw=1.2)
            axes[1, 0].plot(window.t[at], (window.y[:, 0] - y[:, 0])[at], dash, color=colour, lw=0.8)
    for k, window in enumerate(found.windows):
        label = "measured" if k == 0 else None
        axes[0, 0].plot(window.t[::40], window.y[::40, 0], ".", color="black", ms=3, label=label)
    axes[0, 0].set(ylabel="th1 [rad]")
    axes[1, 0].set(ylabel="measured - predicted [rad]", xlabel="time [s]")
    axes[0, 0].legend(frameon=False, ncols=3)
    save(figure)


@drawn
def analyse() -> None:
    """Poles of the soft fingers over the gain of their loop."""
    sh("crossbody analyse soft_contact --locus kstar=500..700 --out fingers -q")
    rows = pd.read_parquet("fingers/analysis-locus.parquet")
    figure, axes = plots(figsize=(8, 4))
    for mark, (place, mine) in zip("os+x", rows.groupby("place", sort=False), strict=False):
        near = mine[mine["real"].between(-12.0, 10.0)][::6]
        axes[0, 0].plot(near["real"], near["imag"], mark, ms=7, mfc="none", label=str(place))
    axes[0, 0].axvline(0.0, color="black", lw=0.8)
    axes[0, 0].set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]", xlim=(-12.0, 10.0))
    axes[0, 0].legend(frameon=False)
    save(figure)


@drawn
def model() -> None:
    """Force over depth of one contact at three dampings."""
    figure, axes = plots(figsize=(8, 3.5))
    for a1, dash in ((0.0, "-"), (20.0, "--"), (100.0, "-.")):
        one = cases.load("bouncing_ball", "linear", a1=a1, t_end=0.6)
        run = engines.load("reference").prepare(one, samples=np.linspace(0.44, 0.52, 600)).run()
        bears = run.lam[:, 0] > 0.0
        axes[0, 0].plot(-1e3 * run.gap[bears, 0], run.lam[bears, 0], dash, label=f"a1 = {a1:g} 1/s")
    axes[0, 0].set(xlabel="depth [mm]", ylabel="force lam [N]")
    axes[0, 0].legend(frameon=False)
    save(figure)


def draw(name: str) -> None:
    """Draw the figure of one page in a folder of its own."""
    if name == "ball":
        return ball()
    (page,) = DOCS.rglob(f"{name}.md")
    back = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for title, text in re.findall(
                r'^```\w+ title="([^"]+)"\n(.*?)^```$', page.read_text(), re.DOTALL | re.MULTILINE
            ):
                if title != "pyproject.toml":
                    Path(title).write_text(text, encoding="utf-8")
            DRAWN[name]()
            FIGURES.mkdir(exist_ok=True)
            (FIGURES / f"{name}.svg").write_bytes(Path("figure.svg").read_bytes())
        finally:
            os.chdir(back)
    return None


if __name__ == "__main__":
    mpl.rcParams |= {
        "svg.hashsalt": "crossbody",
        "svg.fonttype": "none",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 9.0,
        "path.simplify_threshold": 0.5,
    }
    for each in sys.argv[1:] or ["ball", *DRAWN]:
        draw(each)
        print(each, flush=True)
