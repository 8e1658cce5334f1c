"""The page of a running daemon, in a real browser: what is seen, what is pressed, what comes of it."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator

import pytest

from hapticd.client import EventCode
from tests.daemon.running import Daemon, Subscriber
from tests.faults.rig import Rig, anew_where_late
from tests.views.dashboard.browser import Browser, Page
from tests.views.dashboard.served import Served

CONFIG = """\
[device.options.hand.force]     # presses and lets go
profile = "press-and-release"
newton = -5.0
release_newton = 0.5
period_s = 1.0

[[scene.walls]]
axis = "z"
stiffness_n_per_m = 3000.0      # soft

[controller]
law = "energy-cycle"

[controller.params]
window = 2
"""


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as daemon:
        yield daemon.wait_ready()


@pytest.fixture(scope="module")
def served(daemon: Daemon) -> Iterator[Served]:
    with Served(daemon.directory / "run") as served:
        yield served


@pytest.fixture
def page(browser: Browser, served: Served) -> Iterator[Page]:
    """The page with the token; the daemon is armed and runs the file as it was, before and after."""
    with browser.page(served.command) as page:
        page.wait_inside("page.store.status !== null && page.store.ring.end > 100 && page.charts.list.length")
        yield page


def state(page: Page, word: str) -> None:
    page.wait_for(f"document.getElementById('state').textContent === {word!r}")


def apply(page: Page, key: str, value: str) -> None:
    """Type into the form's field of this key, and apply."""
    page.wait_for(f"document.querySelector(\"[data-key='{key}'] input:enabled\") !== null")
    tab = {"controller": 1, "scene": 2, "safety": 3}[key.partition(".")[0]]
    page.click(f"#tabs button:nth-child({tab})")
    page.type_into(f"[data-key='{key}'] input", value)
    page.click("#apply")


def test_what_matters_is_said_in_large_letters(page: Page) -> None:
    state(page, "Armed")
    assert page.evaluate("document.getElementById('law').textContent") == "energy-cycle"
    page.wait_for("parseFloat(document.getElementById('rate').textContent) > 100")
    page.wait_for("parseFloat(document.getElementById('late').textContent.replace('<', '')) >= 0")
    size = "(id) => parseFloat(getComputedStyle(document.getElementById(id)).fontSize)"
    assert min(page.evaluate(f"['state', 'law', 'rate', 'late'].map({size})")) >= 26
    assert "armed" in page.evaluate("document.title").lower()


def test_every_request_is_to_the_page_s_own_address_and_nothing_is_complained_of(page: Page, served: Served) -> None:
    page.wait_inside("page.store.cycles.length > 0")
    asked = [event["request"]["url"] for event in page.events("Network.requestWillBeSent")]
    sockets = [event["url"] for event in page.events("Network.webSocketCreated")]
    assert len(asked) > 10
    assert sockets
    for url in [*asked, *sockets]:
        assert re.match(rf"(http|ws)://127\.0\.0\.1:{served.port}/", url), url
    failed = [
        event["response"]["url"]
        for event in page.events("Network.responseReceived")
        if event["response"]["status"] != 200
    ]
    assert not failed
    assert not page.events("Log.entryAdded")  # a breach of the content security policy, for one
    assert not page.events("Runtime.exceptionThrown")


def test_the_token_is_out_of_sight_and_outlives_a_reload(page: Page, served: Served) -> None:
    assert served.token not in page.evaluate("location.href")
    page.load("Page.reload")
    page.wait_inside("page.store.ring.end > 100")
    assert page.evaluate("document.getElementById('disarm').disabled") is False


def test_a_reload_begins_with_the_past(page: Page) -> None:
    seen = page.inside("page.store.ring.latest")
    page.load("Page.reload")
    page.wait_inside("page.store.ring.end > 100")
    assert page.inside("page.store.ring.time(page.store.ring.begin)") < seen


