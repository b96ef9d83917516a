"""Takes the README's pictures of the viewer: python -m docs.screenshots (needs playwright and a Chromium)."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.server.test_viewer import BROWSER_FLAGS, Server, chromium, facing_panel, on_screen, opened, shown

HERE = Path(__file__).parent
#: Picture → sample, theme, and what colours the panels.
PICTURES = {
    "viewer-tower": ("tower", "light", "size"),
    "viewer-entrance": ("entrance", "light", "scale"),
    "viewer-ring": ("ring", "dark", "size"),
}


def main() -> None:
    data = Path(tempfile.mkdtemp())
    server = Server(data)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium(), args=BROWSER_FLAGS)
            for name, (sample, theme, mode) in PICTURES.items():
                with opened(browser, server) as page:
                    if page.evaluate("document.documentElement.dataset.theme") != theme:
                        page.click("#theme")
                    page.select_option("#sample", sample)
                    shown(page)
                    page.select_option("#mode", mode)
                    page.mouse.click(*on_screen(page, "panels.center", facing_panel(page)))
                    page.wait_for_timeout(1500)
                    page.screenshot(path=HERE / f"{name}.png")
    finally:
        server.stop()
        shutil.rmtree(data, ignore_errors=True)


if __name__ == "__main__":
    main()
