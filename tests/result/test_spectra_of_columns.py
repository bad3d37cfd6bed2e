"""Spectra of columns: amplitudes, and shock response by its closed form."""

import json

import numpy as np
import pytest

import impactfem
from impactfem.cli import main
from impactfem.errors import SceneError
from impactfem.result.spectrum import shock_response, spectrum
from impactfem.result.table import Series, Table
from impactfem.runs.tones import natural_frequencies
from impactfem.shipped import shipped_scenes


def history(times, unit="m/s^2", **columns):
    attrs = {"units": unit}
    return Table.over_time(
        times, {name: Series(("time",), values, attrs) for name, values in columns.items()}
    )


def half_sine(frequency, q, length):
    """Maximax answer to sin(pi t / length) by its closed form, peaks found among many times."""
    z, w, big = 0.5 / q, 2.0 * np.pi * frequency, np.pi / length
    root = w * np.sqrt(1.0 - z * z)
    r = big / w
    size = (1.0 - r * r) ** 2 + (2.0 * z * r) ** 2
    # Absolute acceleration 2 z w y' + w^2 y of y'' + 2 z w y' + w^2 y = 2 z w u' + w^2 u, x = w^2 y
    # with z'' + 2 z w z' + w^2 z = u'' in place of it: z = a sin + b cos + free vibration.
    a = (1.0 - r * r) / (w * w * size)
    b = -2.0 * z * r / (w * w * size)

    def answer(t):
        """Of an oscillator w'' + 2 z w' + w^2 = sin(big t) at rest at t = 0, and its rate."""
        e = np.exp(-z * w * t)
        c1, c2 = -b, (-a * big - z * w * b) / root
        free = e * (c1 * np.cos(root * t) + c2 * np.sin(root * t))
        c, d = root * c2 - z * w * c1, root * c1 + z * w * c2
        rate = e * (c * np.cos(root * t) - d * np.sin(root * t))
        place = a * np.sin(big * t) + b * np.cos(big * t) + free
        return place, a * big * np.cos(big * t) - b * big * np.sin(big * t) + rate

    def felt(place, rate):
        return 2.0 * z * w * rate + w * w * place

    during = felt(*answer(np.linspace(0.0, length, 20001)))
    x, v = answer(length)
    t = np.linspace(0.0, 1.0 / frequency, 20001)
    e = np.exp(-z * w * t)
    c2 = (v + z * w * x) / root
    place = e * (x * np.cos(root * t) + c2 * np.sin(root * t))
    rate = -z * w * place + e * root * (c2 * np.cos(root * t) - x * np.sin(root * t))
    after = felt(place, rate)
    return np.abs(np.concatenate([during, after])).max()


@pytest.mark.parametrize("q", [10.0, 50.0, 1.0])
def test_the_shock_response_of_a_half_sine_is_its_closed_form(q):
    length, count = 0.011, 200
    times = np.arange(2 * count + 1) * length / count
    pulse = np.where(times < length, np.sin(np.pi * times / length), 0.0)
    found = spectrum(history(times, a=pulse), "a", q)
    exact = np.array([half_sine(f, q, length) for f in found.shock_frequencies])
    assert found.shock == pytest.approx(exact, rel=1e-3)
    assert found.shock_frequencies[-1] >= 0.99 / (10.0 * times[1])
    if q == 10.0:
        assert found.shock.max() == pytest.approx(1.65, abs=0.01)  # of textbooks


def test_the_recursion_is_exact_for_what_is_linear_between_samples():
    """A base of constant acceleration that starts at once, as a ramp of one step."""
    step, frequency = 1e-3, 3.0
    found = shock_response(np.full(2000, 2.0), step, [frequency], 1e9)
    w = 2.0 * np.pi * frequency
    overshoot = np.sin(0.5 * w * step) / (0.5 * w * step)
    assert found[0, 0] == pytest.approx(2.0 * (1.0 + overshoot), rel=1e-4)
    assert found[0, 1] <= 0.0


