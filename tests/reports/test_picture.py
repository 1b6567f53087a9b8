"""Pictures by command: what is drawn stands where the motion is and pushes as hard as it does."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from crossbody.cases import InvalidValue, load
from crossbody.engines import load as load_engine
from crossbody.reports.cli import main
from crossbody.reports.figures.styles import look
from crossbody.reports.pages import picture
from crossbody.reports.pages.picture import FORCE, HEIGHT, PUSH, Film
from crossbody.reports.runs import study
from crossbody.reports.runs.store import Trace


def film(name: str, variant: str) -> Film:
    case = load(name, variant)
    run = load_engine("reference").prepare(case, "compiled").run()
    return Film(Trace(about=study._about(case, "reference", "compiled"), run=run))


@pytest.fixture(scope="module")
def ball() -> Film:
    return film("bouncing_ball", "linear")


@pytest.mark.parametrize("t", [0.0, 0.1234, 0.7, 1.5, 4.9])
def test_a_ball_is_as_far_above_its_floor_as_its_gap(ball: Film, t: float) -> None:
    floor, body, *_ = ball.at(t)
    height = floor.points[:, 1].min() - body.points[:, 1].max()
    wanted = np.interp(t, *(np.delete(part, np.flatnonzero(np.diff(ball.t) == 0.0)) for part in (ball.t, ball.q[:, 0])))
    assert height / ball.to.scale == pytest.approx(wanted, abs=2e-4)


def test_a_force_is_drawn_while_it_pushes_and_as_long_as_it_is(ball: Film) -> None:
    lam = ball.run.lam[:, 0]
    for k in np.linspace(0, len(ball.run.t) - 2, 60).astype(int):
        if ball.run.t[k] == ball.run.t[k + 1]:
            continue
        lines = [one for one in ball.at(float(ball.run.t[k])) if one.color == PUSH and not one.fill]
        wanted = FORCE * HEIGHT * lam[k] / lam.max()
        assert bool(lines) == (wanted >= 2.0)
        if lines:
            assert np.linalg.norm(np.diff(lines[0].points, axis=0)) == pytest.approx(wanted, rel=1e-9)


def test_in_space_a_plane_and_a_solid_are_drawn_around_the_middle() -> None:
    made = film("sliding_block", "askew")
    for t in (0.0, 0.3):
        strokes = [one for one in made.at(t) if one.color != PUSH]
        assert len(strokes) == 2
        for one in strokes:
            centre = one.points.mean(axis=0) / (picture.WIDTH, HEIGHT)
            assert (centre > 0.2).all()
            assert (centre < 0.8).all()


@pytest.mark.parametrize("t", [0.0, 0.46, 4.9])
def test_a_picture_says_whose_it_is_and_when_and_how_long_a_metre_is(ball: Film, t: float) -> None:
    strokes, texts = ball.legend(t)
    said = [one.text for one in texts]
    assert said[:2] == ["bouncing_ball:linear, reference:compiled", f"t = {t:.4f} s"]
    assert strokes[0].color == look("reference:compiled")["color"]
    scales = {"m": ball.to.scale, "N": FORCE * HEIGHT / ball.force}
    assert [text.split()[1] for text in said[2:]] == list(scales)
    for bar, text in zip(strokes[1:], said[2:], strict=True):
        value, unit = text.split()
        assert np.ptp(bar.points[:, 0]) == pytest.approx(float(value) * scales[unit], rel=1e-9)
        assert 60.0 <= np.ptp(bar.points[:, 0]) <= 150.0
    assert all(0.0 < one.x < picture.WIDTH and 0.0 < one.y < HEIGHT for one in texts)


@pytest.mark.parametrize("name", ["bouncing_ball:linear", "rolling_sphere:straight"])
def test_what_is_round_is_a_circle(name: str) -> None:
    """In a file of lines, and of as many pixels as it is large."""
    made = film(*name.split(":"))
    (circle,) = [one for one in made.at(0.0) if one.radius]
    assert np.linalg.norm(circle.points - circle.centre, axis=1) == pytest.approx(circle.radius, rel=1e-3)
    assert f'r="{circle.radius:.2f}"' in picture.svg([circle])


def test_files_of_every_kind(ball: Film, tmp_path: Path) -> None:
    for suffix in picture.SUFFIXES:
        picture.write(ball, tmp_path / f"ball{suffix}", None, 4.0, 1.0)
    text = (tmp_path / "ball.svg").read_text()
    assert re.match(r"<svg [^>]*viewBox", text)
    assert text.count("<poly") + text.count("<circle") == len(ball.at(0.0)) + len(ball.legend(0.0)[0])
    with Image.open(tmp_path / "ball.gif") as gif, Image.open(tmp_path / "ball.png") as still:
        assert still.size == gif.size == (picture.WIDTH, HEIGHT)
        assert 10 < gif.n_frames <= 21
        first = np.asarray(gif.convert("RGB"), dtype=float)
        assert np.abs(first - np.asarray(still, dtype=float)).mean() < 1.0
        gif.seek(3)
        assert np.abs(first - np.asarray(gif.convert("RGB"), dtype=float)).max() > 50.0


@pytest.mark.parametrize(("name", "t"), [("x.bmp", 0.0), ("x.svg", -1.0), ("x.svg", 99.0), ("x.gif", 0.0)])
def test_what_cannot_be_drawn_is_refused(ball: Film, tmp_path: Path, name: str, t: float) -> None:
    with pytest.raises(InvalidValue, match=r"valid: \.svg|lasts from 0 to|the whole motion"):
        picture.write(ball, tmp_path / name, t, 25.0, 1.0)
    assert not list(tmp_path.iterdir())


def code_of(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main([*arguments])
    return ended.value.code


def test_the_command_draws_a_stored_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    assert code_of("run", "bouncing_ball", "--variant", "linear", "-e", "reference:compiled", "--out", out) == 0
    assert code_of("picture", out, str(tmp_path / "a.svg"), "--at", "0.5") == 0
    assert (tmp_path / "a.svg").read_text().startswith("<svg")
    capsys.readouterr()
    assert code_of("picture", out, str(tmp_path / "a.png"), "--json") == 0
    assert json.loads(capsys.readouterr().out) == {"picture": str(tmp_path / "a.png")}
    assert code_of("picture", out, str(tmp_path / "b.svg"), "-e", "nobody") == 2
    assert "truth, reference:compiled" in capsys.readouterr().err
    assert not (tmp_path / "b.svg").is_file()


def test_a_folder_of_several_cases_is_asked_which_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, made = str(tmp_path / "out"), tmp_path / "a.svg"
    labels = ("bouncing_ball:linear", "bouncing_ball:resting")
    assert code_of("run", *labels, "-e", "reference:compiled", "--out", out) == 0
    assert code_of("picture", out, str(made)) == 2
    assert f"choose one with --case: {', '.join(labels)}." in " ".join(capsys.readouterr().err.split())
    assert not made.exists()
    assert code_of("picture", out, str(made), "--case", labels[1]) == 0
    assert made.is_file()
