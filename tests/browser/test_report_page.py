"""The report in a real browser: it loads without a network, moves, and prints."""

import base64
import json
import os
import re
import shutil
import time
import zlib
from itertools import pairwise

import numpy as np
import pytest

import impactfem
from impactfem import Result, Scene
from impactfem.shipped import shipped_scenes

pytestmark = pytest.mark.slow

REQUIRED = os.environ.get("IMPACTFEM_BROWSER") == "required"
ATTACK = "</script><script>document.body.textContent = 'taken over'</script>"

SCENES = {
    "bar": ("bar_impact", {"solve.method": "galerkin", "solve.elements": 10}),
    "unstable": ("bar_impact", {"solve.method": "newmark", "solve.elements": 20, "duration": 8.0}),
    "row": ("two_bars", {}),
    "disc": (
        "dropped_disc",
        {"body.disc.mesh_size": 0.03, "duration": 0.08, "solve.estimate": False,
         "output.every": 40},
    ),
    "corner": ("corner", {}),
    "oscillator": ("oscillator", {"duration": 1.0}),
    "beam": ("dropped_beam", {"duration": 1e-4, "solve.estimate": False}),
    "ball": (
        "elastic_sphere_3d",
        {"body.ball.mesh_size": 0.008, "body.ball.refine": None, "duration": 1.5e-3,
         "solve.estimate": False, "output.every": 2},
    ),
}  # fmt: skip
QUICK = ("bar", "row", "disc")  # of each kind of drawing one, but those in space


def slow(name):
    return pytest.param(name, marks=pytest.mark.slow)


def unavailable(reason):
    """A machine without a browser skips these tests; continuous integration must not."""
    if REQUIRED:
        pytest.fail(f"{reason}, but IMPACTFEM_BROWSER=required", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Chromium that finds no host, with its console and requests logged."""
    try:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service
    except ImportError:
        unavailable("selenium is not installed")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    door = shutil.which("chromedriver")
    if program is None or door is None:
        unavailable("chromium or chromedriver is not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    profile = tmp_path_factory.mktemp("profile")
    for argument in (
        "--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage", "--window-size=1000,1400", f"--user-data-dir={profile}",
        "--host-resolver-rules=MAP * ~NOTFOUND", "--force-color-profile=srgb",
    ):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(door))
    driver.set_page_load_timeout(60)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Results by name, each solved and written once."""
    made = {}

    def folder(name):
        if name not in made:
            scene, settings = SCENES[name]
            shown = {"output.film": False, **settings}
            result = impactfem.solve(Scene.from_toml(shipped_scenes()[scene]).with_settings(shown))
            made[name] = result.save(tmp_path_factory.mktemp(name) / "out")
        return made[name]

    return folder


def load(browser, page):
    """Open a page; nothing but itself is asked for, and the console stays free of errors."""
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(page.as_uri())
    wait(browser, "return document.documentElement.classList.contains('live')")
    for entry in browser.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            address = message["params"]["request"]["url"]
            assert address == page.as_uri() or address.startswith(("data:", "blob:")), address[:200]
    check_console(browser)


def check_console(browser):
    errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []


def wait(browser, condition, seconds=90.0):
    end = time.monotonic() + seconds
    while not browser.execute_script(condition):
        assert time.monotonic() < end, condition
        time.sleep(0.05)


READOUT = "return document.querySelector('.motion-readout').textContent"
PICTURE = "return document.querySelector('#motion-view canvas').toDataURL()"
FRAMES = "return JSON.parse(document.getElementById('motion-data').textContent)"


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in SCENES])
def test_the_page_loads_alone_and_its_charts_are_drawn(name, browser, folders):
    load(browser, folders(name) / "report.html")
    charts = browser.execute_script(
        "return JSON.parse(document.getElementById('charts-data').textContent).map(c => c.element)"
    )
    assert {"chart-gap", "chart-energy"} <= set(charts)
    # Bounces from walls have impulses only.
    assert ("chart-contact_force" in charts) is (name != "corner")
    for element in charts:
        drawn = f"document.querySelector('#{element} .main-svg') !== null"
        assert browser.execute_script(f"return {drawn}"), element
    # The contact force stands beside the motion; its chart is for print.
    shown = "return getComputedStyle(document.getElementById('figure-{}')).display"
    assert browser.execute_script(shown.format("gap")) == "block"
    assert name == "corner" or browser.execute_script(shown.format("contact_force")) == "none"
    assert not browser.execute_script("return document.getElementById('still').open")
    verdict = browser.execute_script("return document.getElementById('verdict').textContent")
    assert verdict.startswith("Do not trust this run" if name == "unstable" else "Trust this run")


