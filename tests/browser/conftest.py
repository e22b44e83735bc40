"""A browser for the tests that look at pages: Playwright with the system's Chromium."""

import os
import shutil

import pytest

CHROMIUM = os.environ.get("GRIPBENCH_CHROMIUM") or shutil.which("chromium")
"""The browser: that of Debian's package `chromium` unless the variable names another one."""


def pytest_configure(config):
    config.addinivalue_line("markers", "browser: needs the extra 'browser' and Chromium")


@pytest.fixture(scope="session")
def browser():
    """A running headless browser; without one the test is skipped and says what is missing."""
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="needs the extra: pip install 'gripbench[browser]'"
    )
    if CHROMIUM is None:
        pytest.skip("needs Chromium: apt-get install chromium, or set GRIPBENCH_CHROMIUM")
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"],
        )
        yield running
        running.close()
