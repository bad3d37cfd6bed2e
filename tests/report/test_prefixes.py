"""Units get the prefix that suits what is shown."""

import numpy as np
import pytest

from impactfem.report.page.chart_units import prefixed_map, prefixed_panel
from impactfem.report.panel import Curve, Map, Panel
from impactfem.report.prefixes import prefix_ticks, prefixed_unit, unit_of
from impactfem.report.sheet import Sheet


@pytest.mark.parametrize(
    ("unit", "most", "factor", "shown"),
    [
        ("m", 1.23e-5, 1e6, "µm"),
        ("m", 0.0, 1.0, "m"),
        ("m", np.nan, 1.0, "m"),
        ("s", 0.5, 1.0, "s"),
        ("s", 0.05, 1e3, "ms"),
        ("s", 9.999999e-4, 1e3, "ms"),  # six digits would show 1000 µs
        ("N", 9999.0, 1.0, "N"),
        ("N", -2.5e7, 1e-6, "MN"),
        ("Pa", 2.1e11, 1e-9, "GPa"),
        ("N s", 3e-4, 1e6, "µN s"),
        ("m/s", 2e-3, 1e3, "mm/s"),
        ("kg m/s", 2e-9, 1e9, "µg m/s"),
        ("kg m/s", 20.0, 1.0, "kg m/s"),
        ("m/m", 2e-5, 1e6, "µm/m"),
        ("m", 1e-30, 1e15, "fm"),
        ("1", 1e-5, 1.0, "1"),
    ],
)
def test_the_largest_number_chooses_the_prefix(unit, most, factor, shown):
    found = prefixed_unit(unit, [0.0, most], [])
    assert found.unit == shown
    assert found.factor == pytest.approx(factor, rel=1e-12)


def test_ticks_of_a_picture_are_short_numbers_in_the_unit_of_its_title():
    axes = Sheet(4.0, 3.0).add_subplot()
    axes.plot([0.0, 4e-5], [-3e7, 3e7])
    axes.set_xlim(0.0, 4e-5)
    prefix_ticks(axes.xaxis, "time [s]")
    prefix_ticks(axes.yaxis, "contact force [N], × 2")
    axes.figure.canvas.draw()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [µs]", "contact force [MN], × 2")
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["0", "10", "20", "30", "40"]
    assert "\N{MINUS SIGN}20" in [tick.get_text() for tick in axes.get_yticklabels()]
    assert not axes.xaxis.get_offset_text().get_text()


def test_axes_of_logarithms_keep_their_unit():
    axes = Sheet(4.0, 3.0).add_subplot()
    axes.set_yscale("log")
    axes.plot([1.0, 2.0], [1e-7, 1e-5])
    prefix_ticks(axes.yaxis, "impact speed [m/s]")
    assert axes.get_ylabel() == "impact speed [m/s]"


def test_all_numbers_of_a_panel_follow_its_titles():
    told = "t = %{x:.7g} s<br>%{y:.6g} m/s<br>impulse %{customdata:.6g} N s"
    x, y, beside = np.array([0.0, 2e-6]), np.array([0.002, -0.004]), np.array([5e-8, 7e-8])
    plain = Curve("a", x, 0.1 * y, "m/s")
    curves = [Curve("b", x, y, "m/s", beside=beside, told=told), plain]
    panel = Panel("p", "P", "C.", curves, "speed [m/s]", span=(0.0, 2e-6), shaded=[[0.0, 1e-6]])
    shown = prefixed_panel(panel)
    assert (shown.x, shown.y) == ("time [µs]", "speed [mm/s]")
    assert shown.curves[0].told == (
        "t = %{x:.7g} µs<br>%{y:.6g} mm/s<br>impulse %{customdata:.6g} nN s"
    )
    assert shown.curves[1].told == "t = %{x:.6g} µs<br>%{y:.6g} mm/s"
    assert shown.curves[0].x == pytest.approx([0.0, 2.0])
    assert shown.curves[1].y == pytest.approx([0.2, -0.4])
    assert shown.curves[0].beside == pytest.approx([50.0, 70.0])
    assert shown.span == pytest.approx((0.0, 2.0))
    assert shown.shaded[0] == pytest.approx([0.0, 1.0])


def test_a_path_has_one_unit_along_both_axes():
    curves = [Curve("a", np.array([0.0, 2.0]), np.array([0.0, 2e-3]), "m")]
    shown = prefixed_panel(Panel("p", "P", "C.", curves, "y [m]", "x [m]", equal=True))
    assert (shown.x, shown.y) == ("x [m]", "y [m]")


def test_maps_scale_times_places_and_values():
    touching = [Curve("contact", np.array([0.0, 1e-4]), np.array([0.0, 0.01]), "m")]
    shown = prefixed_map(
        Map("m", "M", "C.", np.array([0.0, 1e-4]), np.array([0.0, 0.02]), np.full((2, 2), 3e-4),
            "strain [m/m]", "x [m]", touching=touching)
    )  # fmt: skip
    assert [unit_of(title) for title in (shown.x, shown.y, shown.label)] == ["µs", "mm", "µm/m"]
    assert shown.values == pytest.approx(np.full((2, 2), 300.0))
    assert shown.touching[0].y == pytest.approx([0.0, 10.0])