@pytest.mark.parametrize("name", QUICK)
def test_screen_readers_and_keys_reach_all_of_the_page(name, browser, folders):
    axe_selenium_python = pytest.importorskip("axe_selenium_python")
    load(browser, folders(name) / "report.html")
    axe = axe_selenium_python.Axe(browser)
    axe.inject()
    found = [(rule["id"], rule["nodes"][0]["html"][:200]) for rule in axe.run()["violations"]]
    assert found == []


@pytest.mark.parametrize("name", [*QUICK, *map(slow, ["corner", "oscillator", "beam"])])
def test_the_slider_moves_time_force_and_body(name, browser, folders):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    load(browser, folders(name) / "report.html")
    frames = browser.execute_script(FRAMES)
    slider = browser.find_element(By.CSS_SELECTOR, "#motion-view input[type=range]")
    # At first it stands at the largest force.
    largest = max(frames["force"])
    shown = told(browser, r"contact force (\S+) (.?)N")
    assert shown == pytest.approx(largest, rel=1e-4, abs=1e-12)
    slider.send_keys(Keys.HOME)
    before, picture = browser.execute_script(READOUT), browser.execute_script(PICTURE)
    assert re.match(r"t = 0 [mµn]?s ", before)
    for _ in range(3):
        slider.send_keys(Keys.ARROW_RIGHT)
    assert shown_time(browser) == pytest.approx(frames["times"][3], rel=1e-4)
    # To the end by a script's event, as dragging gives it.
    browser.execute_script(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))",
        slider, len(frames["times"]) // 2,
    )  # fmt: skip
    middle = len(frames["times"]) // 2
    assert shown_time(browser) == pytest.approx(frames["times"][middle], rel=1e-4)
    force = told(browser, r"contact force (\S+) (.?)N")
    largest = max(abs(value) for value in frames["force"])
    assert force == pytest.approx(frames["force"][middle], rel=1e-4, abs=1e-8 * largest)
    assert browser.execute_script(PICTURE) != picture
    slider.send_keys(Keys.HOME)
    assert browser.execute_script(READOUT) == before
    check_console(browser)


PREFIXES = {"": 1.0, "n": 1e-9, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}


def told(browser, pattern):
    """A number of the readout in SI units, by a pattern of number and prefix."""
    number, prefix = re.search(pattern, browser.execute_script(READOUT)).groups()
    return float(number) * PREFIXES[prefix]


def shown_time(browser):
    return told(browser, r"t = (\S+) (.?)s")


def test_pressing_in_the_force_plot_jumps_there(browser, folders):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    load(browser, folders("bar") / "report.html")
    frames = browser.execute_script(FRAMES)
    area = browser.find_element(By.CSS_SELECTOR, "#motion-view .plotly .nsewdrag")
    ActionChains(browser).move_to_element_with_offset(area, 0, 0).click().perform()
    spacing = max(b - a for a, b in pairwise(frames["times"]))
    assert shown_time(browser) == pytest.approx(frames["times"][-1] / 2, abs=spacing)
    check_console(browser)