def test_two_viewers_get_every_tick(page: Page, browser: Browser, served: Served) -> None:
    with browser.page(served.watch) as other:
        for one in (page, other):
            one.wait_inside("page.store.ring.end > 100")
            start = one.inside("page.store.ring.end")
            one.wait_inside(f"page.store.ring.end > {start} + 1500")
            assert one.inside("page.store.gaps") == []
            steps = "page.store.ring.seq.slice(1, page.store.ring.end).map((seq, i) => seq - page.store.ring.seq[i])"
            assert one.inside(f"[...new Set({steps})]") == [1]


def test_a_reload_of_every_ticks_loses_no_tick(page: Page, browser: Browser, served: Served, daemon: Daemon) -> None:
    """Neither for a page that looks on, nor for one that comes then and is sent the minute before."""
    try:
        for every_ticks in (50, 1):
            daemon.config.write_text(f"{CONFIG}\n[telemetry]\nevery_ticks = {every_ticks}\n")
            assert daemon.ask("reload") == ""
            page.wait_inside(f"page.store.status.every_ticks === {every_ticks}")
            last = page.inside("page.store.lastSeq")
            page.wait_inside(f"page.store.lastSeq > {last} + 500")
            with browser.page(served.watch) as late:
                late.wait_inside(f"page.store.lastSeq > {last}")
                for one in (page, late):
                    assert one.inside("page.store.gaps") == []
                    assert one.inside("page.store.punctuality().lost") == 0
    finally:
        daemon.config.write_text(CONFIG)
        assert daemon.ask("reload") == ""


def test_a_contact_is_held_with_every_tick_before_and_after(page: Page) -> None:
    page.click("#span button:nth-child(1)")
    page.click("#trigger button:nth-child(2)")
    page.wait_inside("page.trigger.state === 'held' && page.view.held !== null")
    rows = page.inside(
        "(() => { const { ring, held } = page.view; return Array.from({ length: ring.end }, (_, row) => "
        "[ring.time(row) - held.origin, ring.seq[row], ring.value('contacts', row)]); })()"
    )
    times, seqs, contacts = zip(*rows, strict=True)
    at = seqs.index(page.inside("page.trigger.seq"))
    assert times[at] == 0.0
    assert (contacts[at - 1], contacts[at]) == (0, 1)
    assert times[0] <= -0.1
    assert times[-1] >= 0.099
    assert list(seqs) == list(range(int(seqs[0]), int(seqs[0]) + len(seqs)))
    assert f"tick {seqs[at]}" in page.evaluate("document.getElementById('trigger-state').textContent")


def test_it_stays_held_until_it_is_asked_again(page: Page) -> None:
    page.click("#span button:nth-child(1)")
    page.click("#trigger button:nth-child(3)")
    page.wait_inside("page.trigger.state === 'held' && page.view.held !== null")
    first = page.inside("page.trigger.seq")
    ends = page.inside("page.store.cycles.map(({ seq }) => seq)")
    assert first in ends
    page.wait_inside(f"page.store.cycles.some(({{ seq }}) => seq > {ends[-1]})")
    assert page.inside("page.trigger.seq") == first
    page.click("#hold")
    page.wait_inside(f"page.trigger.state === 'held' && page.trigger.seq > {first}")


def test_a_late_tick_is_held(page: Page) -> None:
    page.click("#span button:nth-child(1)")
    page.click("#trigger button:nth-child(5)")
    page.type_into("#threshold input", "1")  # which every tick is, sooner or later
    page.wait_inside("page.trigger.state === 'held' && page.view.held !== null")
    assert page.inside("page.view.ring.value('late', page.view.ring.rowAt(page.trigger.at))") >= 1


def test_a_part_of_what_is_held_is_looked_at_closely(page: Page) -> None:
    page.click("#hold")
    page.wait_inside("page.view.held !== null")
    page.evaluate("document.querySelector('.u-over').scrollIntoView()")
    box = page.evaluate(
        "(() => { const b = document.querySelector('.u-over').getBoundingClientRect(); return [b.x, b.y]; })()"
    )
    for kind, x in (("mousePressed", 200), ("mouseMoved", 260), ("mouseReleased", 260)):
        page.call("Input.dispatchMouseEvent", type=kind, x=box[0] + x, y=box[1] + 20, button="left", clickCount=1)
    page.wait_inside("page.view.zoomed !== null")
    x0, x1 = page.inside("page.view.zoomed")
    assert -5 < x0 < x1 < 0


