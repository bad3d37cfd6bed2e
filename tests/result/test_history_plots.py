"""Histories carry units and names in all kinds of runs, and plots show them."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.shipped import shipped_scenes

# A short run of each kind: bar, row, points in one and two dimensions, beam, solid, with friction.
SHORT = {
    "bar_impact": {"solve.method": "galerkin"},
    "two_bars": {},
    "bouncing_ball": {},
    "corner": {},
    "dropped_beam": {"duration": 1e-4},
    "elastic_sphere": {"duration": 1e-4, "solve.estimate": False, "body.ball.refine": []},
    "sliding_block": {"duration": 2e-3},
}
UNITS = {"m", "m/s", "N", "N s", "J", "kg m/s", "kg m^2/s", "N m", "rad", "rad/s", "1", "s"}


def short_run(name):
    scene = impactfem.Scene.from_toml(shipped_scenes()[name])
    return impactfem.solve(scene.with_settings(SHORT[name]))


@pytest.fixture(scope="module", params=SHORT)
def run(request):
    return short_run(request.param)


@pytest.fixture(scope="module")
def bar():
    return short_run("bar_impact")


def test_every_column_has_a_unit_and_a_short_name(run):
    for data in (run.history, run.exact):
        for name, column in {} if data is None else data.variables.items():
            assert column.attrs["units"] in UNITS, name
            assert 2 < len(column.attrs["long_name"]) < 60, name
    for name, column in run.history.data_vars.items():
        last = "" if "momentum" in name else name.split(".")[-1]
        expected = {"x": "m", "vx": "m/s", "gap": "m", "contact_force": "N", "active": "1"}
        assert column.attrs["units"] == expected.get(last, column.attrs["units"])


def test_figures_are_drawn_one_by_one(run):
    together = run.plot()
    assert run.figures == tuple(together)
    for name in run.figures:
        alone = run.figure(name)
        titles = [axes.get_title() for axes in alone.axes]
        assert titles == [axes.get_title() for axes in together[name].axes]


def test_the_history_plots_itself_with_units(bar):
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    bar.history["contact_force"].plot(ax=axes)
    assert axes.get_ylabel() == "contact force [N]"
    assert axes.get_xlabel() == "time [s]"


def test_columns_of_one_unit_share_axes(bar):
    names = ("gap", "kinetic_energy", "total_energy", "bar.x", "contact_force")
    length, energy, force = bar.plot_history(*names).axes
    assert length.get_ylabel() == "length [m]"
    assert energy.get_ylabel() == "energy [J]"
    assert force.get_ylabel() == "contact force [N]"
    assert force.get_xlabel() == "time [s]"
    assert len(energy.lines) == 2
    gap = length.lines[0]
    assert np.array_equal(gap.get_xdata(), bar.history["time"].values)
    assert np.array_equal(gap.get_ydata(), bar.history["gap"].values)


def test_the_force_of_a_layer_is_drawn_during_it(bar):
    (line,) = bar.plot_history("contact_force").axes[0].lines
    assert line.get_drawstyle() == "steps-pre"  # from the row before up to its own
    assert np.array_equal(line.get_ydata()[1:], bar.history["contact_force"].values[1:])


def test_without_names_gap_force_and_energies_are_drawn(bar):
    assert [axes.get_ylabel() for axes in bar.plot_history().axes] == [
        "gap [m]", "contact force [N]", "energy [J]",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("given", "meant"), [("contact_forc", "contact_force"), ("kinetic", "kinetic_energy")]
)
def test_unknown_columns_are_told_with_the_nearest(bar, given, meant):
    with pytest.raises(SceneError, match=f'no column "{given}"; did you mean .*{meant}'):
        bar.plot_history("gap", given)


def test_unknown_columns_without_a_near_one_list_all(bar):
    with pytest.raises(SceneError, match="give one of gap, contact_force"):
        bar.plot_history("qqqqqqq")


def test_unknown_figures_are_told_with_the_nearest(bar):
    with pytest.raises(SceneError, match=r'figure "energie" is none .* did you mean "energy"'):
        bar.figure("energie")


def test_a_figure_costs_no_other(bar, monkeypatch):
    from impactfem.report import figures

    drawn = []
    monkeypatch.setattr(figures, "panel_figure", lambda _, panel: drawn.append(panel.name))
    with pytest.raises(SceneError):  # nothing was made
        bar.figure("energy")
    assert drawn == ["energy"]
