"""What the sections of our studies say above their tables, and which columns these have."""

from __future__ import annotations

from crossbody.reports.figures.section import Kind, columns

RATIOS = columns(
    what="What", value=("Value", Kind.NUMBER), unit="Unit", limit=("Limit", Kind.NUMBER), held="Held",
    beside=("Made of", Kind.LONG), how=("How", Kind.LONG),
)  # fmt: skip
SKIP_TEXT = "Each ratio is of the shortest of interleaved runs; counts are of one run and the same every time."
THROUGHPUT_TEXT = (
    "Ratios of runs a second, interleaved on the same cores. Two threads are judged only where the machine gives two "
    "cores to two threads that do nothing but count."
)
ANALYSIS_TEXT = (
    "Linear models about the equilibria of the case, in the modes named, by exact derivatives of the equations. Rows "
    "that are held are eliminated, so the law that holds them adds no poles, unless it is what is looked at. A pole to "
    "the right of 0 grows; to the left it decays. Linear stability says nothing about how an equilibrium is reached. "
    "Engines are judged by their largest difference from the reference: of the derivatives of the accelerations, each "
    "row as a part of its largest entry, and of the poles as a part of their modulus."
)
ANALYSIS_TABLES = (
    ("Linear models", "ranks", columns(
        place="Equilibrium", states=("States", Kind.NUMBER), controllable=("Controllable", Kind.NUMBER),
        observable=("Observable", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER),
    )),
    ("Characteristic polynomials", "coefficients", columns(
        place="Equilibrium", axis="Axis", **{"s^2": ("s^2 [1/s]", Kind.NUMBER), "s": ("s [1/s^2]", Kind.NUMBER)},
        **{"1": ("1 [1/s^3]", Kind.NUMBER)}, coupling=("Coupling", Kind.NUMBER),
    )),
    ("Limits of stability", "limits", columns(
        place="Equilibrium", parameter="Parameter", value=("Limit of stability", Kind.NUMBER), unstable="Unstable",
        frequency=("Frequency [rad/s]", Kind.NUMBER),
    )),
    ("Linear models of engines", "engines", columns(
        place="Equilibrium", engine="Engine", way="Way", slope=("Slope", Kind.NUMBER), poles=("Poles", Kind.NUMBER),
        unexplained=("Unexplained", Kind.NUMBER), limit=("Limit", Kind.NUMBER), verdict=("Verdict", Kind.VERDICT),
        why=("Why", Kind.LONG),
    )),
)  # fmt: skip
BODE_TEXT = (
    "The block held by both fingers, about the grasp: from the velocity of the fingers to the difference of the "
    "contact forces and to the velocity of the block. Derivatives of the model are exact in the modes of the grasp. "
    "The table has the largest real part of the poles, but for the two that stand at 0: the fingers' own shift, and "
    "what the tactile loop keeps. Below 0 the loop is stable about an equilibrium; whether an approach is, only a run "
    "tells."
)
GROWTHS = columns(mode="Modes", kstar=("k* [cm/(s N)]", Kind.NUMBER), growth=("Growth [1/s]", Kind.NUMBER))
BENCH_TEXT = (
    "Models built and warmed before the clock, engines interleaved, median with interquartile range. A failed run is a "
    "cross, never dropped. An engine that follows another state machine is judged against that machine's truth. "
    "Compare ratios: seconds belong to one machine. The whole call is the run with the Python call and the trajectory "
    "that it builds."
)
ORDERS = columns(
    case="Case", who="Engine", knob="Setting", order=("Observed order", Kind.NUMBER),
    promised=("Promised order", Kind.NUMBER), says=("Says", Kind.LONG),
)  # fmt: skip
TIMINGS = columns(
    case="Case", who="Engine", knob="Setting", setting=("Value", Kind.NUMBER), against="Against the truth of",
    tier="Tier", error=("Error", Kind.NUMBER), error_q=("Position", Kind.NUMBER),
    error_v=("Velocity", Kind.NUMBER), error_impulse=("Impulse", Kind.NUMBER),
    error_energy=("Energy", Kind.NUMBER), error_times=("Event times [s]", Kind.NUMBER),
    error_between=("Position on one grid", Kind.NUMBER), honesty=("Error over tolerance", Kind.NUMBER),
    median_ms=("Median [ms]", Kind.NUMBER), iqr_ms=("IQR [ms]", Kind.NUMBER), call_ms=("Whole call [ms]", Kind.NUMBER),
    native_ms=("Its own loop [ms]", Kind.NUMBER), control_ms=("In the controller [ms]", Kind.NUMBER),
    interpreted=("Interpreted", Kind.LONG), cores=("Cores", Kind.NUMBER), repeats=("Repeats", Kind.NUMBER),
    outcome="Outcome",
)  # fmt: skip
HEADLINE_TEXT = (
    "For each engine its best error and the time that it took there, beside the cheapest run of the compiled reference "
    "that is at least as accurate. The least ratio is that of all errors which the engine reaches. Errors below 1e-13, "
    "or below what a truth of tier C is known to, count as that. An engine that follows another law is judged against "
    "that law's truth. What of an engine's run is Python is said beside its ratio; its own loop alone makes the same "
    "steps natively, without record, events, and what of the law is Python."
)
HEADLINE = columns(
    case="Case", who="Engine", tier="Tier", against="Against the truth of", best_error=("Best error", Kind.NUMBER),
    engine_ms=("Its run [ms]", Kind.NUMBER), reference_ms=("Reference [ms]", Kind.NUMBER),
    ratio=("Ratio", Kind.NUMBER), ratio_call=("Ratio of the Python calls", Kind.NUMBER),
    ratio_native=("Its own loop alone", Kind.NUMBER), least_ratio=("Least ratio", Kind.NUMBER),
    interpreted=("Interpreted in its run", Kind.LONG), ahead="Ahead at every error", says=("Says", Kind.LONG),
)  # fmt: skip
CONFORMANCE_TEXT = (
    "One feature a file, each read by the engine's own reader in a process of its own, and compared with a scene that "
    "was written by hand: coordinates, inertias, M, gravity, bias, energy and frames at random states, or what the "
    "feature is about. ok: alike to 1e-9 (to 2e-4 for a reader in single precision). unsupported: the engine says that "
    "it leaves it out, or has no such thing. not shown: it may have it, but nobody can look. wrong: it reads something "
    "else without a word. failed: it gives up."
)
DETAILS = columns(
    feature="Feature", engine="Engine", version="Version", verdict=("Verdict", Kind.VERDICT), quantity="Quantity",
    where="Where", value=("Value", Kind.NUMBER), expected=("Expected", Kind.NUMBER), why=("It says", Kind.LONG),
    rule=("Rule of the format", Kind.LONG), rewrite=("How all agree", Kind.LONG), text=("File", Kind.CODE),
)  # fmt: skip
GAPS_TEXT = (
    "Sliders, one ball in, elastic; s = gap sqrt(a0) / v is the gap over the deepest penetration of one pair. Where "
    "collisions overlap the law itself makes energy and no row gives the ideal pattern; each line shows from which gap "
    "on an engine does. All values are ratios to what came in. A run that failed is a cross, never dropped."
)
GAPS = columns(
    n=("Balls", Kind.NUMBER), who="Engine", machine="Law or rule", most=("Most energy created", Kind.NUMBER),
    at_s=("at s", Kind.NUMBER), at_touch="Touching, nearest to", ideal_from=("Ideal from s", Kind.NUMBER),
    failed=("Failed", Kind.NUMBER), why=("Says", Kind.LONG),
)  # fmt: skip
STABILITY_TEXT = (
    "The closed loop with one thing changed at a time: bounds, gains, the model that the controller believes in, the "
    "start, sampling and noise. Where the ball tumbles through several rings either end is possible."
)
STABILITY = columns(
    who="Engine", scene="Scene", expected="Published", outcome="Outcome", arrival=("Arrival [s]", Kind.NUMBER),
    ended=("End [s]", Kind.NUMBER), changes=("Rings passed", Kind.NUMBER), why=("Says", Kind.LONG),
)  # fmt: skip
STRESS_TEXT = (
    "Quasi-random and gridded scenes up to their extremes, each bounded in steps and time. A run is outside if it "
    "threw, leaked a warning or returned what is not a number; the reference also if it is further from a truth of "
    "tier A to C, or leaves more of its energy account open, than its limit. Failures of engines are shown with their "
    "outcome."
)
MAPPED_TEXT = (
    "Worst error over damping ratios 0 to 10, by stiffness and by tolerance or step; a cross where a run failed."
)
SMALL_TEXT = (
    "The first failure of every kind, its parameters moved to the case's own as long as it fails in the same way; the "
    "command repeats it."
)
SUITES = columns(
    suite="Suite", who="Engine", runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER),
    not_run=("Not run", Kind.NUMBER), outside=("Outside", Kind.NUMBER), with_truth=("With truth", Kind.NUMBER),
    worst_error=("Worst error", Kind.NUMBER), worst_residual=("Worst energy residual", Kind.NUMBER),
    seconds=("Time [s]", Kind.NUMBER), outcomes="Other ends",
)  # fmt: skip
CELLS = columns(
    who="Engine", a0=("a0 [1/s²]", Kind.NUMBER), knob="Knob", setting=("Setting", Kind.NUMBER),
    runs=("Runs", Kind.NUMBER), finished=("Finished", Kind.NUMBER), worst_error=("Worst error", Kind.NUMBER),
    outcomes="Other ends",
)  # fmt: skip
FAILED = columns(
    verdict=("Verdict", Kind.VERDICT), outcome="Outcome", who="Engine", suite="Suite", count=("Times", Kind.NUMBER),
    why=("Says", Kind.LONG), command=("Command", Kind.CODE),
)  # fmt: skip
