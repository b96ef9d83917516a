"""The page in a real browser, against a real server process: what a person does, step by step."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from hexwrap_server.input.form import Body, leaves
from tests.server import forked
from tests.server.live import finished
from tests.server.patience import PATIENCE, until

ROOT = Path(__file__).resolve().parents[2]
#: Milliseconds that the browser waits for what must come.
MOMENT = int(1000 * PATIENCE)
VIEWER = ROOT / "server" / "viewer"
STATIC = ROOT / "server" / "hexwrap_server" / "static"


#: Draws without a graphics card, asks nobody on the network. Only the views themselves are drawn by a GPU's
#: stand-in, without smoothing and (where pages are opened) with a quarter of the pixels: the page around them
#: would take several times as long.
BROWSER_FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--webgl-antialiasing-mode=none",
    "--disable-background-networking",
]


def chromium() -> str | None:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    return None


try:
    from playwright.sync_api import Page, Route, sync_playwright
except ImportError:  # the browser tests are the only ones that need it
    sync_playwright = None

pytestmark = [
    pytest.mark.skipif(sync_playwright is None, reason="playwright is not installed (pip install '.[test]')"),
    pytest.mark.skipif(chromium() is None, reason="no Chromium on this machine (apt-get install chromium)"),
    # Playwright's own event loop leaves its sockets to the garbage collector.
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]


def _free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


class Server:
    """A ``hexwrap serve`` of its own, which can be stopped and started again."""

    def __init__(self, data: Path) -> None:
        self.data, self.port = data, _free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.start()

    def start(self) -> None:
        env = {**os.environ, "PYTHONPATH": forked.paths()}
        settings = f"Settings(port={self.port}, data={str(self.data)!r}, workers=1)"
        program = (
            "from hexwrap_server.http.app import serve\n"
            "from hexwrap_server.settings import Settings\n"
            "from tests.server import forked\n"
            "forked.fork_from_here()\n"
            f"serve({settings})"
        )
        self.process = forked.popen(
            [sys.executable, "-c", program], env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        until(self.answers, "the server")

    def answers(self) -> bool:
        try:
            return httpx.get(f"{self.url}/health", timeout=PATIENCE, trust_env=False).status_code == 200
        except httpx.TransportError:
            return False

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("viewer-data"))
    yield server
    server.stop()


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium(),
            args=BROWSER_FLAGS,
        )
        yield browser
        browser.close()


@contextmanager
def opened(browser, server: Server, path: str = "/") -> Iterator[Page]:
    """A page that must ask nobody else and must not complain, except where the test says so."""
    page = browser.new_page(viewport={"width": 1280, "height": 720}, device_scale_factor=0.5)
    page.context.set_default_timeout(MOMENT)
    page.context.set_default_navigation_timeout(MOMENT)
    page.complaints, page.strangers = [], []
    page.on("console", lambda m: page.complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: page.complaints.append(str(e)))
    page.on(
        "request",
        lambda r: (
            page.strangers.append(r.url) if not r.url.startswith((server.url, "blob:", "data:")) else None
        ),
    )
    page.goto(server.url + path)
    try:
        yield page
        assert page.strangers == []
    finally:
        page.close()


#: Looks from outside, horizontally, at a point of a model that stands about the vertical axis.
TURNED_TO = """([x, y, z]) => {
    const { space } = window.hexwrapViewer;
    const reach = space.camera.position.distanceTo(space.controls.target), far = Math.hypot(x, y);
    const target = space.controls.target;
    space.camera.position.set(target.x + reach * x / far, target.y + reach * y / far, target.z + 0.2);
    space.controls.update();
    space.render();
}"""


#: Moves a slider over several places at once.
MOVED = """([name, places]) => {
    const slider = document.querySelector(`input[type=range][name="${name}"]`);
    for (const place of places) {
        slider.value = place;
        slider.dispatchEvent(new Event("input", { bubbles: true }));
    }
}"""


def shown(page: Page, before: str | None = None, timeout: int = MOMENT) -> str:
    """Waits until another result than ``before`` is on the screen; its job."""
    page.wait_for_function(
        "old => (document.documentElement.dataset.shown || null) !== old", arg=before, timeout=timeout
    )
    return page.evaluate("document.documentElement.dataset.shown")


#: Read in the page: the views and what they show.
INSIDE = "const { space, domain, state } = window.hexwrapViewer;"

#: What is drawn of the surface, of the domain and of the cells in it, of the panels.
PARTS = "[space.mesh, domain.marks.children[0], domain.layer.fills.geometry, space.layer.fills.geometry]"
#: Which of them are those that were there when this was asked before.
KEPT = f"""() => {{ {INSIDE} const parts = {PARTS}, kept = parts.map((part, i) => part === window.parts?.[i]);
    window.parts = parts; return kept }}"""


def on_screen(page: Page, what: str, i: int) -> tuple[float, float]:
    """Pixel of entry i of one of the result's lists of points."""
    box = page.locator("#view3d canvas").bounding_box()
    at = page.evaluate(f"i => {{ {INSIDE} return space.project(state.result.{what}[i]) }}", i)
    return box["x"] + at["x"], box["y"] + at["y"]