def test_disarm_and_arm_are_one_press(page: Page, daemon: Daemon) -> None:
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is heard
        page.click("#disarm")
        subscriber.until("hapticd/event", code=EventCode.DISARMED)
        state(page, "Disarmed")
        page.click("#arm")
        subscriber.until("hapticd/event", code=EventCode.ARMED)
        state(page, "Armed")
        page.press_key("Escape")
        subscriber.until("hapticd/event", code=EventCode.DISARMED)
        state(page, "Disarmed")  # until it knows, there is nothing to press
        page.click("#arm")
        state(page, "Armed")


def test_without_the_token_it_only_watches(browser: Browser, served: Served, daemon: Daemon) -> None:
    disarmed = daemon.output().count("disarmed")
    with browser.page(served.watch) as page:
        page.wait_inside("page.store.ring.end > 100")
        assert page.evaluate("['arm', 'disarm', 'clear'].every((id) => document.getElementById(id).disabled)")
        page.wait_for("document.querySelector('#page-law input') !== null")
        assert page.evaluate(
            "[...document.querySelectorAll('.pages input, .pages select')].every((one) => one.disabled)"
        )
        page.press_key("Escape")
        page.evaluate("document.getElementById('disarm').disabled = false")
        page.click("#disarm")
        page.wait_for("document.getElementById('answer').innerText.includes('read only')")
        state(page, "Armed")
        assert daemon.output().count("disarmed") == disarmed


def test_the_form_edits_the_file_and_the_wall_is_in_force(page: Page, daemon: Daemon) -> None:
    apply(page, "scene.walls[0].stiffness_n_per_m", "2500")
    page.wait_inside("page.store.status.wall_stiffness_n_per_m[0] === 2500")
    assert daemon.config.read_text() == CONFIG.replace("3000.0      # soft", "2500.0      # soft")
    said = "document.getElementById('form-note').textContent === 'In force.'"
    page.wait_for(said)
    # The daemon says which file is in force once more, after the answer; the form has read it.
    page.inside("(page.settings.hash = 'of before', page.settings.follow(page.store.status.config_hash, true))")
    page.inside("page.settings.connection.ask({ do: 'form' })")
    assert page.evaluate(said)
    apply(page, "scene.walls[0].stiffness_n_per_m", "3000")
    page.wait_inside("page.store.status.wall_stiffness_n_per_m[0] === 3000")
    assert daemon.config.read_text() == CONFIG


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("scene.walls[0].stiffness_n_per_m", "-5", "must be from 0 to"),
        ("scene.walls[0].stiffness_n_per_m", "much", "must be a number"),
        ("controller.params.window", "0", "must be from 1 to 100"),
        ("safety.ramp_s", "", "must be a number"),
        ("safety.max_force_n", "0", "must be more than 0"),
    ],
)
def test_a_bad_value_is_refused_at_its_field(page: Page, daemon: Daemon, key: str, value: str, why: str) -> None:
    apply(page, key, value)
    page.wait_for(f"document.querySelector(\"[data-key='{key}'] .bad\") !== null")
    assert why in page.evaluate(f"document.querySelector(\"[data-key='{key}'] .bad\").textContent")
    assert "nothing changed" in page.evaluate("document.getElementById('form-note').textContent")
    assert daemon.config.read_text() == CONFIG