def test_amplitudes_are_those_of_the_sines_that_add_up():
    times = np.arange(1000) * 1e-3
    told = 0.25 + 3.0 * np.sin(2 * np.pi * 50.0 * times) + 0.5 * np.cos(2 * np.pi * 120.0 * times)
    found = spectrum(history(times, "m", x=told), "x")
    at = dict(zip(np.round(found.frequencies, 6), found.amplitudes, strict=True))
    assert [at[0.0], at[50.0], at[120.0]] == pytest.approx([0.25, 3.0, 0.5], rel=1e-9)
    assert found.figures()["fft"]["peak_frequency"] == pytest.approx(50.0)
    assert not len(found.shock)
    uneven = np.delete(times, np.arange(10, 900, 7))
    other = spectrum(history(uneven, "m", x=np.interp(uneven, times, told)), "x")
    assert other.resampled
    assert other.figures()["fft"]["peak"] == pytest.approx(3.0, rel=2e-2)


@pytest.mark.parametrize(
    ("column", "q", "words"),
    [("b", None, "no column"), ("a", 0.5, "q = 0.5"), ("gap", None, "without a number")],
)
def test_columns_without_a_spectrum_are_refused(column, q, words):
    times = np.arange(20) * 1e-3
    with pytest.raises(SceneError, match=words):
        spectrum(history(times, a=times, gap=np.full(20, np.nan)), column, q)
    with pytest.raises(SceneError, match="one of accelerations"):
        spectrum(history(times, "m", x=times), "x", 10.0)


def test_modes_of_bodies_are_those_of_theory():
    scene = impactfem.Scene.from_toml(shipped_scenes()["dropped_beam"])
    beam = scene.bodies[0]
    found = natural_frequencies(scene, beam.name)
    speed = np.sqrt(beam.youngs_modulus * beam.height**2 / (12.0 * beam.density))
    assert found[0] == pytest.approx(4.730041**2 * speed / (2 * np.pi * beam.length**2), rel=2e-2)
    bar = impactfem.Scene.from_toml(shipped_scenes()["bar_impact"])
    body = bar.bodies[0]
    assert natural_frequencies(bar, "bar")[0] == pytest.approx(body.wave_speed / 2 / body.length)
    with pytest.raises(SceneError, match="no body"):
        natural_frequencies(bar, "rod")


def test_the_command_writes_tables_picture_and_figures(tmp_path, capsys):
    block = {"kind": "solid", "name": "block", "model": "plane_stress", "density": 1.0,
             "youngs_modulus": 100.0, "poisson_ratio": 0.0, "mesh_size": 0.05, "degree": 2,
             "shape": {"kind": "block", "size": [1.0, 0.1], "corner": [0.0, 0.0]},
             "displacement": ["1e-3*sin(pi*(x-0.5))", "0"]}  # fmt: skip
    scene = impactfem.Scene.from_dict(
        {"title": "rings", "duration": 1.0, "body": [block], "output": {"fields": []},
         "obstacle": [{"kind": "half_space", "name": "far", "point": [0, -9], "normal": [0, 1]}],
         "solve": {"estimate": False},
         "probe": [{"name": "end", "body": "block", "point": [1.0, 0.05],
                    "quantities": ["displacement", "acceleration"]}]}
    )  # fmt: skip
    impactfem.solve(scene).save(tmp_path / "run", pictures=False)
    assert main(["spectrum", str(tmp_path / "run"), "--column", "end.ux", "--modes", "block"]) == 0
    told = json.loads((tmp_path / "run_spectrum" / "summary.json").read_text())
    # The rod's first free-free mode c / 2 L = 5 Hz.
    assert told["fft"]["peak_frequency"] == pytest.approx(5.0, abs=told["fft"]["resolution"])
    assert np.abs(np.array(told["modes"]["frequencies"]) - 5.0).min() < 0.02
    names = {path.name for path in (tmp_path / "run_spectrum").iterdir()}
    assert names == {"fft.csv", "modes.csv", "spectrum.png", "summary.json"}
    out = tmp_path / "srs"
    words = ["spectrum", str(tmp_path / "run"), "--column", "end.ax", "--srs", "--q", "25"]
    assert main([*words, "--out", str(out)]) == 0
    rows = np.genfromtxt(out / "srs.csv", delimiter=",", names=True)
    assert (rows["maximax"] >= rows["highest"]).all()
    assert main(["spectrum", str(tmp_path / "run"), "--column", "end.ux", "--srs"]) == 2
    own = ["--out", str(tmp_path / "run")]
    assert main(["spectrum", str(tmp_path / "run"), "--column", "end.ux", *own]) == 2
    assert main(["spectrum", str(tmp_path / "none"), "--column", "end.ux"]) == 2
    capsys.readouterr()