def facing_panel(page: Page) -> int:
    """A panel near the middle of the picture that looks at the eye."""
    return page.evaluate(
        """() => {
        const { space, state } = window.hexwrapViewer;
        const { center, normal } = state.result.panels;
        const view = space.camera.position.clone().sub(space.controls.target).normalize();
        const { clientWidth: w, clientHeight: h } = space.element;
        let [best, least] = [0, Infinity];
        center.forEach((c, i) => {
          const s = space.project(c);
          const d = Math.hypot(s.x - w / 2, s.y - h / 2);
          const [x, y, z] = normal[i];
          if (view.x * x + view.y * y + view.z * z > 0.6 && d < least) [best, least] = [i, d];
        });
        return best; }"""
    )


def fetched(server: Server, path: str) -> dict:
    return httpx.get(server.url + path, trust_env=False).json()


def torus(around: int = 12, across: int = 8) -> str:
    """A surface with a handle, as OBJ."""
    k, j = (index.ravel() for index in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    a, b = 2 * np.pi * k / around, 2 * np.pi * j / across
    points = np.stack([(3 + np.cos(b)) * np.cos(a), (3 + np.cos(b)) * np.sin(a), np.sin(b)], axis=1)
    after, above = (k + 1) % around, (j + 1) % across
    faces = np.stack(
        [across * row + place for row, place in ((k, j), (after, j), (after, above), (k, above))], axis=1
    )
    lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a} {b} {c} {d}" for a, b, c, d in faces + 1]
    return "\n".join(lines)


def tube(n: int = 24, rows: int = 9, bulge: float = 0.7) -> str:
    """A bulged tube, or one with a waist, as OBJ text, quads, two open ends."""
    t = np.arange(n) * 2 * np.pi / n
    lines = []
    for r in range(rows):
        radius = 2 + bulge * np.sin(np.pi * r / (rows - 1))
        lines += [f"v {radius * np.cos(a):.9f} {radius * np.sin(a):.9f} {r * 0.6:.9f}" for a in t]
    for r in range(rows - 1):
        for i in range(n):
            a, b = r * n + i, r * n + (i + 1) % n
            lines.append(f"f {a + 1} {b + 1} {b + n + 1} {a + n + 1}")
    return "\n".join(lines) + "\n"


def obj_surface(text: str) -> dict[str, Any]:
    """The same as a surface of a request."""
    rows = [line.split() for line in text.splitlines()]
    return {
        "vertices": [[float(x) for x in row[1:]] for row in rows if row[0] == "v"],
        "faces": [[int(i) - 1 for i in row[1:]] for row in rows if row[0] == "f"],
    }


@pytest.fixture(scope="class")
def tower(browser, server: Server) -> Iterator[Page]:
    """A page that shows the tower."""
    with opened(browser, server) as page:
        page.select_option("#sample", "tower")
        shown(page)
        yield page


