"""Pages are looked at where there is a browser; `make browser` asks for one."""

from tests.tools.browser import BROWSERS, browser

__all__ = ["browser"]
collect_ignore = [] if BROWSERS else ["test_browser.py"]