def test_small_motion_can_be_seen_at_its_true_scale(browser, folders):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import Select

    load(browser, folders("row") / "report.html")
    choice = Select(browser.find_element(By.CSS_SELECTOR, "#motion-view select"))
    magnified = browser.execute_script(PICTURE)
    choice.select_by_visible_text("1")
    assert browser.execute_script(PICTURE) != magnified
    load(browser, folders("bar") / "report.html")
    assert not browser.find_elements(By.CSS_SELECTOR, "#motion-view select")


@pytest.mark.slow
def test_a_body_in_space_moves_with_the_slider(browser, folders):
    load(browser, folders("ball") / "report.html")
    last = len(browser.execute_script(FRAMES)["times"]) - 1
    # Heights of the mesh that is drawn, in sizes of the body.
    heights = "return Array.from(document.querySelector('#motion-view .js-plotly-plot').data[0].y)"
    move = (
        "const s = document.querySelector('#motion-view input[type=range]');"
        "s.value = arguments[0]; s.dispatchEvent(new Event('input'))"
    )
    browser.execute_script(move, 0)
    before = browser.execute_script(heights)
    browser.execute_script(move, last)
    fields = Result.load(folders("ball")).fields
    top = [(fields.points + fields.read(k)["displacement"])[:, 1].max() for k in (0, -1)]
    size = float(np.ptp(fields.points, axis=0).max())
    assert max(before) == pytest.approx(top[0] / size, rel=1e-3)
    assert max(browser.execute_script(heights)) == pytest.approx(top[1] / size, rel=1e-3)
    check_console(browser)


def test_playing_goes_on_and_stops(browser, folders):
    from selenium.webdriver.common.by import By

    load(browser, folders("bar") / "report.html")
    button = browser.find_element(By.XPATH, "//*[@id='motion-view']//button[text()='Play']")
    first = shown_time(browser)
    button.click()
    wait(browser, f"{READOUT}.startsWith('t = 0 s') === false")
    button.click()
    assert shown_time(browser) < first  # it began at t = 0, not at the largest force
    stopped = browser.execute_script(READOUT)
    time.sleep(0.3)
    assert browser.execute_script(READOUT) == stopped


@pytest.mark.parametrize("name", ["bar", "disc", "corner"])
def test_it_prints_a_few_pages_of_text_and_vector_charts(name, browser, folders):
    load(browser, folders(name) / "report.html")
    document = base64.b64decode(browser.print_page())
    pages = len(re.findall(rb"/Type\s*/Page\b", document))
    assert 3 <= pages <= 14
    content = b""
    for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", document, re.DOTALL):
        try:
            content += zlib.decompress(stream)
        except zlib.error:
            continue
    # Words are words and lines are lines: operators that show text and that stroke paths.
    assert len(re.findall(rb"\bT[jJ]\b", content)) > 200
    assert len(re.findall(rb"\bS\b", content)) > 20
    check_console(browser)


def test_nothing_sticks_out_of_a_narrow_window(browser, folders):
    browser.set_window_size(500, 1400)
    try:
        for name in ("bar", "disc", "beam"):
            load(browser, folders(name) / "report.html")
            beyond = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
            assert browser.execute_script(f"return {beyond}") <= 0, name
    finally:
        browser.set_window_size(1000, 1400)


def test_a_title_with_markup_is_shown_as_it_is(browser, folders, tmp_path):
    run = Result.load(folders("bar"))
    scene = run.scene.with_settings({"title": ATTACK})
    strange = Result(scene, run.history, {**run.summary, "title": ATTACK}, run.fields, run.exact)
    load(browser, strange.save(tmp_path / "out") / "report.html")
    assert browser.execute_script("return document.querySelector('h1').textContent") == ATTACK
    assert browser.title == ATTACK


def test_without_scripts_the_pictures_are_there(browser, folders):
    page = folders("bar") / "report.html"
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.get(page.as_uri())
        from selenium.webdriver.common.by import By

        pictures = browser.find_elements(By.CSS_SELECTOR, "#still img")
        assert len(pictures) == len(list(page.parent.glob("*.png")))
        assert all(picture.is_displayed() for picture in pictures)
        assert not browser.find_element(By.ID, "motion-view").is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