class TestResult:
    """What is read off one result, all on one page."""

    def test_sample_solves_and_panels_can_be_picked_and_read(self, tower: Page, server: Server) -> None:
        job = tower.evaluate("document.documentElement.dataset.shown")
        result = fetched(server, f"/v1/jobs/{job}/result")
        i = facing_panel(tower)
        tower.mouse.click(*on_screen(tower, "panels.center", i))
        label = tower.locator("#card dd").first.inner_text()
        assert label == result["panels"]["label"][i]
        assert tower.locator("#card svg.outline text").count() == len(result["panels"]["polygons"][i])
        # the legend counts what the result counts
        counts = [int(t.removeprefix("× ")) for t in tower.locator("#legend td:last-child").all_inner_texts()]
        assert sum(counts) == len(result["panels"]["polygons"])
        # each way of colouring has a legend of its own
        for mode in ("planarity", "gap", "distance", "scale"):
            tower.select_option("#mode", mode)
            assert tower.locator("#legend .ramp").count() == 1, mode
        # brackets step from panel to panel
        tower.locator("#view3d canvas").focus()
        tower.keyboard.press("]")
        assert (
            tower.locator("#card dd").first.inner_text()
            == result["panels"]["label"][(i + 1) % len(result["panels"]["label"])]
        )
        assert tower.complaints == []

    def test_the_widest_gap_is_shown_and_the_whole_model_in_a_narrow_window(self, tower: Page) -> None:
        tower.click("#widest")
        gaps = "state.result.panels.gap_tangential"
        assert tower.evaluate(f"() => {{ {INSIDE} return {gaps}[state.selected] === Math.max(...{gaps}) }}")
        towards = "space.camera.position.clone().sub(space.controls.target).normalize()"
        facing = f"{towards}.dot({{ x: n[0], y: n[1], z: n[2] }})"
        normal = "const n = state.result.panels.normal[state.selected];"
        assert tower.evaluate(f"() => {{ {INSIDE} {normal} return {facing} }}") > 0.4
        wide = tower.viewport_size
        tower.click("#fit")
        # clear of what lies over the view
        assert tower.evaluate(
            f"""() => {{ {INSIDE} const at = space.element.getBoundingClientRect();
            const [bar, legend] = [".bar", "#legend"].map((n) => document.querySelector(n))
            .map((one) => one.getBoundingClientRect());
            return state.result.mesh.vertices.map((p) => space.project(p))
            .every(({{ x, y }}) => y > bar.bottom - at.top && x > legend.right - at.left) }}"""
        )
        tower.set_viewport_size({"width": 860, "height": 720})
        tower.wait_for_function(
            f"""() => {{ {INSIDE} return state.result.mesh.vertices.map((p) => space.project(p))
            .every(({{ x, y }}) => x > 0 && y > 0
                && x < space.element.clientWidth && y < space.element.clientHeight) }}"""
        )
        tower.set_viewport_size(wide)

    def test_hover_is_linked_between_space_and_domain(self, tower: Page) -> None:
        tower.mouse.move(*on_screen(tower, "panels.center", facing_panel(tower)))
        tower.wait_for_function(
            f"() => {{ {INSIDE} return [space, domain].every((v) => v.layer.pointed.group.visible) }}"
        )

    def test_files_are_downloaded(self, tower: Page) -> None:
        with tower.expect_download() as download:
            tower.click("#files a[download='panels.csv']")
        lines = Path(download.value.path()).read_text(encoding="utf-8-sig").splitlines()
        assert len(lines) == 1 + len(tower.evaluate(f"() => {{ {INSIDE} return state.result.panels.label }}"))

    def test_copied_curl_request_is_the_request(self, tower: Page, server: Server) -> None:
        tower.context.grant_permissions(["clipboard-read", "clipboard-write"])
        tower.click("#copy-curl")
        tower.wait_for_function("() => document.getElementById('copied').textContent !== ''")
        text = tower.evaluate("navigator.clipboard.readText()")
        body = json.loads(text.split(" -d '", 1)[1][:-1].replace("'\\''", "'"))
        assert text.startswith(f"curl -s {server.url}/v1/solve")
        assert body["pattern"]["kind"] == "hex"


def test_choosing_a_number_of_sizes_on_the_curve_recomputes(browser, server: Server) -> None:
    with opened(browser, server) as page:
        page.select_option("#sample", "tower")
        before = shown(page)
        page.evaluate(KEPT)
        asked: list[str] = []
        page.on("request", lambda r: asked.append(r.url.partition("?include=")[2]))
        page.locator("#curve .spot[data-k='5']").focus()
        page.keyboard.press("Enter")
        job = shown(page, before)
        assert [parts for parts in asked if parts] == ["panels,sizes,quality,support,timings"]
        result = fetched(server, f"/v1/jobs/{job}/result?include=sizes")
        assert len(result["sizes"]) == 5
        assert page.locator("#histogram rect").count() == 5
        assert page.evaluate(KEPT) == [True, True, True, False]
        asked.clear()
        page.evaluate(MOVED, ["pattern.around", [20, 22, 24]])
        job = shown(page, job)
        assert [parts for parts in asked if parts] == ["pattern,panels,sizes,quality,support,timings"]
        assert fetched(server, f"/v1/jobs/{job}/request")["pattern"]["around"] == 24
        assert page.evaluate(f"() => {{ {INSIDE} return state.result.pattern.around }}") == 24
        assert page.evaluate(KEPT) == [True, True, False, False]
        assert page.complaints == []


