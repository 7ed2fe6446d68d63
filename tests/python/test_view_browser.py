"""The page of `surfabet view` in Chromium: pixels, mouse, fingers, keys, and a quiet console."""

from __future__ import annotations

import base64
import importlib.util
import os
import re
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any, ClassVar
from urllib.parse import unquote

import numpy as np
import pytest
from scipy.spatial import cKDTree

import surfabet as sb
from surfabet._distance_field import distance_field
from surfabet.view import page_of

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests" / "golden"
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
WHY = (
    "selenium is not installed (pip install selenium)"
    if importlib.util.find_spec("selenium") is None
    else "no Chromium with its driver (apt-get install chromium chromium-driver)"
    if BROWSER is None or DRIVER is None
    else ""
)
pytestmark = pytest.mark.skipif(bool(WHY), reason=WHY)
ORIGIN = (500_000.0, 5_000_000.0, 100.0)
OPEN = """
const done = arguments[0];
const wait = setInterval(() => {
  const message = document.getElementById("message");
  if (!window.surfabet && message.hidden) return;
  clearInterval(wait);
  if (window.surfabet) surfabet.ready.then(done);
  else done(false);
}, 10);
"""
PIXELS = """
const view = surfabet;
view.moving.until = 0;
view.drawNow();
const { gl } = view.renderer;
const [w, h] = [view.canvas.width, view.canvas.height];
const pixels = new Uint8Array(4 * w * h);
gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
let text = "";
for (let i = 0; i < pixels.length; i += 8192) {
  text += String.fromCharCode(...pixels.subarray(i, i + 8192));
}
return [w, h, btoa(text)];
"""
BACKGROUND = (22, 24, 28)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(BROWSER)
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
        "--window-size=640,520",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(str(DRIVER)))
    driver.set_script_timeout(120)
    yield driver
    driver.quit()