def test_another_law_and_back(page: Page, daemon: Daemon) -> None:
    for law in ("tdpa", "energy-cycle"):
        page.wait_for("document.querySelector(\"[data-key='controller.law'] select:enabled\") !== null")
        choose = "const law = document.querySelector(\"[data-key='controller.law'] select\");"
        page.evaluate(f"{{ {choose} law.value = '{law}'; law.dispatchEvent(new Event('change')); }}")
        if law == "energy-cycle":
            page.type_into("[data-key='controller.params.window'] input", "3")
        page.click("#apply")
        page.wait_for(f"document.getElementById('law').textContent === '{law}'")
        page.wait_for("document.getElementById('form-note').textContent === 'In force.'")
    assert "window = 3" in daemon.config.read_text()
    assert "# tdpa" not in daemon.config.read_text()  # it had no parameters to remember
    daemon.config.write_text(CONFIG)


def test_an_edit_of_a_file_that_others_have_edited_is_refused(page: Page, daemon: Daemon) -> None:
    page.wait_for("document.querySelector(\"[data-key='controller.params.window'] input\") !== null")
    try:
        daemon.config.write_text(f"{CONFIG}# by hand\n")
        apply(page, "controller.params.window", "4")
        page.wait_for("document.getElementById('form-note').textContent.includes('edited by others')")
        assert daemon.config.read_text() == f"{CONFIG}# by hand\n"
    finally:
        daemon.config.write_text(CONFIG)


@pytest.mark.parametrize(("width", "height"), [(1366, 768), (1280, 720), (1024, 768)])
def test_on_a_laptop_nothing_scrolls(page: Page, width: int, height: int) -> None:
    page.resize(width, height)
    page.wait_for(
        "document.documentElement.scrollHeight <= innerHeight && document.documentElement.scrollWidth <= innerWidth"
    )
    assert page.evaluate("Math.min(...[...document.querySelectorAll('.plot')].map((plot) => plot.clientHeight))") > 50


def test_on_a_tablet_held_upright_disarm_stays_in_sight(page: Page, daemon: Daemon) -> None:
    page.resize(768, 1024)
    page.wait_for("document.documentElement.scrollWidth <= innerWidth")
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    assert page.evaluate("scrollY") > 0
    for button in ("arm", "disarm"):
        assert page.evaluate(f"document.getElementById('{button}').getBoundingClientRect().height") >= 44
    page.click("#disarm")
    state(page, "Disarmed")
    page.click("#arm")
    state(page, "Armed")


def test_on_a_phone_no_figure_and_no_word_of_the_device_is_cut(page: Page) -> None:
    """Which law, how much energy, and whether the device is a simulated one."""
    page.resize(390, 844)
    page.wait_for("document.documentElement.scrollWidth <= innerWidth")
    cut = "[...document.querySelectorAll('.state span, .figures dd, .panel > header, .panel header output')]"
    page.wait_for(f"{cut}.every((part) => part.scrollWidth <= part.clientWidth)")
    assert page.evaluate(f"{cut}.length") > 10
    assert page.evaluate("Math.min(...[...document.querySelectorAll('.plot')].map((plot) => plot.clientHeight))") > 50


def test_it_is_dark_where_the_system_is_and_where_it_is_told_to_be(browser: Browser, served: Served) -> None:
    for dark in (False, True):
        with browser.page(served.watch, dark=dark) as page:
            assert bool(page.picture()[700:, 5].mean() < 60) is dark
            page.click("#theme")
            assert bool(page.picture()[700:, 5].mean() < 60) is not dark
            page.load("Page.reload")
            assert bool(page.picture()[700:, 5].mean() < 60) is not dark