def test_a_variant_is_taken_from_the_front(browser, server: Server) -> None:
    vary = {"around": [12, 12], "singularities": [0], "sizes": [1, 6]}
    body = {"name": "front", "surface": obj_surface(tube()), "vary": vary, "variants": 4}
    job = httpx.post(f"{server.url}/v1/explore", json=body, timeout=PATIENCE, trust_env=False).json()
    with opened(browser, server) as page:
        # It runs when it is opened; then the server is gone for a while, and what comes after is followed.
        page.route(f"**/v1/jobs/{job['id']}", lambda route: route.fulfill(json=job), times=1)
        page.route(
            f"**/v1/jobs/{job['id']}/events", lambda route: route.fulfill(body=": cut off\n\n"), times=1
        )
        busy = {"status": 503, "headers": {"Retry-After": "0.1"}, "json": {"detail": "The server is busy."}}
        page.route(f"**/v1/jobs/{job['id']}/events", lambda route: route.fulfill(**busy), times=1)
        page.locator(f"#jobs [data-job='{job['id']}']").click()
        page.locator("svg.front .best").wait_for()
        found = fetched(server, f"/v1/jobs/{job['id']}/result")
        spots = page.locator("svg.front .variant")
        measured = [i for i, one in enumerate(found["variants"]) if one["measured"]]
        assert sorted(int(spot.get_attribute("data-variant")) for spot in spots.all()) == measured
        assert page.locator("svg.front .foreseen").count() == len(found["variants"]) - len(measured)
        slider = page.locator("[data-limit='types']")
        slider.focus()
        page.keyboard.press("Home")  # the fewest types: all others fade
        types = [found["variants"][i]["measured"]["types"] for i in measured]
        assert page.locator("svg.front .out").count() == sum(n > min(types) for n in types)
        # and another one is proposed, of those that are left
        proposed = next(
            i for i in found["ranking"] if found["variants"][i]["measured"]["types"] == min(types)
        )
        assert page.locator("svg.front .best").get_attribute("data-variant") == str(proposed)
        page.locator(".proposal button").click()
        assert page.locator("svg.front .current").get_attribute("data-variant") == str(proposed)
        before = shown(page)
        page.locator("[data-limit='types']").focus()
        page.keyboard.press("End")
        page.locator(f"svg.front [data-variant='{found['best']}']").focus()
        page.keyboard.press("Enter")
        job = before if proposed == found["best"] else shown(page, before)
        taken = fetched(server, f"/v1/jobs/{job}/result?include=quality")
        assert 1 - taken["quality"]["coverage"] == pytest.approx(
            found["variants"][found["best"]]["measured"]["uncovered"]
        )
        (refused,) = page.complaints
        assert "503" in refused


def test_singularities_are_chosen_on_their_curve_and_dragged(browser, server: Server) -> None:
    with opened(browser, server) as page:
        page.select_option("#sample", "singular")
        before = shown(page)
        assert page.locator("#singular-curve .spot.current").get_attribute("data-k") == "3"
        page.locator("#singular-curve .spot[data-k='1']").focus()
        page.keyboard.press("Enter")
        job = shown(page, before)
        one = fetched(server, f"/v1/jobs/{job}/result?include=map,quality,mesh")
        assert len(one["map"]["cones"]) == 1
        curve = one["quality"]["singularity_curve"]
        assert curve["number"][curve["taken"]] == 1
        page.evaluate(TURNED_TO, one["mesh"]["vertices"][one["map"]["cones"][0]["vertex"]])
        x, y = on_screen(page, "mesh.vertices", one["map"]["cones"][0]["vertex"])
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 10, y + 15)
        page.mouse.move(x + 12, y + 40)
        page.mouse.up()
        job2 = shown(page, job)
        moved = fetched(server, f"/v1/jobs/{job2}/result?include=map,mesh,pattern")
        cones = moved["map"]["cones"]
        assert [cone["index"] for cone in cones] == [one["map"]["cones"][0]["index"]]
        was, there = (np.array(r["mesh"]["vertices"][r["map"]["cones"][0]["vertex"]]) for r in (one, moved))
        assert np.linalg.norm(there - was) > 2 * moved["pattern"]["edge_length"]
        assert sum(k != 0 for k in moved["pattern"]["index"]) == 1
        page.locator("#singular-auto").click()
        again = fetched(server, f"/v1/jobs/{shown(page, job2)}/result?include=map")
        assert len(again["map"]["cones"]) == 3
        assert page.complaints == []


