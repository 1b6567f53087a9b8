"""What a case has beside its scene: engines that build the scene's own parts refuse it, and never run without it."""

from dataclasses import replace

import numpy as np
import pytest

from crossbody import cases, engines
from crossbody.cases import CaseUnsupported, SceneError
from crossbody.cases.case import Force
from crossbody.cases.form import Form
from crossbody.cases.gates import Gates

SCENES = (("newtons_cradle", "sliders"), ("bouncing_ball", "listing"), ("sliding_block", "stops"))
FORMS = (("ball_maze", "free"), ("delta_free", "light"), ("soft_contact", "axis"))
ENGINES = {"drake": "pydrake", "dart": "dartpy", "exudyn": "exudyn", "pymunk": "pymunk"}


def nothing(*_):
    """Do nothing."""


BESIDE = {
    "force": Force(function=nothing),
    "gates": Gates(
        rows=nothing, guards=nothing, switch=nothing, numbers=np.zeros(1), count=0, discrete=(0,), follows=()
    ),
    "form": lambda case, *_: Form(case=case, to_case=nothing, to_scene=nothing, rows=()),
}


@pytest.mark.parametrize("part", BESIDE)
@pytest.mark.parametrize(("name", "variant"), SCENES)
@pytest.mark.parametrize("engine", ENGINES)
def test_what_a_case_has_beside_its_scene_is_refused(engine, name, variant, part):
    pytest.importorskip(ENGINES[engine])
    found, case = engines.load(engine), cases.load(name, variant)
    if case.general and part != "form":
        with pytest.raises(SceneError, match="has no kernels of its own"):
            replace(case, **{part: BESIDE[part]})
        return
    with_it = replace(case, **{part: BESIDE[part]})
    for profile in found.profiles:
        with pytest.raises(CaseUnsupported):
            found.prepare(with_it, profile)
        if found.why_not(case, profile) is None:
            assert "builds only the parts of a scene" in found.why_not(with_it, profile)


@pytest.mark.parametrize(("name", "variant"), FORMS)
@pytest.mark.parametrize("engine", ENGINES)
def test_cases_on_a_scene_in_other_coordinates_are_refused(engine, name, variant):
    pytest.importorskip(ENGINES[engine])
    found, case = engines.load(engine), cases.load(name, variant)
    assert all(found.why_not(case, profile) for profile in found.profiles)
