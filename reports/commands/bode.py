"""What `crossbody bode` does: linearise, write the tables and the page, show the margins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from crossbody.cases import InvalidValue
from crossbody.reports import voice
from crossbody.reports.analysis import bode as responses
from crossbody.reports.commands.shared import where
from crossbody.reports.pages import site as page
from crossbody.reports.runs import jobs, output, study
from crossbody.reports.runs.provenance import provenance


def bode(name: str, pairs: Sequence[str], out: Path, command: str) -> int:
    """Frequency responses in the grasp, poles in every mode set.

    Args:
        name: of the case.
        pairs: K=V, parameters of the case to change; k* is the figure's own.
        out: folder to write.
        command: what was typed, for provenance.

    Raises:
        CrossbodyError: for wrong use, before anything is written.
    """
    responses.check(name)
    parameters = jobs.parse_settings(pairs)
    if "kstar" in parameters:
        raise InvalidValue(f"kstar is what the curves differ in: {', '.join(f'{k:g}' for k in responses.GAINS)}.")
    output.check(out, "bode")
    curves = [responses.soft_contact(k, mode, **parameters) for mode in responses.MODES for k in responses.GAINS]
    held = [curve for curve in curves if curve.mode == "grasp"]
    rows, poles = responses.table(held, responses.frequencies()), responses.poles(curves)
    told = provenance(command)
    with output.folder(out, "bode") as made:
        study.write(made, [], study.judge([], {}), told)
        study.write_table(made / "bode", rows, told)
        study.write_table(made / "poles", poles, told)
        page.write(made)
    growths = responses.growths(poles)
    if not voice.told_as_json({"bode": rows, "poles": poles, "growths": growths}):
        if not voice.quiet():
            print(growths.to_string(index=False, float_format=lambda x: f"{x:.4g}"))
        where(out)
    return 0