def test_features_are_removed_by_a_click_and_drawn(browser, server: Server) -> None:
    def pixel(page: Page, point: list[float]) -> tuple[float, float]:
        box = page.locator("#view3d canvas").bounding_box()
        at = page.evaluate(f"p => {{ {INSIDE} return space.project(p) }}", point)
        return box["x"] + at["x"], box["y"] + at["y"]

    with opened(browser, server) as page:
        page.select_option("#sample", "box")
        job = shown(page)
        assert len(fetched(server, f"/v1/jobs/{job}/result?include=mesh")["mesh"]["features"]) == 4
        hidden = pixel(page, [0, 20, 25])  # behind the building
        page.mouse.move(*hidden)
        page.wait_for_timeout(100)
        assert page.locator("#view3d.over-feature").count() == 0
        page.mouse.move(*pixel(page, [30, 0, 25]))
        page.wait_for_selector("#view3d.over-feature")
        with page.expect_request("**/v1/jobs") as sent:
            page.mouse.click(*pixel(page, [30, 0, 25]))
        (left_out,) = sent.value.post_data_json["surface"]["features"]["without"]
        assert sorted(left_out) == [[30, 0, 0], [30, 0, 60]]
        job = shown(page, job)
        result = fetched(server, f"/v1/jobs/{job}/result?include=mesh,pattern")
        points, lines = np.array(result["mesh"]["vertices"]), result["mesh"]["features"]
        assert sorted(points[line[0], :2].tolist() for line in lines) == [[0, 0], [0, 20], [30, 20]]
        assert len(result["pattern"]["features"]) == 3

        page.click("#draw-line")
        page.mouse.click(*pixel(page, [8, 0, 30]))
        page.keyboard.press("Escape")
        page.click("#draw-line")
        ends = [[8, 0, 30], [22, 0, 30]]
        page.mouse.click(*pixel(page, ends[0]))
        with page.expect_request("**/v1/jobs") as sent:
            page.mouse.dblclick(*pixel(page, ends[1]))
        assert "vertices" not in sent.value.post_data_json["surface"]  # they were sent once
        asked = sent.value.post_data_json["surface"]["features"]
        np.testing.assert_allclose(asked["lines"], [ends], atol=1e-3)
        assert asked["without"] == [left_out]
        job = shown(page, job)
        assert len(fetched(server, f"/v1/jobs/{job}/result?include=mesh")["mesh"]["features"]) == 4
        with page.expect_request("**/v1/jobs") as sent:
            page.mouse.click(*pixel(page, [15, 0, 30]))
        assert sent.value.post_data_json["surface"]["features"] == asked | {"lines": []}
        assert page.complaints == []


def test_a_dropped_file_is_solved(browser, server: Server, tmp_path: Path) -> None:
    path = tmp_path / "tube.obj"
    path.write_text(tube())
    with opened(browser, server) as page:
        page.set_input_files("#file", str(path))
        job = shown(page)
        answer = fetched(server, f"/v1/jobs/{job}")
        assert (answer["status"], answer["name"]) == ("done", "tube")
        assert page.complaints == []


def test_a_dropped_file_does_not_inherit_what_a_sample_was_made_for(
    browser, server: Server, tmp_path: Path
) -> None:
    (tmp_path / "tube.obj").write_text(tube())
    with opened(browser, server) as page:
        page.locator("#settings fieldset").first.wait_for()
        set_already = page.locator("#settings summary small:visible").all_inner_texts()
        assert "".join(set_already) == ""
        page.select_option("#sample", "ring")
        before = shown(page)
        page.set_input_files("#file", tmp_path / "tube.obj")
        before = shown(page, before)
        request = fetched(server, f"/v1/jobs/{before}/request")
        assert request["boundary"]["mode"] == "auto"
        assert request["pattern"]["around"] is None
        # settings of one's own stay for the next file
        page.fill("[name='panels.sizes']", "4")
        before = shown(page, before)
        (tmp_path / "wide.obj").write_text(tube(bulge=1.0))
        page.set_input_files("#file", tmp_path / "wide.obj")
        assert fetched(server, f"/v1/jobs/{shown(page, before)}/request")["panels"]["sizes"] == 4


def test_a_file_that_is_dropped_before_the_settings_are_there_is_solved(
    browser, server: Server, tmp_path: Path
) -> None:
    path = tmp_path / "early.obj"
    path.write_text(tube())
    with opened(browser, server) as page:
        held: list[Route] = []
        page.route("**/v1/settings", lambda route: held.append(route))
        page.reload()
        page.set_input_files("#file", str(path))
        page.wait_for_timeout(50)
        held[0].continue_()
        assert fetched(server, f"/v1/jobs/{shown(page)}")["name"] == "early"
        assert page.complaints == []


def test_objects_of_a_file_are_listed_and_one_is_taken_by_a_click(
    browser, server: Server, tmp_path: Path
) -> None:
    parts = []
    for name, at in (("north", 0), ("south", 50)):
        rows = [line.split() for line in tube().splitlines()]
        count = sum(row[0] == "v" for row in rows)
        parts.append(f"g {name}")
        for kind, *rest in rows:
            if kind == "v":
                parts.append(f"v {float(rest[0]) + at} {rest[1]} {rest[2]}")
            else:  # from the end, so that both groups count alike
                parts.append("f " + " ".join(str(int(v) - 1 - count) for v in rest))
    path = tmp_path / "two.obj"
    path.write_text("\n".join(parts) + "\n")
    with opened(browser, server) as page:
        page.set_input_files("#file", str(path))
        page.wait_for_selector("#objects button >> nth=1")
        assert "could be meant" in page.locator("#banner").inner_text()
        page.click("#objects button >> nth=1")
        job = shown(page)
        chosen = page.locator("#objects button[aria-pressed=true]").inner_text()
        assert "south" in chosen
        mesh = fetched(server, f"/v1/jobs/{job}/result?include=mesh")["mesh"]
        assert min(x for x, _, _ in mesh["vertices"]) > 30


