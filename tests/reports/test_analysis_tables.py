"""Tables of an analysis beside what numpy makes of the same matrices."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from unpacked import numbers as read

from crossbody import cases
from crossbody.cases import Outcome
from crossbody.reference.linear import LinearModel
from crossbody.reports.analysis import bode, figure, numbers
from crossbody.reports.cli import main

OMEGA = np.logspace(-1.0, 1.5, 80)


def drawn(seed: int) -> tuple[Any, ...]:
    """Two places with models whose last state nothing reaches and whose first one no output shows, and one without."""
    rng, found = np.random.default_rng(seed), []
    for k, n in enumerate((4, 5)):
        A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, 2)), rng.normal(size=(3, n))
        A[-1, :-1], B[-1], A[1:, 0], C[:, 0] = 0.0, 0.0, 0.0, 0.0
        model = LinearModel(
            A=A, B=B, C=C, D=rng.normal(size=(3, 2)), states=tuple(f"x{i}" for i in range(n)),
            inputs=("pull", "push"), outputs=("a", "b", "c"),
        )  # fmt: skip
        found.append(SimpleNamespace(name=f"place {k}", model=model, controlled=False))
    return (*found, SimpleNamespace(name="nowhere", model=None, controlled=False))


@pytest.mark.parametrize("seed", range(4))
def test_poles_and_who_leads_them(seed: int) -> None:
    places = drawn(seed)
    table = numbers.poles(places)
    assert set(table["place"]) == {"place 0", "place 1"}
    for place in places[:2]:
        own, (values, right) = table[table["place"] == place.name], np.linalg.eig(place.model.A)
        left = np.linalg.inv(right).T
        assert np.all(np.diff(own["real"]) <= 1e-12)
        for row in own.itertuples():
            k = int(np.argmin(np.abs(values - complex(row.real, row.imag))))
            assert values[k] == pytest.approx(complex(row.real, row.imag), rel=1e-9)
            assert row.frequency == pytest.approx(np.hypot(row.real, row.imag))
            assert row.damping == pytest.approx(-row.real / np.hypot(row.real, row.imag))
            part, leads = np.abs(left[:, k] * right[:, k]), place.model.states.index(row.led_by)
            assert part[leads] == pytest.approx(part.max(), rel=1e-5)
            assert (part[:leads] < (1.0 - 1e-7) * part.max()).all(), (
                "of equal ones the first leads, whatever rounding does"
            )
        assert len(own) == len(values)


@pytest.mark.parametrize("seed", range(4))
def test_ranks_leave_out_what_nothing_reaches_or_shows(seed: int) -> None:
    places = drawn(seed)
    table = numbers.ranks(places).set_index("place")
    for place in places[:2]:
        A, B, C, _ = place.model.matrices
        n, row = len(A), table.loc[place.name]
        reached = np.hstack([np.linalg.matrix_power(A, k) @ B for k in range(n)])
        shown = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(n)])
        wanted = np.linalg.matrix_rank(reached, tol=1e-6), np.linalg.matrix_rank(shown, tol=1e-6)
        assert (row["states"], row["controllable"], row["observable"]) == (n, *wanted)
        assert wanted == (n - 1, n - 1)
        assert row["growth"] == pytest.approx(np.linalg.eigvals(A).real.max())


@pytest.mark.parametrize("seed", range(4))
def test_responses_are_those_of_the_matrices(seed: int) -> None:
    places = drawn(seed)
    table = numbers.responses(places, OMEGA)
    assert len(table) == 2 * 2 * 3 * len(OMEGA)
    for (name, source, sink), own in table.groupby(["place", "input", "output"]):
        model = next(place.model for place in places if place.name == name)
        A, B, C, D = model.matrices
        j, i = model.inputs.index(source), model.outputs.index(sink)
        wanted = np.array([(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D)[i, j] for w in own["omega"]])
        found = own["magnitude"] * np.exp(1j * np.radians(own["phase"]))
        np.testing.assert_allclose(found, wanted, rtol=1e-9)
        assert np.abs(np.diff(own["phase"])).max() <= 180.0
        np.testing.assert_array_equal(own["omega"], OMEGA)


def test_equilibria_have_every_number_by_its_name() -> None:
    case, rng = cases.load("red_body"), np.random.default_rng(5)
    q, v, u, lam = (rng.normal(size=n) for n in (6, 6, 2, 2))
    v[::2] = 0.0
    trim = SimpleNamespace(q=q, v=v, u=u, lam=lam, active=np.array([1, 3]), outcome=Outcome.FINISHED, shared=(3,))
    q[2], lam[0] = 1e-15, -1e-106
    table = numbers.equilibria([SimpleNamespace(name="here", trim=trim)], case)
    assert set(zip(table["place"], table["outcome"], strict=True)) == {("here", "finished")}
    names = [c.name for c in case.coordinates]
    q[2], lam[0] = 0.0, 0.0  # what rounding leaves of them
    wanted = dict(zip(names, q, strict=True)) | {f"{names[i]}'": v[i] for i in (1, 3, 5)}
    wanted |= {"u[0]": u[0], "u[1]": u[1], f"lam {case.contacts[1]}": lam[0], f"lam {case.contacts[3]}": lam[1]}
    assert dict(zip(table["variable"], table["value"], strict=True)) == wanted
    assert table["variable"][table["shared"]].tolist() == [f"lam {case.contacts[3]}"]


@pytest.mark.parametrize("seed", range(4))
def test_a_bode_table_is_the_response_of_each_curve(seed: int) -> None:
    curves = []
    for k, place in enumerate(drawn(seed)[:2]):
        A, B, C, D = place.model.matrices
        model = replace(
            place.model,
            A=A - 3.0 * np.eye(len(A)),
            B=B[:, :1],
            C=C[:2],
            D=D[:2, :1],
            inputs=("in",),
            outputs=("f", "v"),
        )
        curves.append(bode.Curve(mode=("grasp", "free")[k], kstar=float(k), model=model))
    table, poles = bode.table(curves, OMEGA), bode.poles(curves)
    assert len(table) == 4 * len(OMEGA)
    for curve in curves:
        A, B, C, D = curve.model.matrices
        for i, output in enumerate(bode.OUTPUTS):
            own = table[(table["mode"] == curve.mode) & (table["output"] == output)]
            wanted = np.array([(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D)[i, 0] for w in OMEGA])
            np.testing.assert_allclose(own["magnitude"] * np.exp(1j * np.radians(own["phase"])), wanted, rtol=1e-9)
            assert set(own["unit"]) == {bode.UNITS[output]}
        values = np.linalg.eigvals(A)
        found = poles[poles["mode"] == curve.mode]
        assert np.sort_complex(found["real"] + 1j * found["imag"]) == pytest.approx(np.sort_complex(values))
        row = bode.growths(poles).set_index("mode").loc[curve.mode]
        assert row["growth"] == pytest.approx(values[np.argsort(np.abs(values))[2:]].real.max())


def lines_of(drawn_: Any) -> dict[tuple[str, str], Any]:
    """Lines of a figure by their names and the titles of their y axes."""
    axes = drawn_["layout"]
    return {(line["name"], axes[line["yaxis"].replace("y", "yaxis")]["title"]["text"]): line for line in drawn_["data"]}


def test_responses_are_drawn_over_their_frequencies_on_the_axes_that_say_so() -> None:
    table = numbers.responses(drawn(1), OMEGA)
    lines = lines_of(figure.response_figure(table))
    assert len(lines) == 2 * 2 * 2 * 3
    for (place, source, sink), own in table.groupby(["place", "input", "output"]):
        for value, title in (("magnitude", "magnitude [SI unit of output / of input]"), ("phase", "phase [deg]")):
            line = lines[f"{place}: {source} to {sink}", title]
            np.testing.assert_allclose(read(line["x"]), own["omega"])
            np.testing.assert_allclose(read(line["y"]), own[value], rtol=1e-6)


def test_bode_lines_stand_in_the_column_of_their_output_and_under_their_gain() -> None:
    rng, rows = np.random.default_rng(0), []
    for kstar in (0.0, 20.0):
        for output in bode.OUTPUTS:
            more = {"mode": "grasp", "kstar": kstar, "output": output, "unit": bode.UNITS[output], "omega": OMEGA}
            rows.append(pd.DataFrame({**more, "magnitude": rng.random(len(OMEGA)), "phase": rng.random(len(OMEGA))}))
    table = pd.concat(rows)
    drawn_ = figure.bode_figure(table)
    for line in drawn_["data"]:
        title = drawn_["layout"][line["yaxis"].replace("y", "yaxis")]["title"]["text"]
        column = int(line["yaxis"][1:] or 1) % 2
        output, value = bode.OUTPUTS[1 - column], title.split(" ")[0]
        own = table[(table["output"] == output) & (table["kstar"] == float(line["name"].split(" ")[2]))]
        np.testing.assert_allclose(read(line["y"]), own[value], rtol=1e-6)
        np.testing.assert_allclose(read(line["x"]), own["omega"])
        assert value == "phase" or bode.UNITS[output] in title
    assert len({(line["name"], line["yaxis"]) for line in drawn_["data"]}) == 8


@pytest.mark.parametrize("seed", range(2))
def test_poles_and_the_map_are_drawn_where_they_are(seed: int) -> None:
    table = numbers.poles(drawn(seed))
    for line in figure.pole_figure(table)["data"]:
        own = table[table["place"] == line["name"]]
        np.testing.assert_allclose([read(line["x"]), read(line["y"])], [own["real"], own["imag"]], rtol=1e-6)
    x, z = np.meshgrid([-0.1, 0.0, 0.2], [0.3, 0.5])
    growth = np.random.default_rng(seed).normal(size=6)
    mapped = pd.DataFrame({"x": x.ravel(), "z": z.ravel(), "growth": growth}).sample(frac=1.0, random_state=seed)
    for layer in figure.map_figure(mapped)["data"]:
        np.testing.assert_allclose(read(layer["x"]), [-0.1, 0.0, 0.2])
        np.testing.assert_allclose(read(layer["y"]), [0.3, 0.5])
        np.testing.assert_allclose(read(layer["z"]).reshape(2, 3), growth.reshape(2, 3), rtol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_poles_at_one_point_are_counted_beside_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = 10.0 * rng.normal(size=(5, 2))
    counts = rng.integers(1, 12, 5)
    poles = np.repeat(points, counts, axis=0) * (1.0 + 1e-13 * rng.normal(size=(int(counts.sum()), 2)))
    rows = pd.DataFrame({"place": "a", "real": poles[:, 0], "imag": poles[:, 1]})
    _, *told = figure.pole_figure(rows)["data"]  # type: ignore[index]
    assert [text for one in told for text in one["text"]] == [f"{count} poles" for count in counts if count > 1]


def test_the_page_of_an_analysis_has_its_values_and_poles_and_names_its_case(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as end:
        main(["analyse", "soft_contact", "--variant", "axis", "--out", str(tmp_path / "out"), "-q"])
    assert not end.value.code
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert re.search(r"<h1>[^<]* of soft_contact:axis</h1>", page)
    for stem, title in (("equilibria", "Values at the operating points"), ("poles", "Poles")):
        rows = json.loads((tmp_path / "out" / f"analysis-{stem}.json").read_text(encoding="utf-8"))["rows"]
        table = re.search(rf'data-csv="[^"]*-{title.replace(" ", "-")}"(.*?)</table>', page, re.DOTALL)
        assert table, title
        key = "value" if stem == "equilibria" else "real"
        assert [f'data-v="{row[key]}"' in table[1] for row in rows] == [True] * len(rows)
