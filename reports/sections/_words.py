"""What the sections of our studies say above their tables, and which columns these have."""

from __future__ import annotations

from crossbody.reports.figures.section import Kind, columns

RATIOS = columns(
    what="What", value=("Value", Kind.NUMBER), unit="Unit", limit=("Limit", Kind.NUMBER), held="Held",
    beside=("Made of", Kind.LONG), how=("How", Kind.LONG),
)  # fmt: skip
SKIP_TEXT = "Ratios compare the shortest of interleaved runs. Counts are from one run, and are the same every time."
THROUGHPUT_TEXT = (
    "Ratios of runs per second, interleaved on the same cores. Two threads are judged only if "
    "two busy threads get two cores of the machine."
)
ANALYSIS_TEXT = (
    "Linear models about the equilibria of the case, in the named modes, by exact derivatives of "
    "the equations. Rows that hold are eliminated, so that their law adds no poles, unless the law "
    "itself is studied. Where a contact slides, nothing is at rest, and the equations are linearised "
    "about the motion. A pole with a positive real part grows, one with a negative real part "
    "decays. Linear stability does not show that an equilibrium is reached. Engines are judged by "
    "their largest difference from the reference: in the derivatives of the accelerations, each "
    "row relative to its largest entry, and in the poles, relative to their modulus."
)
ANALYSIS_TABLES = (
    ("Values at the operating points", "equilibria", columns(
        place="Operating point", variable="Variable", value=("Value", Kind.NUMBER), outcome="Search",
    )),
    ("Poles", "poles", columns(
        place="Operating point", led_by="Led by", real=("Real part [1/s]", Kind.NUMBER),
        imag=("Imaginary part [rad/s]", Kind.NUMBER), frequency=("Frequency [rad/s]", Kind.NUMBER),
        damping=("Damping ratio", Kind.NUMBER),
    )),
    ("Linear models", "ranks", columns(
        place="Operating point", states=("States", Kind.NUMBER), controllable=("Controllable", Kind.NUMBER),
        observable=("Observable", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER),
    )),
    ("Characteristic polynomials", "coefficients", columns(
        place="Operating point", axis="Axis",
        **{"s^2": ("s^2 [1/s]", Kind.NUMBER), "s": ("s [1/s^2]", Kind.NUMBER)},
        **{"1": ("1 [1/s^3]", Kind.NUMBER)}, coupling=("Coupling", Kind.NUMBER),
    )),
    ("Limits of stability", "limits", columns(
        place="Operating point", parameter="Parameter", value=("Limit of stability", Kind.NUMBER),
        unstable="Unstable", frequency=("Frequency [rad/s]", Kind.NUMBER),
    )),
    ("Without a linear model", "refusals", columns(place="State", why=("Why", Kind.LONG))),
    ("Linear models of engines", "engines", columns(
        place="Operating point", engine="Engine", way="Way", slope=("Slope", Kind.NUMBER),
        poles=("Poles", Kind.NUMBER), unexplained=("Unexplained", Kind.NUMBER),
        limit=("Limit", Kind.NUMBER), verdict=("Verdict", Kind.VERDICT), why=("Why", Kind.LONG),
    )),
)  # fmt: skip
BODE_TEXT = (
    "The block held by both fingers, about the grasp: from the velocity of the fingers to the "
    "difference of the contact forces and to the velocity of the block. Derivatives of the model are "
    "exact in the modes of the grasp. The table has the largest real part of the poles, except for the "
    "two at 0: the common shift of the fingers, and the quantity that the tactile loop conserves. Below "
    "0 the loop is stable about an equilibrium; whether an approach is stable, only a run can show."
)
GROWTHS = columns(mode="Modes", kstar=("k* [cm/(s N)]", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER))
BENCH_TEXT = (
    "Models are built and warm before they are timed; engines are interleaved; times are "
    "medians with interquartile range. Runs without a finite error are shown as crosses. An engine that follows "
    "another law is judged against the truth of that law. Compare ratios, since seconds depend "
    "on the machine. The whole call includes the Python call and the trajectory that it builds."
)
ORDERS = columns(
    case="Case", who="Engine", order=("Observed order", Kind.NUMBER), says=("Comment", Kind.LONG),
    promised=("Promised order", Kind.NUMBER), knob="Setting",
)  # fmt: skip
TIMINGS = columns(
    case="Case", who="Engine", median_ms=("Median [ms]", Kind.NUMBER), error=("Error", Kind.NUMBER),
    setting=("Setting", Kind.NUMBER), knob="Which", native_ms=("Its own loop [ms]", Kind.NUMBER),
    call_ms=("Whole call [ms]", Kind.NUMBER), iqr_ms=("IQR [ms]", Kind.NUMBER), against="Against the truth of",
    tier="Tier", error_q=("Position", Kind.NUMBER), error_v=("Velocity", Kind.NUMBER),
    error_impulse=("Impulse", Kind.NUMBER), error_energy=("Energy", Kind.NUMBER),
    error_times=("Event times [s]", Kind.NUMBER), error_between=("Position on one grid", Kind.NUMBER),
    honesty=("Error over tolerance", Kind.NUMBER), control_ms=("In the controller [ms]", Kind.NUMBER),
    interpreted=("Interpreted", Kind.LONG), cores=("Cores", Kind.NUMBER),
    repeats=("Repeats", Kind.NUMBER), outcome="Outcome",
)  # fmt: skip
HEADLINE_TEXT = (
    "For each engine, its best error and the run time there, compared with the cheapest run of "
    "the compiled reference that is at least as accurate. The least ratio is the smallest over "
    "all errors that the engine reaches. Errors below 1e-13, or below the accuracy of a truth of "
    "tier C, count as equal to it. An engine that follows another law is judged against the truth "
    "of that law. The table says which parts of an engine's run are Python; its own loop makes "
    "the same steps natively, without recording, events and the parts of the law that are Python."
)
HEADLINE = columns(
    case="Case", who="Engine", best_error=("Best error", Kind.NUMBER), ratio=("Ratio", Kind.NUMBER),
    ratio_native=("Its own loop alone", Kind.NUMBER), least_ratio=("Least ratio", Kind.NUMBER),
    ahead="Ahead at every error", engine_ms=("Its run [ms]", Kind.NUMBER),
    reference_ms=("Reference [ms]", Kind.NUMBER), ratio_call=("Ratio of the Python calls", Kind.NUMBER),
    says=("Comment", Kind.LONG), interpreted=("Interpreted in its run", Kind.LONG), tier="Tier",
    against="Against the truth of",
)  # fmt: skip
CONFORMANCE_TEXT = (
    "One file for each feature. Every engine's own reader reads it in a separate process, and "
    "the result is compared with a scene written by hand: coordinates, inertias, M, gravity, "
    "bias, energy and frames at random states, or the quantities that the feature concerns. ok: "
    "equal to 1e-9 (2e-4 for a reader in single precision). unsupported: the engine reports "
    "that it ignores the feature, or has no such feature. not shown: it may have it, but does "
    "not expose it. wrong: it reads something else without a warning. failed: it gives up."
)
DETAILS = columns(
    feature="Feature", engine="Engine", version="Version", verdict=("Verdict", Kind.VERDICT),
    quantity="Quantity", where="Where", value=("Value", Kind.NUMBER), expected=("Expected", Kind.NUMBER),
    why=("Message", Kind.LONG), rule=("Rule of the format", Kind.LONG),
    rewrite=("Portable form", Kind.LONG), text=("File", Kind.CODE),
)  # fmt: skip
GAPS_TEXT = (
    "Elastic sliders, hit by one ball; s = gap sqrt(a0) / v is the gap relative to the deepest "
    "penetration of one pair. If collisions overlap, the law itself creates energy, and the "
    "pattern is not the ideal one; each row gives the gap from which on an engine reproduces it. "
    "All values are relative to the energy of the first ball. Failed runs are shown as crosses."
)
GAPS = columns(
    n=("Balls", Kind.NUMBER), who="Engine", machine="Law or rule", most=("Most energy created", Kind.NUMBER),
    at_s=("At gap s", Kind.NUMBER), at_touch="Touching, nearest to", ideal_from=("Ideal from s", Kind.NUMBER),
    failed=("Failed", Kind.NUMBER), why=("Comment", Kind.LONG),
)  # fmt: skip
STABILITY_TEXT = (
    "The closed loop with one change at a time: bounds, gains, the model inside the "
    "controller, the initial state, sampling and noise. If the ball tumbles through several "
    "rings, either outcome is possible."
)
STABILITY = columns(
    who="Engine", scene="Scene", expected="Published", outcome="Outcome",
    arrival=("Arrival [s]", Kind.NUMBER), ended=("End [s]", Kind.NUMBER),
    changes=("Rings passed", Kind.NUMBER), why=("Comment", Kind.LONG),
)  # fmt: skip
STRESS_TEXT = (
    "Quasi-random and gridded extreme scenes, each bounded in steps and time. A run is outside "
    "if it raised an exception, leaked a warning or returned a value that is not a number; the "
    "reference also if its error against a truth of tier A to C, or the residual of its energy "
    "account, exceeds its limit. Failures of engines are shown with their outcome."
)
MAPPED_TEXT = (
    "Largest error over damping ratios 0 to 10, by stiffness and by tolerance or step; a cross marks a failed run."
)
SMALL_TEXT = (
    "The first failure of every kind, with its parameters moved towards the defaults of the "
    "case as far as it still fails in the same way; the command repeats it."
)
SUITES = columns(
    suite="Suite", who="Engine", runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER),
    not_run=("Not run", Kind.NUMBER), outside=("Outside", Kind.NUMBER),
    with_truth=("With truth", Kind.NUMBER), worst_error=("Worst error", Kind.NUMBER),
    worst_residual=("Worst energy residual", Kind.NUMBER), seconds=("Time [s]", Kind.NUMBER),
    outcomes="Other outcomes",
)  # fmt: skip
CELLS = columns(
    who="Engine", a0=("a0 [1/s²]", Kind.NUMBER), knob="Knob", setting=("Setting", Kind.NUMBER),
    runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER), worst_error=("Worst error", Kind.NUMBER),
    outcomes="Other outcomes",
)  # fmt: skip
FAILED = columns(
    verdict=("Verdict", Kind.VERDICT), outcome="Outcome", who="Engine", suite="Suite",
    count=("Times", Kind.NUMBER), why=("Comment", Kind.LONG), command=("Command", Kind.CODE),
)  # fmt: skip