def test_faults_are_shown_in_red_where_they_are(browser, server: Server, tmp_path: Path) -> None:
    path = tmp_path / "torus.obj"
    path.write_text(torus())
    with opened(browser, server) as page:
        page.set_input_files("#file", str(path))
        page.wait_for_function("() => document.documentElement.dataset.shown === 'faults'")
        assert "handle" in page.locator("#banner").inner_text()
        red = page.evaluate(
            """() => {
            let n = 0;
            window.hexwrapViewer.space.scene.traverse((o) => {
              if (o.material?.color?.getHex?.() === 0xd62828) n += o.geometry.getAttribute("position").count;
            });
            return n; }"""
        )
        assert red > 0


def test_angles_are_set_by_clicking_and_the_balance_closes(browser, server: Server, tmp_path: Path) -> None:
    path = tmp_path / "tube.obj"
    path.write_text(tube(48, 17))
    with opened(browser, server) as page:
        page.set_input_files("#file", str(path))
        before = shown(page)
        page.select_option("[name='boundary.mode']", "angles")
        before = shown(page, before)  # no corners yet: solved as straight
        loop = page.evaluate("window.hexwrapViewer.state.result.mesh.loops[0]")
        page.select_option("#angle-value", label="240°")
        for v in (loop[0], loop[3]):
            page.mouse.click(*on_screen(page, "mesh.vertices", v))
        assert page.locator("#angle-list li").count() == 2
        assert "-120" in page.locator("#balance").inner_text()
        page.click("#close-balance")
        assert "balanced" in page.locator("#balance").inner_text()
        job = shown(page, before)
        request = fetched(server, f"/v1/jobs/{job}/request")
        assert request["boundary"]["angle_unit"] == "deg"
        assert [a["angle"] for a in request["boundary"]["angles"]] == [240, 120]


EVERYTHING: dict[str, Any] = {
    "boundary": {"mode": "isometric", "quantum": "quad", "spread": "optimal"},
    "pattern": {
        "kind": "quad",
        "around": 17,
        "rotation": 7.5,
        "align": "none",
        "boundary": "trim",
        "phase": [0.25, 0.5],
    },
    "panels": {
        "sizes": None,
        "size_cost": "worst",
        "edge_range": [0.01, 9],
        "target": "shortest",
        "orientation": "tangent",
        "joint": 0.01,
        "increment": 0.001,
        "max_gap": 1.5,
        "components": {"inset": 0.01, "thickness": 0.02, "depth": 0.3},
    },
    "support": True,
}
WATERTIGHT: dict[str, Any] = {
    "pattern": {"kind": "hex", "edge_length": 0.9, "rotation": "vertex"},
    "panels": {"mode": "watertight", "method": "energy", "weights": {"planarity": 2, "surface": 1}},
}


@pytest.mark.parametrize("asked", [EVERYTHING, WATERTIGHT], ids=["split", "watertight"])
def test_no_setting_is_lost_when_one_is_changed(browser, server: Server, asked: dict[str, Any]) -> None:
    surface = obj_surface(tube())
    with httpx.Client(base_url=server.url, trust_env=False, timeout=PATIENCE) as client:
        id = client.post("/v1/jobs", json={"name": "all", "surface": surface} | asked).json()["id"]
        assert finished(client, id)["status"] == "done"
        adopted = client.get(f"/v1/jobs/{id}/request").json()
    for section, settings in asked.items():  # the recalled request says what was asked for
        if isinstance(settings, dict):
            assert adopted[section].items() >= {k: v for k, v in settings.items() if k != "weights"}.items()
    with opened(browser, server, f"/#job/{id}") as page:
        shown(page)
        with page.expect_request("**/v1/jobs") as sent:
            page.fill("[name='panels.joint']", "0.02")
        body = sent.value.post_data_json
        assert body == adopted | {"panels": adopted["panels"] | {"joint": 0.02}}
        with page.expect_request("**/v1/jobs") as sent:
            page.locator("#settings > fieldset", has_text="Panels").locator("details > summary").click()
            page.select_option("[name='panels.orientation']", "tangent" if asked is WATERTIGHT else "fit")
        changed = "tangent" if asked is WATERTIGHT else "fit"
        assert sent.value.post_data_json == body | {"panels": body["panels"] | {"orientation": changed}}
        assert page.complaints == []


def test_every_setting_has_a_control(browser, server: Server) -> None:
    with opened(browser, server) as page:
        page.wait_for_selector("[name='panels.sizes']", state="attached")
        names = set(page.eval_on_selector_all("[name]", "all => all.map((one) => one.name)"))
    for leaf in leaves(Body):
        path = ".".join(leaf.path)
        own_way = path in ("name", "boundary.angles")  # the surface's name, and clicks on the boundary
        assert own_way or {path, f"{path}.0"} & names, path


