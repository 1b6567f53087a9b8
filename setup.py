"""Find the packages: each top-level folder is one of crossbody, which is itself what is in reports/package.

A bare folder called crossbody, as that of a checkout, is a namespace to Python and yields to a regular package wherever
that is installed: a script beside a checkout imports what was installed.

Pages are drawn by plotly's script, which is put beside their templates here: a wheel needs no plotly.
"""

from importlib.metadata import files
from pathlib import Path
from shutil import copyfile

from setuptools import find_namespace_packages, setup
from setuptools.command.build_py import build_py

FOLDERS = ("cases", "engines", "hw", "reference", "reports")
INNER = [f"{folder}.{name}" for folder in FOLDERS for name in find_namespace_packages(folder, exclude=["*__pycache__"])]
SCRIPT = Path(__file__).parent / "reports" / "pages" / "templates" / "plotly.min.js"


class WithScript(build_py):
    """Build with plotly's script."""

    def run(self):
        """Copy the script, then the packages."""
        (script,) = (file for file in files("plotly") or () if file.name == SCRIPT.name)
        copyfile(script.locate(), SCRIPT)
        super().run()


FOUND = {"crossbody": "reports/package"} | {f"crossbody.{folder}": folder for folder in FOLDERS}
setup(package_dir=FOUND, cmdclass={"build_py": WithScript}, packages=[*FOUND, *(f"crossbody.{name}" for name in INNER)])
