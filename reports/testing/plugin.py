"""The pytest plugin: options, fixtures, and one test for every limit of a case under every engine.

    pytest --crossbody-case bouncing_ball:listing --crossbody-case path/to/case.py --crossbody-engine mujoco

Every run of pytest imports this module: whatever needs numpy or an engine is imported when it is asked for.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from crossbody.cases import Case, Trajectory
    from crossbody.reports.judging.verdict import Verdict
    from crossbody.reports.measuring.truth import Truth
    from crossbody.reports.runs.choice import Pick
    from crossbody.reports.testing._baseline import Baseline
    from crossbody.reports.testing._bench import Bench, Chosen
    from crossbody.reports.testing._parameters import Named, Scene

MARKER = "crossbody"
_SCENE, _PICK = "_crossbody_scene", "_crossbody_pick"
_BENCH: pytest.StashKey[Bench] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options, and their defaults in the configuration file."""
    group = parser.getgroup(MARKER, "rigid-body engines against a reference (crossbody)")
    case = "a case by name, or the path of a case file, with :VARIANT for one variant alone; repeatable"
    engine = "an engine, with :PROFILE for one profile alone; repeatable"
    for option, text, word in (
        ("case", case, "CASE[:VARIANT]"),
        ("engine", engine, "E[:PROFILE]"),
        ("audit", "a robot file that every engine's own reader must read alike; repeatable", "FILE"),
    ):
        group.addoption(f"--crossbody-{option}", action="append", default=[], metavar=word, help=text)
        parser.addini(f"crossbody_{option}s", f"where --crossbody-{option} is not given: {text}", type="linelist")
    plugin = (
        "a Python file that is an engine, a metric, a case, ...; repeatable, in addition to [tool.crossbody] plugins"
    )
    group.addoption("--crossbody-plugin", action="append", default=[], metavar="FILE", help=plugin)
    group.addoption("--crossbody-update", action="store_true", help="write baselines instead of comparing with them")


def pytest_configure(config: pytest.Config) -> None:
    """Add the mark by which one's own tests name cases and engines; import plug-ins."""
    config.addinivalue_line(
        "markers", f"{MARKER}(*cases, engines=()): cases and engines of a test that uses crossbody's fixtures"
    )
    given, project = config.getoption("--crossbody-plugin"), config.rootpath / "pyproject.toml"
    if given or (project.is_file() and b"crossbody" in project.read_bytes()):
        _plug(config, [config.invocation_params.dir / Path(file).expanduser() for file in given])


def _plug(config: pytest.Config, given: Sequence[Path]) -> None:
    from crossbody.cases import CrossbodyError, installed

    try:
        installed.use([*installed.configured(config.rootpath), *given])
    except CrossbodyError as error:
        raise pytest.UsageError(str(error)) from None


def _generates(config: pytest.Config, what: str) -> bool:
    return bool(config.getoption(f"--crossbody-{what}") or config.getini(f"crossbody_{what}s"))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Put the tests of the cases asked for behind those that pytest finds."""
    report = yield
    if isinstance(collector, pytest.Session) and report.passed:
        if _generates(collector.config, "case"):
            from crossbody.reports.testing._items import Cases

            report.result.append(Cases.from_parent(collector, name=MARKER, nodeid=MARKER))
        if _generates(collector.config, "audit"):
            from crossbody.reports.testing._audits import Audits

            report.result.append(Audits.from_parent(collector, name=MARKER, nodeid=MARKER))
    return report


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for every case and engine asked for, by its mark, the command line or configuration."""
    if not {_SCENE, _PICK} & set(metafunc.fixturenames):
        return
    from crossbody.reports.testing._parameters import picks, scenes

    mark = metafunc.definition.get_closest_marker(MARKER)
    for name, values in ((_SCENE, scenes), (_PICK, picks)):
        if name in metafunc.fixturenames:
            metafunc.parametrize(name, values(metafunc.config, mark), ids=str, indirect=True, scope="session")


def bench(config: pytest.Config) -> Bench:
    """The runs of this session, each made once."""
    if _BENCH not in config.stash:
        from crossbody.reports.testing._bench import Bench

        config.stash[_BENCH] = Bench()
    return config.stash[_BENCH]


@pytest.fixture(scope="session")
def _crossbody_scene(request: pytest.FixtureRequest) -> Scene:
    scene: Scene = request.param
    return scene


@pytest.fixture(scope="session")
def _crossbody_pick(request: pytest.FixtureRequest) -> Pick:
    named: Named = request.param
    return named.pick


@pytest.fixture(scope="session")
def crossbody_case(request: pytest.FixtureRequest, _crossbody_scene: Scene) -> Case:
    """Each case asked for, as `crossbody.cases.Case`."""
    return bench(request.config).case(_crossbody_scene)


@pytest.fixture(scope="session")
def crossbody_engine(_crossbody_pick: Pick) -> Chosen:
    """Each engine and profile asked for: `prepare(case, **settings)`, `engine`, `profile`; or skipped."""
    from crossbody.reports.testing._bench import Chosen

    return Chosen.of(_crossbody_pick)


@pytest.fixture(scope="session")
def crossbody_truth(request: pytest.FixtureRequest, _crossbody_scene: Scene) -> Truth:
    """What the case is judged against, and how that is known."""
    return bench(request.config).truth(_crossbody_scene)


@pytest.fixture(scope="session")
def crossbody_run(request: pytest.FixtureRequest, _crossbody_scene: Scene, _crossbody_pick: Pick) -> Trajectory:
    """The motion of each case on each engine at its own settings; skipped if it cannot."""
    entry = bench(request.config).entry(_crossbody_scene, _crossbody_pick)
    if entry.run is None:
        pytest.skip(entry.skipped)
    return entry.run


@pytest.fixture(scope="session")
def crossbody_verdicts(
    request: pytest.FixtureRequest, _crossbody_scene: Scene, _crossbody_pick: Pick
) -> Mapping[str, Verdict]:
    """Metric -> verdict of each case on each engine; skipped where the engine cannot run the case."""
    found = bench(request.config).verdicts(_crossbody_scene, _crossbody_pick)
    if "run" in found:
        pytest.skip(found["run"].why)
    return found


@pytest.fixture
def crossbody_baseline(request: pytest.FixtureRequest) -> Baseline:
    """Numbers of an earlier run: `check({"metric": number})` compares, with --crossbody-update it writes."""
    from crossbody.reports.testing._baseline import Baseline, place

    return Baseline(place(request.path, request.node.name), update=request.config.getoption("--crossbody-update"))