def test_corners_are_found_at_vertices_that_were_welded_away(browser, server: Server) -> None:
    """The second copy of a seam's vertex is nowhere in the welded mesh; its place is."""
    surface = obj_surface(tube())
    seam = len(surface["vertices"])
    surface["vertices"].append(surface["vertices"][5])
    surface["faces"] = [
        [seam if v == 5 and i == 5 else v for v in face] for i, face in enumerate(surface["faces"])
    ]
    angles = [{"vertex": seam, "angle": 200}, {"vertex": 12, "angle": 160}]
    body = {"surface": surface, "boundary": {"mode": "angles", "angle_unit": "deg", "angles": angles}}
    with httpx.Client(base_url=server.url, trust_env=False, timeout=PATIENCE) as client:
        id = client.post("/v1/jobs", json=body | {"pattern": None}).json()["id"]
        assert finished(client, id)["status"] == "done"
    with opened(browser, server, f"/#job/{id}") as page:
        shown(page)
        found = page.evaluate("window.hexwrapViewer.corners()")
        assert [corner["loop"] for corner in found] == [0, 0]
        assert [corner["point"] for corner in found] == [surface["vertices"][v] for v in (5, 12)]
        assert "loop 0 0°, loop 1 0°; balanced" in page.locator("#balance").inner_text()


def test_cancel_stops_the_job(browser, server: Server, tmp_path: Path) -> None:
    path = tmp_path / "fine.obj"
    path.write_text(tube(480, 160))
    with opened(browser, server) as page:
        page.set_input_files("#file", str(path))
        page.wait_for_selector("#cancel:not([hidden])")
        page.click("#cancel")
        page.wait_for_selector("#cancel", state="hidden")

        def is_idle() -> bool:
            health = fetched(server, "/health")
            return bool(health["running"] == health["queued"] == 0)

        until(is_idle, "the end of the job")


def test_the_page_outlives_a_restart_of_the_server(browser, server: Server) -> None:
    with opened(browser, server) as page:
        page.select_option("#sample", "tower")
        before = shown(page)
        server.stop()
        page.wait_for_selector("#banner:not([hidden])")
        server.start()
        page.wait_for_selector("#banner", state="hidden")
        page.fill("[name='panels.sizes']", "4")
        job = shown(page, before)
        assert len(fetched(server, f"/v1/jobs/{job}/result?include=sizes")["sizes"]) == 4


def test_what_is_shown_is_the_result_also_where_the_kind_of_panels_chooses_the_cells(
    browser, server: Server
) -> None:
    """Watertight hexagons follow no saddle: another pattern is laid for them, on another map."""
    waist = {"surface": obj_surface(tube(bulge=-0.7)), "pattern": {"kind": "auto", "around": 12}}
    with opened(browser, server) as page:
        page.route("**/v1/samples/waist", lambda route: route.fulfill(json=waist))
        page.select_option("#sample", "waist")
        job = shown(page)
        for mode, kind in (("watertight", "trihexagonal"), ("split", "hex")):
            page.select_option("[name='panels.mode']", mode)
            job = shown(page, job)
            on_page = page.evaluate(f"() => {{ {INSIDE} return state.result }}")
            result = fetched(server, f"/v1/jobs/{job}/result?include={','.join(on_page)}")
            assert on_page == result
            assert result["pattern"]["kind"] == kind
            assert page.locator("#histogram").is_visible() == (mode == "split")
        assert page.complaints == []


@pytest.mark.parametrize("way", ["mesh", "file"])
def test_a_surface_that_is_kept_no_more_is_sent_again(
    browser, server: Server, tmp_path: Path, way: str
) -> None:
    def forget() -> set[str]:
        kept = list(server.data.glob("surfaces/*.surface"))
        for path in kept:
            path.unlink()
        return {path.name for path in kept}

    path = tmp_path / "old.obj"
    path.write_text(tube())
    with opened(browser, server) as page:
        if way == "mesh":
            page.route(
                "**/v1/samples/tower", lambda route: route.fulfill(json={"surface": obj_surface(tube())})
            )
            page.select_option("#sample", "tower")
        else:
            page.set_input_files("#file", str(path))
        before = shown(page)
        assert forget()
        page.fill("[name='panels.sizes']", "7")
        job = shown(page, before)
        assert fetched(server, f"/v1/jobs/{job}/request")["panels"]["sizes"] == 7
        (kept,) = forget()
        page.click("#copy-curl")
        page.wait_for_function("() => document.getElementById('copied').textContent !== ''")
        assert forget() == {kept}
        (refused,) = page.complaints
        assert "422" in refused


