"""Takes the picture of the guide page `view.md`: python docs/view_picture.py [FILE]

Needs surfabet, selenium, and Chromium with its driver.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from selenium import webdriver

import surfabet as sb
from surfabet import datasets

# Seen from above and the side, without what is seen from behind: the ceiling and the near walls.
VIEW = """
const done = arguments[0];
const wait = setInterval(async () => {
  if (!window.surfabet) return;
  clearInterval(wait);
  await surfabet.ready;
  document.getElementById("facing").checked = true;
  await surfabet.decode();
  Object.assign(surfabet.camera, { yaw: -1.0, pitch: 0.7 });
  surfabet.camera.distance *= 0.72;
  surfabet.drawNow();
  done();
}, 20);
"""


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures/view.png")
    model = sb.learn_patches(datasets.load_demo().cloud)
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--window-size=1100,760",
    ):
        options.add_argument(argument)
    with TemporaryDirectory() as folder:
        page = sb.view(model, Path(folder) / "page.html", title="room.sfb")
        service = webdriver.ChromeService(shutil.which("chromedriver") or "")
        driver = webdriver.Chrome(options, service)
        driver.set_script_timeout(300)
        driver.get(page.as_uri())
        driver.execute_async_script(VIEW)
        driver.save_screenshot(str(path))
        driver.quit()


if __name__ == "__main__":
    main()
