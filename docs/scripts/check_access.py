"""Ask axe what keeps screen readers and keys from the pages of a folder: exit code 1 if anything.

    python docs/scripts/check_access.py FOLDER

Needs chromium, chromedriver, selenium and axe-selenium-python (the extra `test`).
"""

import shutil
import sys
from pathlib import Path

from axe_selenium_python import Axe
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

OTHERS = {"_static", "_modules", "_sources"}


def faults(browser: webdriver.Chrome, page: Path) -> list[str]:
    """What axe finds on a page, a line each."""
    browser.get(page.resolve().as_uri())
    axe = Axe(browser)
    axe.inject()
    return [
        f"{page}: {rule['id']}: {node['html'][:100]}"
        for rule in axe.run()["violations"]
        for node in rule["nodes"]
    ]


def main() -> int:
    """Check all pages but the reports of runs, which the tests of the browser check."""
    folder = Path(sys.argv[1])
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    browser = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    browser.set_script_timeout(120)
    pages = [
        page
        for page in sorted(folder.rglob("*.html"))
        if not OTHERS & {*page.relative_to(folder).parts} and page.name != "report.html"
    ]
    found = [fault for page in pages for fault in faults(browser, page)]
    browser.quit()
    print("\n".join(found) or f"axe finds nothing on {len(pages)} pages")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