@pytest.fixture
def show(browser: Any, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Opens the page of a model or of bytes, and checks afterwards that nothing was wrong."""

    def open_page(
        model: Any, name: str = "map.sfb", *, is_good: bool = True, field: bytes = b""
    ) -> Any:
        data = model if isinstance(model, bytes) else model.to_bytes()
        page = tmp_path / "page.html"
        page.write_text(page_of(data, name, field), "utf-8")
        browser.get_log("browser")
        browser.get(page.as_uri())
        assert browser.execute_async_script(OPEN) is is_good
        return browser

    yield open_page
    wrong = [
        entry for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")
    ]
    assert not [entry for entry in wrong if "GPU stall due to ReadPixels" not in entry["message"]]


def pixels(page: Any) -> Any:
    """The picture as (height, width, 3), from above."""
    width, height, text = page.execute_script(PIXELS)
    data = np.frombuffer(base64.b64decode(text), np.uint8)
    return data.reshape(height, width, 4)[::-1, :, :3]


def is_drawn(picture: Any) -> Any:
    """Where something else than the background, and its shaded rim, is."""
    return (picture.astype(int) > np.array(BACKGROUND) + 2).any(axis=2)


def click(page: Any, x: float, y: float) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    builder = ActionBuilder(page)
    builder.pointer_action.move_to_location(round(x), round(y)).click()
    builder.perform()
    ActionChains(page).pause(0.05).perform()


def key(page: Any, letter: str) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    ActionChains(page).send_keys(letter).perform()


def run(page: Any, script: str, *arguments: Any) -> Any:
    return page.execute_script(script, *arguments)


def wait(page: Any, condition: str) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(page, 60, 0.05).until(lambda page: run(page, f"return {condition}"))


def decode_again(page: Any, script: str) -> int:
    """Changes something that decodes again, and gives the number of points that then are there."""
    before = run(page, "return surfabet.lastDecode")
    run(page, script)
    wait(page, f"surfabet.lastDecode > {before} && !surfabet.isDecoding")
    return int(run(page, "return surfabet.points.count"))


def picked_place(page: Any) -> list[float]:
    """A place near the middle of the page where a point is drawn, with that point: x, y, number."""
    found = run(
        page,
        """
        surfabet.moving.until = 0;
        surfabet.drawNow();
        const { width, height } = surfabet.camera;
        for (let k = 0; k < 400; k++) {
          const a = Math.round(width * (0.62 + 0.02 * (k % 15)));
          const b = Math.round(height * (0.3 + 0.015 * Math.floor(k / 15)));
          const number = surfabet.pointAt(a, b);
          if (number >= 0) return [a, b, number];
        }
        return null;
        """,
    )
    assert found is not None
    return [float(c) for c in found]


@pytest.fixture(scope="module")
def corner() -> sb.PointCloud:
    """A floor and two walls of 2 m, in map coordinates, each of a colour."""
    side = np.arange(0.025, 2, 0.05)
    u, v = (c.ravel() for c in np.meshgrid(side, side))
    zero = np.zeros_like(u)
    points = np.concatenate([np.stack(p, 1) for p in ((u, v, zero), (zero, u, v), (u, zero, v))])
    colors = np.repeat(np.array([[200, 60, 40], [40, 180, 60], [60, 80, 210]], np.uint8), len(u), 0)
    return sb.PointCloud(points + ORIGIN, colors=colors)


@pytest.fixture(scope="module")
def planes(corner: sb.PointCloud) -> sb.PlaneModel:
    return sb.learn_planes(corner, min_grid_size=0.1)


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*.sfb")), ids=lambda path: path.stem)
def test_models_of_every_kind_are_drawn(path: Path, show: Any) -> None:
    model = sb.load(path)
    page = show(model, path.name)
    assert is_drawn(pixels(page)).mean() > 0.005
    spacing, count = run(page, "return [surfabet.points.spacing, surfabet.points.count]")
    assert count == len(model.decode(spacing))
    assert path.name in page.title
    assert f"{len(model):,}" in run(page, "return about.textContent")
    if os.environ.get("CI"):
        folder = ROOT / "out" / "view"
        folder.mkdir(parents=True, exist_ok=True)
        page.save_screenshot(str(folder / f"{path.stem}.png"))


def test_pixels_have_the_colours_of_the_points_there(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    run(page, "light.value = 0; light.oninput()")
    picture = pixels(page)
    seen = run(
        page,
        """
        const found = [];
        const { width, height } = surfabet.canvas;
        for (let k = 0; k < 400; k++) {
          const x = Math.floor(width * (0.4 + 0.029 * (k % 20)));
          const y = Math.floor(height * (0.05 + 0.045 * Math.floor(k / 20)));
          const i = surfabet.renderer.pick(surfabet.scene(1e9), x, y, 0);
          if (i >= 0) found.push([x, y, ...surfabet.points.colors.subarray(3 * i, 3 * i + 3)]);
        }
        return found;
        """,
    )
    assert len(seen) > 8
    for x, y, *color in seen:
        assert np.abs(picture[y, x].astype(int) - color).max() <= 1
    reds = {tuple(color) for _, _, *color in seen}
    assert len(reds) >= 2
    flat = picture[is_drawn(picture)]
    run(page, "light.value = 2; light.oninput()")
    assert pixels(page)[is_drawn(picture)].mean() < flat.mean()


def test_a_click_shows_map_coordinates_to_the_millimetre(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    x, y, number = picked_place(page)
    click(page, x, y)
    wait(page, "!card.hidden")
    cells = run(page, "return [...card.querySelectorAll('tr')].map((row) => row.innerText)")
    facts = dict(cell.split("\t") for cell in cells)
    shown = np.array([float(facts[axis].split()[0]) for axis in "xyz"])
    local = run(page, f"return surfabet.position({int(number)})")
    np.testing.assert_allclose(shown, np.array(local) + planes.origin, atol=0.00051)
    points = planes.decode().points
    distance = np.linalg.norm(points - shown, axis=1)
    assert distance.min() < 0.001
    assert int(facts["plane"]) in range(len(planes))
    assert "supported tiles" in facts
    key(page, "\ue00c")
    assert run(page, "return card.hidden")


def test_the_wheel_zooms_to_the_pointer(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    x, y, number = picked_place(page)
    script = f"return surfabet.camera.project(surfabet.position({int(number)}))"
    before = np.array(run(page, script))
    far = run(page, "return surfabet.camera.distance")
    page.execute_cdp_cmd(
        "Input.dispatchMouseEvent",
        {"type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": -240},
    )
    wait(page, f"surfabet.camera.distance < {0.9 * far}")
    assert np.abs(np.array(run(page, script)) - before).max() < 1.5


def test_dragging_turns_and_moves(show: Any, planes: sb.PlaneModel) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    page = show(planes)
    canvas = page.find_element("id", "view")
    first = pixels(page)
    target, yaw = run(page, "return [surfabet.camera.target, surfabet.camera.yaw]")
    ActionChains(page, duration=40).drag_and_drop_by_offset(canvas, 80, 20).perform()
    turned = run(page, "return [surfabet.camera.target, surfabet.camera.yaw]")
    assert turned[0] == target
    assert turned[1] != yaw
    assert (pixels(page) != first).any(axis=2).mean() > 0.02
    drag = ActionChains(page, duration=40).key_down(Keys.SHIFT)
    drag.drag_and_drop_by_offset(canvas, 60, 0).key_up(Keys.SHIFT).perform()
    moved = run(page, "return [surfabet.camera.target, surfabet.camera.yaw]")
    assert moved[1] == turned[1]
    assert np.linalg.norm(np.subtract(moved[0], target)) > 0.05
    assert run(page, "return card.hidden"), "dragging is no click"
    key(page, "r")
    assert run(page, "return surfabet.camera.yaw") == yaw


def test_two_fingers_zoom(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    far = run(page, "return surfabet.camera.distance")
    for kind, spread in (
        ("touchStart", 40),
        ("touchMove", 60),
        ("touchMove", 100),
        ("touchEnd", 0),
    ):
        points = [{"x": 420 - spread, "y": 200, "id": 1}, {"x": 420 + spread, "y": 200, "id": 2}]
        page.execute_cdp_cmd(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": points if spread else []},
        )
    wait(page, f"surfabet.camera.distance < {0.6 * far}")


def test_spacing_and_thickness_are_decoded_in_the_page(show: Any) -> None:
    model = sb.load(GOLDEN / "patches_0_1.sfb")
    page = show(model)
    own = run(page, "return surfabet.info.spacing")
    coarse = decode_again(page, "spacing.value = 1; spacing.oninput()")
    assert coarse == len(model.decode(2 * own))
    fine = decode_again(page, "spacing.value = -1; spacing.oninput()")
    assert fine == len(model.decode(own / 2))
    thick = decode_again(page, "measured.click()")
    assert thick == len(model.decode(own / 2, as_measured=True))
    few = decode_again(
        page,
        f"budget.add(new Option('', {thick // 4})); budget.value = {thick // 4};budget.onchange()",
    )
    assert few <= thick // 4
    assert "more than allowed" in run(page, "return document.getElementById('status').textContent")


def test_colourings_show_what_they_say(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    pictures = {"color": pixels(page)}
    for mode in ("height", "normal", "part"):
        script = f"mode.value = '{mode}'; mode.onchange()"
        if mode == "normal":
            decode_again(page, script)
        else:
            run(page, script)
        pictures[mode] = pixels(page)
    for mode in ("height", "normal", "part"):
        changed = (pictures[mode] != pictures["color"]).any(axis=2)
        assert changed[is_drawn(pictures["color"])].mean() > 0.5
    normals = run(page, "return [...surfabet.points.normals.subarray(0, 3)]")
    assert np.linalg.norm(normals) == pytest.approx(1, abs=1e-5)


def test_a_distance_is_measured_between_two_clicks(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    key(page, "m")
    x, y, _ = picked_place(page)
    click(page, x, y)
    click(page, x - 60, y + 30)
    wait(page, "surfabet.ends.length === 2")
    ends = np.array(run(page, "return surfabet.ends"))
    text = run(page, "return card.innerText")
    assert f"{np.linalg.norm(ends[0] - ends[1]):.3f} m" in text
    assert run(page, "return overlay.querySelectorAll('line').length") == 1
    key(page, "\ue00c")
    assert run(page, "return surfabet.ends.length") == 0


def test_lengths_are_called_by_the_unit_of_the_note(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes.to_bytes(note="CRS: EPSG:2994; lengths in ft"))
    assert run(page, "return spacingText.textContent").endswith(" ft")
    x, y, _ = picked_place(page)
    click(page, x, y)
    wait(page, "!card.hidden")
    text = run(page, "return card.innerText")
    for name in ("x", "y", "z", "supported tiles", "standard deviation"):
        assert re.search(rf"^{name}\t.* ft$", text, re.MULTILINE), name
    key(page, "m")
    click(page, x, y)
    click(page, x - 60, y + 30)
    wait(page, "surfabet.ends.length === 2")
    assert re.search(r"^distance\t[0-9.]+ ft$", run(page, "return card.innerText"), re.MULTILINE)
    assert run(page, "return overlay.querySelector('text').textContent").endswith(" ft")


def test_a_box_crops(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    whole = is_drawn(pixels(page)).mean()
    key(page, "b")
    run(page, "const low = document.getElementById('crop-z-low'); low.value = 800; low.oninput()")
    assert is_drawn(pixels(page)).mean() < 0.7 * whole
    low = run(page, "return surfabet.low[2] + surfabet.info.origin[2]")
    assert low == pytest.approx(ORIGIN[2] + 0.8 * 2, abs=0.05)
    run(page, "cropReset.click(); crop.open = false")
    assert is_drawn(pixels(page)).mean() == pytest.approx(whole, rel=0.02)


def test_what_is_seen_from_behind_is_hidden(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    turn = "surfabet.camera.yaw += Math.PI; surfabet.camera.pitch *= -1"

    def both_sides() -> float:
        first = is_drawn(pixels(page)).mean()
        run(page, turn)
        second = is_drawn(pixels(page)).mean()
        run(page, turn)
        return float(first + second)

    whole = both_sides()
    decode_again(page, "facing.click()")
    # Each plane is seen from one side of two.
    assert 0.3 * whole < both_sides() < 0.8 * whole


def test_outlines_are_drawn(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    before = pixels(page)
    key(page, "l")
    wait(page, "surfabet.renderer.lines.count > 0")
    yellow = (pixels(page).astype(int) - before).sum(axis=2) != 0
    assert 50 < yellow.sum() < 0.2 * yellow.size


def test_all_occurrences_of_the_word_clicked_are_found(show: Any) -> None:
    model = sb.load(GOLDEN / "alphabet_0_1.sfb")
    page = show(model)
    x, y, number = picked_place(page)
    before = pixels(page)
    click(page, x, y)
    wait(page, "!card.hidden")
    part = run(page, f"return surfabet.points.parts[{int(number)}]")
    word = model.occurrences.words[part]
    run(page, "document.getElementById('findAll').click()")
    wait(page, "surfabet.found !== null")
    assert (
        sorted(run(page, "return surfabet.found"))
        == np.flatnonzero(model.occurrences.words == word).tolist()
    )
    assert (pixels(page) != before).any()


def test_distances_to_a_second_cloud_are_shown(
    show: Any, corner: sb.PointCloud, planes: sb.PlaneModel
) -> None:
    # The cloud has all of the corner but its floor, from which the map is up to 2 m away.
    walls = corner.select(corner.points[:, 2] > ORIGIN[2] + 0.01)
    page = show(planes, field=distance_field(planes, walls, "walls.ply"))
    assert run(page, "return mode.selectedOptions[0].text") == "distance to walls.ply (m)"
    count = run(page, "return surfabet.points.count")
    local = np.array(run(page, "return [...surfabet.points.positions]")).reshape(count, 3)
    shown = np.array(run(page, "return [...surfabet.points.attributes[0].values]"))
    exact = cKDTree(walls.points).query(local + planes.origin)[0]
    # Cells of two spacings, and steps of a few percent.
    spacing = run(page, "return surfabet.info.spacing")
    assert np.isfinite(shown).all()
    assert (np.abs(shown - exact) <= 4 * spacing + 0.05 * exact).all()
    assert np.abs(shown - exact).mean() < spacing
    ends = run(page, "return scaleEnds.innerText").split()
    assert float(ends[-2]) == pytest.approx(np.quantile(exact, 0.99), rel=0.1)
    first = pixels(page)
    run(page, "mode.value = 'color'; mode.onchange()")
    assert run(page, "return scale.hidden")
    assert (pixels(page) != first).any(axis=2).mean() > 0.05
    x, y, number = picked_place(page)
    click(page, x, y)
    wait(page, "!card.hidden")
    assert f"{shown[int(number)]:.3g}"[:4] in run(page, "return card.innerText")
    far = decode_again(page, "spacing.value = -1; spacing.oninput()")
    assert far > count
    assert run(page, "return surfabet.points.attributes[0].values.length") == far


def test_a_screenshot_is_a_png(show: Any, planes: sb.PlaneModel, tmp_path: Path) -> None:
    page = show(planes, "corner.sfb")
    page.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    key(page, "s")
    path = tmp_path / "corner.png"
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(page, 30, 0.05).until(lambda _: path.exists() and path.stat().st_size > 1000)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_help_names_the_keys(show: Any, planes: sb.PlaneModel) -> None:
    page = show(planes)
    key(page, "?")
    assert run(page, "return help.open")
    assert "measure" in run(page, "return help.innerText")
    key(page, "\ue00c")
    assert not run(page, "return help.open")


def test_a_damaged_model_is_an_error_in_the_page(show: Any) -> None:
    data = bytearray((GOLDEN / "patches_0_1.sfb").read_bytes())
    data[-20] ^= 4
    page = show(bytes(data), is_good=False)
    assert "the file is damaged" in run(page, "return message.textContent")
    assert not run(page, "return message.hidden")


def test_while_moving_only_as_much_is_drawn_as_there_is_time_for(
    show: Any, planes: sb.PlaneModel
) -> None:
    page = show(planes)
    state = "return [surfabet.moving.scale, surfabet.moving.count, surfabet.moving.light]"
    run(page, "Object.assign(surfabet.moving, { count: 200000, scale: 1, light: true })")
    run(page, "surfabet.adapt(100)")
    assert run(page, state) == [0.5, 200_000, True]
    run(page, "surfabet.adapt(100)")
    scale, count, light = run(page, state)
    assert (scale, light) == (0.5, True)
    assert 30_000 < count < 60_000
    run(page, "for (let i = 0; i < 30; i++) surfabet.adapt(100)")
    assert run(page, state) == [0.25, 15_000, False]
    # Nothing is changed for a picture that takes its time, and all comes back when there is time.
    run(page, "surfabet.adapt(24)")
    assert run(page, state) == [0.25, 15_000, False]
    run(page, "for (let i = 0; i < 60; i++) surfabet.adapt(2)")
    scale, count, light = run(page, state)
    assert (scale, light) == (1, True)
    assert count >= run(page, "return surfabet.points.count")
    run(page, "surfabet.moving.scale = 0.25")
    run(page, "surfabet.moving.count = 16000; surfabet.moved(); surfabet.drawNow()")
    assert run(page, "return surfabet.stats.drawn") <= 16_000
    run(page, "surfabet.moving.until = 0; surfabet.drawNow()")
    assert run(page, "return surfabet.stats.drawn === surfabet.points.count")


class Server(SimpleHTTPRequestHandler):
    """Files of a folder, with ranges unless they are switched off; notes what was asked for."""

    has_ranges = True
    asked: ClassVar[list[tuple[str, int]]] = []

    def do_GET(self) -> None:
        path = Path(self.directory, unquote(self.path).lstrip("/"))
        if not path.is_file():
            self.send_error(404)
            return
        data = path.read_bytes()
        given = self.headers.get("Range")
        if given is None or not self.has_ranges:
            part = data
            self.send_response(200)
        else:
            start, end = (int(c) for c in given.removeprefix("bytes=").split("-"))
            part = data[start : end + 1]
            self.send_response(206)
            end = start + len(part) - 1
            self.send_header("Content-Range", f"bytes {start}-{end}/{len(data)}")
        self.asked.append((path.name, len(part)))
        self.send_header("Content-Type", "text/html" if path.suffix == ".html" else "x/y")
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """The address of a server of the temporary folder."""
    handler = partial(Server, directory=str(tmp_path))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    Thread(target=server.serve_forever, daemon=True).start()
    Server.asked.clear()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def hall() -> sb.PointCloud:
    """A floor of 12 x 12 m, in map coordinates, turned, with noise that takes bytes."""
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 12, (80_000, 2))
    points = np.column_stack([xy, 0.004 * rng.standard_normal(len(xy))])
    turn = np.deg2rad(23)
    rows = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points[:, :2] = points[:, :2] @ rows.T
    colors = rng.integers(0, 255, (len(xy), 3)).astype(np.uint8)
    return sb.PointCloud(points + ORIGIN, colors=colors)


def test_tiles_near_the_view_are_read_from_a_server(
    browser: Any, served: str, hall: sb.PointCloud, tmp_path: Path
) -> None:
    path = tmp_path / "hall map.sfb"
    report = sb.learn_patches_tiled(
        hall,
        path,
        tile=2.56,
        resolution=0.04,
        levels=2,
        color_step=1,
        color_rate=0.001,
        note="lengths in ft",
    )
    model = sb.load(path)
    assert isinstance(model, sb.TiledPatchModel)
    sb.view(path, tmp_path / "page.html", link=True)
    page = tmp_path / "page.html"
    assert page.stat().st_size < 110_000
    assert "hall%20map.sfb" in page.read_text("utf-8")
    budget = 40_000
    text = page.read_text("utf-8").replace('value="1000000" selected', f'value="{budget}" selected')
    page.write_text(text, "utf-8")
    browser.get(f"{served}/page.html")
    assert browser.execute_async_script(OPEN), run(browser, "return message.textContent")
    shown, count = run(browser, "return [surfabet.points.nShown, surfabet.points.count]")
    assert 1 <= shown < report.n_tiles
    assert 0 < count <= budget
    read = sum(n for name, n in Server.asked if name == path.name)
    assert read < 0.7 * path.stat().st_size
    assert f"{report.n_tiles} tiles" in run(browser, "return about.textContent")
    assert run(browser, "return about.title") == "lengths in ft"
    assert run(browser, "return spacingText.textContent").endswith(" ft")
    # What is shown is what lies in the boxes of the tiles nearest to the middle of all.
    whole = model.decode(run(browser, "return surfabet.points.spacing")).points
    local = run(browser, "return [...surfabet.points.positions.subarray(0, 3000)]")
    found = np.array(local).reshape(-1, 3) + model.origin
    assert cKDTree(whole).query(found)[0].max() < 1e-3
    bounds = np.array(run(browser, "return surfabet.info.bounds")) + model.origin
    assert (bounds[0] <= whole.min(axis=0)).all()
    assert (bounds[1] >= whole.max(axis=0)).all()
    lines = run(browser, "return surfabet.renderer.lines.count")
    assert lines == 8 * report.n_tiles
    # Elsewhere other tiles are shown.
    before = run(browser, "return surfabet.lastDecode")
    corner = (whole[np.argmin(whole @ [1.0, 1.0, 0])] - model.origin).tolist()
    run(browser, "surfabet.camera.target = arguments[0]; surfabet.moved()", corner)
    wait(browser, f"surfabet.lastDecode > {before} && !surfabet.isDecoding")
    local = run(browser, "return [...surfabet.points.positions]")
    there = np.array(local).reshape(-1, 3)
    assert np.linalg.norm(there - corner, axis=1).min() < 0.1
    assert np.linalg.norm(there - corner, axis=1).max() < np.ptp(whole, axis=0).max()
    # All of them where the budget allows for it.
    run(browser, "budget.add(new Option('', 5000000)); budget.value = 5000000; budget.onchange()")
    wait(browser, f"surfabet.points.nShown === {report.n_tiles}")
    assert run(browser, "return surfabet.points.count") == len(model.decode())


def test_a_link_that_leads_nowhere_is_an_error_in_the_page(
    browser: Any, served: str, tmp_path: Path
) -> None:
    path = tmp_path / "map.sfb"
    path.write_bytes((GOLDEN / "patches_0_1.sfb").read_bytes())
    page = sb.view(path, tmp_path / "page.html", link=True)
    browser.get(page.as_uri())
    assert browser.execute_async_script(OPEN) is False
    assert "open this page through a web server" in run(browser, "return message.textContent")
    path.rename(tmp_path / "elsewhere.sfb")
    browser.get(f"{served}/page.html")
    assert browser.execute_async_script(OPEN) is False
    assert "map.sfb cannot be read: the server says 404" in run(
        browser, "return message.textContent"
    )


@pytest.mark.parametrize("has_ranges", [True, False])
def test_files_without_tiles_and_servers_without_ranges_work_too(
    has_ranges: bool, browser: Any, served: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Server, "has_ranges", has_ranges)
    path = tmp_path / "map.sfb"
    path.write_bytes((GOLDEN / "patches_0_1.sfb").read_bytes())
    sb.view(path, tmp_path / "page.html", link=True)
    browser.get(f"{served}/page.html")
    assert browser.execute_async_script(OPEN)
    model = sb.load(path)
    assert run(browser, "return surfabet.points.count") == len(
        model.decode(run(browser, "return surfabet.points.spacing"))
    )
    assert run(browser, "return surfabet.points.colors.length") > 0
