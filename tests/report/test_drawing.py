"""What is drawn unasked, what it is said to cost, and that no picture is drawn twice."""

from dataclasses import replace

import pytest
from matplotlib.figure import Figure
from PIL import Image

from impactfem.planning import plan
from impactfem.planning.drawing import choose_film, drawing_seconds
from impactfem.report.sheet import Sheet, write_png
from impactfem.scene import Output, Scene
from impactfem.shipped import shipped_scenes


@pytest.mark.parametrize(
    ("asked", "seconds", "filmed", "why"),
    [
        (None, 0.8, False, "output.film = true"),  # a film of a solid takes 1.6 s
        (None, 3.2, True, "cheap"),
        (None, None, False, "output.film = true"),
        (True, 0.0, True, "as asked"),
        (False, 1e3, False, "as asked"),
    ],
)
def test_films_only_where_asked_or_cheap(asked, seconds, filmed, why):
    scene = Scene.from_toml(shipped_scenes()["dropped_disc"])
    scene = replace(scene, output=Output(film=asked))
    found, reason = choose_film(scene, seconds)
    assert found is filmed
    assert why in reason
    costs = [drawing_seconds(scene, film=film) for film in (False, found)]
    assert (costs[1] > costs[0]) is filmed


def test_films_of_bars_are_cheap_and_the_plan_says_so():
    made = plan(Scene.from_toml(shipped_scenes()["bar_impact"]))
    assert made.film
    assert "cheap" in made.reasons["film"]


def test_pictures_are_drawn_once_and_as_savefig_draws_them(tmp_path, monkeypatch):
    figure = Sheet(3.0, 2.0)
    figure.add_subplot().plot([0.0, 1.0], [2.0, 5.0], label="curve")
    figure.savefig(tmp_path / "a.png", dpi=130)
    drawn, draw = [], Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda *given: drawn.append(1) or draw(*given))
    write_png(figure, tmp_path / "b.png")
    assert drawn == [1]
    assert figure.dpi == 100.0
    images = [Image.open(tmp_path / f"{name}.png").convert("RGB") for name in "ab"]
    assert images[0].tobytes() == images[1].tobytes()
