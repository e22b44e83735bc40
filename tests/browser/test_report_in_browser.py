"""The report as a reader uses it: sorted, filtered, zoomed, offline, by mouse and by keyboard."""

import pytest

import gripbench
from gripbench.bench.publishing.report.page import write_report

pytestmark = pytest.mark.browser

METHODS = ["slip_slope", "individual_wheel_torque", "proposed_observer", "dugoff_ekf"]
RANGE = "document.getElementById('series-plot').layout.xaxis.range.map(Number)"
WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    pytest.importorskip("plotly", reason="the report needs the extra 'report'")
    folder = tmp_path_factory.mktemp("results")
    scenarios = ["li2014_constant_mu", "li2014_friction_step"]
    gripbench.run(scenarios=scenarios, methods=METHODS, seeds=2, results=folder, workers=1)
    return write_report(folder, folder / "report.html", shown_seeds=2, band_seeds=2).as_uri()


@pytest.fixture
def open_page(browser, address):
    """Open the report offline; in the end no network was asked for anything, nothing complained."""
    contexts, complaints = [], []

    def opened(viewport=WIDE, scheme="light"):
        context = browser.new_context(viewport=viewport, color_scheme=scheme)
        contexts.append(context)
        context.set_offline(True)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "request",
            lambda request: (
                request.url.startswith(("file:", "data:", "blob:"))
                or complaints.append(f"asked for {request.url}")
            ),
        )
        page.goto(address)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert complaints == []


def column(page, heading):
    """Return the shown values of a column of the visible board, from top to bottom."""
    return page.evaluate(
        """heading => {
            const table = document.querySelector(".board:not([hidden]) table");
            const index = [...table.tHead.rows[0].cells]
                .findIndex(cell => cell.textContent.startsWith(heading));
            return [...table.tBodies[0].rows].filter(row => !row.hidden)
                .map(row => row.cells[index].dataset.value ?? row.cells[index].textContent);
        }""",
        heading,
    )


def drawn(page, name):
    page.locator(f"#{name}").scroll_into_view_if_needed()
    page.wait_for_selector(f"#{name} .main-svg")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("viewport", [WIDE, NARROW], ids=["wide", "narrow"])
def test_every_plot_is_drawn_and_the_page_fits_its_window(open_page, viewport, scheme):
    page = open_page(viewport, scheme)
    for name in ("map-plot", "series-plot", "front-plot"):
        drawn(page, name)
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert page.evaluate("document.documentElement.dataset.theme") == scheme


def test_a_heading_sorts_the_board_both_ways(open_page):
    page = open_page()
    heading = page.locator(".board:not([hidden]) th button", has_text="RMS [").first
    heading.click()
    rising = [float(value) for value in column(page, "RMS [")]
    assert len(rising) == 3
    assert rising == sorted(rising)
    heading.click()
    assert [float(value) for value in column(page, "RMS [")] == rising[::-1]
    heading.focus()
    page.keyboard.press("Enter")
    assert [float(value) for value in column(page, "RMS [")] == rising


def test_sensors_and_text_filter_the_boards(open_page):
    page = open_page()
    assert len(column(page, "Method")) == 3
    offered = page.locator("#board-sensors option").evaluate_all("all => all.map(o => o.value)")
    chosen = next(value for value in offered if value != "any" and "GPS" not in value)
    page.select_option("#board-sensors", chosen)
    assert column(page, "Method") == ["proposed_observer"]
    page.select_option("#board-sensors", "any")
    page.fill("#board-text", "SLIP")
    assert column(page, "Method") == ["slip_slope"]
    assert page.text_content("#board-status") == "1 of 3 methods shown"


def test_both_panels_of_the_series_zoom_together(open_page):
    page = open_page()
    drawn(page, "series-plot")
    assert page.evaluate(RANGE) == [0, 30]
    page.fill("#series-from", "9")
    page.fill("#series-to", "12")
    page.keyboard.press("Tab")
    assert page.evaluate(RANGE) == [9, 12]
    page.click("#series-all")
    page.wait_for_function(f"Math.abs({RANGE}[1] - 30) < 3")
    box = page.locator(
        "#series-plot .xy .nsewdrag, #series-plot .nsewdrag.drag"
    ).first.bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"], steps=8)
    page.mouse.up()
    page.wait_for_function(f"{RANGE}[1] - {RANGE}[0] < 15")
    low, high = page.evaluate(RANGE)
    assert low == pytest.approx(9.0, abs=1.0)
    assert high == pytest.approx(18.0, abs=1.0)
    assert page.evaluate("document.getElementById('series-plot').layout.xaxis.anchor") == "y2"


def test_scenario_seed_and_methods_choose_the_curves(open_page):
    page = open_page()
    drawn(page, "series-plot")
    names = (
        "document.getElementById('series-plot').data"
        ".filter(trace => trace.showlegend !== false).map(trace => trace.name)"
    )
    page.select_option("#series-scenario", "li2014_friction_step")
    page.select_option("#series-target", "mu_front")
    page.select_option("#series-seed", "1")
    assert set(page.evaluate(names)) == {"Truth", *METHODS[:3]}
    page.uncheck('#series-methods input[value="slip_slope"]')
    assert set(page.evaluate(names)) == {"Truth", *METHODS[1:3]}
    truth = page.evaluate("document.getElementById('series-plot').data[0].y")
    assert min(truth) == pytest.approx(0.5, abs=1e-4)
    assert max(truth) == pytest.approx(0.9, abs=1e-4)


def test_the_theme_can_be_changed_by_keyboard(open_page):
    page = open_page()
    drawn(page, "series-plot")
    before = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.focus("#theme")
    page.keyboard.press("Enter")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != before
    assert page.get_attribute("#theme", "aria-pressed") == "true"
    paper = page.evaluate("document.getElementById('series-plot').layout.paper_bgcolor")
    assert paper == page.evaluate(
        "getComputedStyle(document.documentElement).getPropertyValue('--background').trim()"
    )


def test_every_control_is_reached_by_keyboard_and_has_a_name(open_page):
    page = open_page()
    unnamed = page.locator("select, input, button").evaluate_all(
        "all => all.filter(e => !e.closest('.modebar') && !e.labels?.length"
        " && !e.textContent.trim() && !e.ariaLabel).length"
    )
    assert unnamed == 0
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
