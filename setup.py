"""Find the packages: each top-level folder is one of the namespace crossbody."""

from setuptools import find_namespace_packages, setup

FOLDERS = ("cases", "engines", "hw", "reference", "reports")
INNER = [f"{folder}.{name}" for folder in FOLDERS for name in find_namespace_packages(folder, exclude=["*__pycache__"])]
setup(package_dir={f"crossbody.{folder}": folder for folder in FOLDERS},
      packages=[f"crossbody.{name}" for name in (*FOLDERS, *INNER)])  # fmt: skip
