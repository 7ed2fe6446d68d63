"""`surfabet view` until its first picture: python benches/view/first_picture.py FILE.sfb ...

Needs selenium, and Chromium with its driver, which is headless and draws by software (SwiftShader).
Per file: bytes of the file and of its page; seconds of processor time, over all processes of the
browser, from the start of loading to the first picture and to that of all points; wall milliseconds
from the start of the page to its first picture, on the machine as it is; and the camera moving for
60 pictures, after 60 in which the page finds out what it has time for: points in each, median
milliseconds until a picture is drawn, pictures per second, and milliseconds of processor time per
picture.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from selenium import webdriver

import surfabet as sb

READY = """
const done = arguments[0];
const wait = setInterval(() => {
  if (!window.surfabet || !(STAGE)) return;
  clearInterval(wait);
  done(surfabet.firstPicture);
}, 5);
"""
MOVE = """
const done = arguments[0];
let left = 60;
const times = [];
const began = performance.now();
const step = () => {
  surfabet.camera.orbit(6, 0);
  surfabet.moving.until = performance.now() + 1000;
  surfabet.drawNow();
  times.push(surfabet.stats.milliseconds);
  if (--left > 0) return requestAnimationFrame(step);
  const { moving, stats } = surfabet;
  times.sort((a, b) => a - b);
  const rate = 60000 / (performance.now() - began);
  done([stats.drawn, moving.scale, times[30], rate]);
};
step();
"""


def processor_seconds(root: int) -> float:
    """User and system time of a process and all below it."""
    times, children = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            # Also of children that have ended.
            times[int(entry.name)] = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
            children.setdefault(int(fields[1]), []).append(int(entry.name))
    waiting, total = [root], 0.0
    while waiting:
        pid = waiting.pop()
        total += times.get(pid, 0.0)
        waiting += children.get(pid, [])
    return total


def measure(driver: Any, root: int, path: Path, folder: Path) -> str:
    page = sb.view(path, folder / "page.html")
    model = sb.load(path)
    driver.get("about:blank")
    began = processor_seconds(root)
    driver.get(page.as_uri())
    first = driver.execute_async_script(READY.replace("STAGE", "surfabet.firstPicture"))
    to_first = processor_seconds(root) - began
    ready = "surfabet.firstPicture && surfabet.info.isComplete && !surfabet.isDecoding"
    driver.execute_async_script(READY.replace("STAGE", ready))
    to_all = processor_seconds(root) - began
    points = driver.execute_script("return surfabet.points.count")
    driver.execute_async_script(MOVE)
    began = processor_seconds(root)
    drawn, scale, median, rate = driver.execute_async_script(MOVE)
    per_picture = (processor_seconds(root) - began) / 60
    cells = (
        path.stem,
        model.method,
        f"{path.stat().st_size:,}",
        f"{page.stat().st_size:,}",
        f"{to_first:.2f}",
        f"{to_all:.2f}",
        f"{points:,}",
        f"{first:.0f}",
        f"{drawn:,} at {scale:g}",
        f"{median:.0f}",
        f"{rate:.0f}",
        f"{1000 * per_picture:.0f}",
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--window-size=1280,800",
    ):
        options.add_argument(argument)
    service = webdriver.ChromeService(shutil.which("chromedriver") or "")
    driver = webdriver.Chrome(options, service)
    driver.set_script_timeout(600)
    print("| file | method | bytes | page | CPU s to first | to all | points |", end="")
    print(" wall ms to first | moving: points | median ms | per second | CPU ms |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        for name in sys.argv[1:]:
            print(measure(driver, service.process.pid, Path(name), Path(folder)), flush=True)
    driver.quit()


if __name__ == "__main__":
    main()
