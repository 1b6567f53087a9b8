"""Find the packages: each top-level folder is one of crossbody, which the wheel makes a regular package.

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


class Regular(build_py):
    """Build with plotly's script and a `crossbody/__init__.py`; an editable one finds the folders by itself."""

    def run(self):
        """Copy the script and the packages, and make theirs a regular one."""
        (script,) = (file for file in files("plotly") or () if file.name == SCRIPT.name)
        copyfile(script.locate(), SCRIPT)
        super().run()
        if not self.editable_mode:
            (Path(self.build_lib) / "crossbody" / "__init__.py").write_text('"""Installed parts of crossbody."""\n')


setup(package_dir={f"crossbody.{folder}": folder for folder in FOLDERS}, cmdclass={"build_py": Regular},
      packages=[f"crossbody.{name}" for name in (*FOLDERS, *INNER)])  # fmt: skip
