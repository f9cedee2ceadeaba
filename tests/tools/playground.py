"""A folder of static files with which anyone can try `gtb` in a browser: Python runs in the page, by Pyodide."""

import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

PAGE = Path(__file__).with_suffix(".html")

PACKAGES = ("gtb_cli", "click", "trimesh")  # pure Python; Pyodide has numpy, and scipy is not needed


def build(folder: Path) -> None:
    """Write the page and its packages, which is all that a server of files needs."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_bytes(PAGE.read_bytes())
    with zipfile.ZipFile(folder / "packages.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for package in PACKAGES:
            root = Path(str(find_spec(package).origin)).parent
            for path in sorted(root.rglob("*")):
                if path.is_file() and path.suffix != ".pyc":
                    content = zipfile.ZipInfo(str(package / path.relative_to(root)))
                    archive.writestr(content, path.read_bytes(), zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