def test_a_fault_is_held_said_and_cleared(page: Page, daemon: Daemon) -> None:
    """Over-speed stops the daemon; what the hand did before is in the picture."""
    page.click("#span button:nth-child(1)")
    page.click("#trigger button:nth-child(4)")
    page.call("Emulation.setTimezoneOverride", timezoneId="Asia/Kolkata")
    apply(page, "safety.max_speed_m_per_s", "0.001")
    state(page, "Fault")
    fault = page.evaluate("document.getElementById('fault').innerText")
    assert re.search(r"Over-speed at \d\d:\d\d:\d\d \+0530\.", fault)
    picture = page.picture()
    assert tuple(picture[20, 200]) == (179, 33, 26)  # the colour of faults
    page.wait_inside("page.trigger.state === 'held' && page.view.held !== null")
    assert page.inside("page.view.ring.time(0) < page.trigger.at && page.trigger.at < page.view.ring.latest")
    held = page.evaluate("document.getElementById('trigger-state').textContent")
    assert re.search(r" at \d\d:\d\d:\d\d\.\d{3} \+0530, tick", held)
    assert page.evaluate(
        "/^..:..:.. .0530$/.test(document.querySelector('#events .fault').previousSibling.textContent)"
    )
    page.wait_for("document.getElementById('form-note').textContent === 'In force.'")
    apply(page, "safety.max_speed_m_per_s", "")
    page.wait_for("document.getElementById('form-note').textContent === 'In force.'")
    assert daemon.config.read_text() == CONFIG + "\n[safety]\n"
    page.click("#clear")
    state(page, "Disarmed")
    assert page.evaluate("document.getElementById('fault').hidden")
    page.click("#arm")
    state(page, "Armed")
    daemon.config.write_text(CONFIG)
    assert daemon.ask("reload") == ""


def test_a_force_that_is_ramped_out_after_a_fault_is_said(browser: Browser) -> None:
    with (
        Daemon(CONFIG) as daemon,
        Served(daemon.wait_ready().directory / "run") as served,
        browser.page(served.command) as page,
    ):
        state(page, "Armed")
        daemon.config.write_text(CONFIG + "[safety]\nramp_s = 1.0\nmax_speed_m_per_s = 0.001\n")
        assert daemon.ask("reload") == ""
        state(page, "Fault, releasing")
        state(page, "Fault")


@anew_where_late
def test_who_disarms_a_device_that_does_not_let_go_is_told(browser: Browser) -> None:
    """The button was content when the ramp began."""
    with Rig() as rig, Served(rig.daemon.directory / "run") as served, browser.page(served.command) as page:
        rig.pressed()
        state(page, "Armed")
        rig.order("keeps")
        page.click("#disarm")
        page.wait_for("document.getElementById('answer').innerText.includes('the force may still be there')")


def test_a_server_that_says_nothing_is_no_link(browser: Browser, daemon: Daemon) -> None:
    """The page showed its last state as the present one, and what was pressed had no answer."""
    with Served(daemon.directory / "run") as served, browser.page(served.command) as page:
        state(page, "Armed")
        served.process.send_signal(signal.SIGSTOP)
        try:
            page.click("#arm")
            state(page, "No link")
            assert "server has gone" in page.evaluate("document.getElementById('answer').innerText")
        finally:
            served.process.send_signal(signal.SIGCONT)
        state(page, "Armed")


def test_a_page_that_is_open_for_weeks_draws_on(page: Page) -> None:
    """Rows were counted in 32 bits where a pixel has many: after 12 days at 1 kHz half of the points had no time."""
    times = page.evaluate(
        "Promise.all([import('/ring.js'), import('/decimate.js')]).then(([{ Ring }, { decimated }]) => {"
        " const ring = new Ring(1, 1000); ring.end = 2 ** 30;"
        " for (let i = 0; i < 1000; i++) ring.push(i, i, null);"
        " return decimated(ring, 0, 1000, ['x0'], 100).t; })"
    )
    assert len(times) > 100
    assert None not in times


def test_a_daemon_that_has_gone_is_said(browser: Browser) -> None:
    with (
        Daemon(CONFIG) as daemon,
        Served(daemon.wait_ready().directory / "run") as served,
        browser.page(served.command) as page,
    ):
        page.wait_inside("page.store.ring.end > 100")
        daemon.process.terminate()
        state(page, "No daemon")
        assert page.evaluate("document.getElementById('trouble').hidden") is False
        assert page.evaluate("document.getElementById('rate').textContent") == "–"
        page.click("#disarm")
        page.wait_for("document.getElementById('answer').innerText.includes('no daemon answers')")
        served.process.terminate()
        state(page, "No link")
        assert "hapticd disarm" in page.evaluate("document.getElementById('trouble').innerText")