def test_a_failed_job_is_never_shown_on_another_surface(browser, server: Server) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]]
    fan = {"vertices": corners, "faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4]]}  # three faces at an edge
    with httpx.Client(base_url=server.url, trust_env=False, timeout=PATIENCE) as client:
        failed = client.post("/v1/jobs", json={"surface": fan, "name": "fan"}).json()["id"]
        assert finished(client, failed)["status"] == "failed"
    with opened(browser, server) as page:
        page.select_option("#sample", "tower")
        shown(page)
        page.locator(f"[data-job='{failed}']").click()
        page.locator("#banner:visible").wait_for()
        page.wait_for_function(f"() => {{ {INSIDE} return state.result === null }}")
        assert page.locator("#files a").count() == page.locator("#quality dd").count() == 0
        assert page.evaluate("document.documentElement.dataset.shown") is None


def test_work_that_stops_early_is_shown_without_complaint(browser, server: Server) -> None:
    with httpx.Client(base_url=server.url, trust_env=False, timeout=PATIENCE) as client:
        tower = client.get("/v1/samples/tower").json()
        for early in ({"panels": None}, {"panels": None, "pattern": None}):
            id = client.post("/v1/jobs", json=tower | early).json()["id"]
            assert finished(client, id)["status"] == "done"
            with opened(browser, server, f"/#job/{id}") as page:
                assert shown(page) == id
                assert page.locator("#quality dd").count() >= 2
                assert page.complaints == []


def test_a_slow_sample_does_not_replace_a_newer_choice(browser, server: Server) -> None:
    with opened(browser, server) as page:
        held: list = []
        page.route("**/v1/samples/waist", lambda route: held.append(route))
        page.select_option("#sample", "waist")
        page.select_option("#sample", "tower")
        first = shown(page)
        held[0].continue_()
        page.wait_for_timeout(1500)
        assert page.evaluate(f"() => {{ {INSIDE} return state.name }}") == "tower"
        assert page.evaluate("document.documentElement.dataset.shown") == first


def test_theme_and_keyboard(browser, server: Server) -> None:
    with opened(browser, server) as page:
        first = page.evaluate("document.documentElement.dataset.theme")
        page.click("#theme")
        assert page.evaluate("document.documentElement.dataset.theme") != first
        wanted = {"sample", "mode", "solve", "CANVAS", "fit", "cut"}
        wanted |= {"boundary.mode", "pattern.kind", "panels.sizes"}
        for _ in range(300):  # more than there are controls, whatever is shown
            page.keyboard.press("Tab")
            wanted.discard(
                page.evaluate("(({ id, name, tagName }) => id || name || tagName)(document.activeElement)")
            )
            if not wanted:
                break
        assert not wanted


@pytest.mark.parametrize("width", [900, 420])
def test_narrow_windows_show_everything_one_below_the_other(browser, server: Server, width: int) -> None:
    with opened(browser, server) as page:
        page.set_viewport_size({"width": width, "height": 700})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        view, work, result = (page.locator(name).bounding_box() for name in ("main", "#side", "#right"))
        assert view["width"] == width
        assert view["height"] > 300
        assert min(work["y"], result["y"]) >= view["y"] + view["height"]
        assert work["x"] + work["width"] <= result["x"] or work["y"] + work["height"] <= result["y"]
        page.locator("#copy-gh").scroll_into_view_if_needed()


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the source beside which the build's packages are installed."""
    folder = tmp_path_factory.mktemp("build") / "server" / "viewer"
    shutil.copytree(VIEWER, folder, ignore=shutil.ignore_patterns("node_modules"))
    npm = shutil.which("npm")
    done = subprocess.run(
        [npm, "install", "--silent"], cwd=folder, capture_output=True, text=True, timeout=PATIENCE
    )
    if done.returncode:
        pytest.skip(f"npm could not install the build's packages: {done.stderr.strip()[-200:]}")
    return folder


@pytest.mark.long  # as the types of the Python code
@pytest.mark.skipif(
    shutil.which("npm") is None, reason="npm is not installed: the bundle cannot be built again"
)
def test_types_of_the_source_are_content(build: Path) -> None:
    subprocess.run([shutil.which("npm"), "run", "check"], cwd=build, check=True, timeout=PATIENCE)


@pytest.mark.skipif(
    shutil.which("npm") is None, reason="npm is not installed: the bundle cannot be built again"
)
def test_the_bundle_is_what_the_source_builds(build: Path) -> None:
    npm = shutil.which("npm")
    subprocess.run([npm, "run", "build"], cwd=build, check=True, capture_output=True, timeout=PATIENCE)
    built = build.parent / "hexwrap_server" / "static"
    for name in sorted(p.name for p in STATIC.iterdir()):
        assert (built / name).read_bytes() == (STATIC / name).read_bytes(), (
            f"{name}: run npm run build in server/viewer"
        )
