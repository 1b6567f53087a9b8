"""A cluster behind TLS: both ends are known to each other, or nothing is sent."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from crossbody.cases import InvalidValue, SchedulerUnavailable
from crossbody.reports.cli import main
from crossbody.reports.sweep import pools

pytestmark = [
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates of this test"),
    pytest.mark.filterwarnings("ignore"),
]


def certified(folder: Path) -> pools.Tls:
    """A certificate that vouches for itself, and its key."""
    folder.mkdir(exist_ok=True)
    files = folder / "cert.pem", folder / "key.pem"
    words = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=localhost -out {} -keyout {}"
    subprocess.run(["openssl", *words.format(*files).split()], check=True, capture_output=True)
    return pools.Tls(ca=str(files[0]), cert=str(files[0]), key=str(files[1]))


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, pools.Tls]]:
    """A scheduler without workers, and what it is spoken to with."""
    distributed = pytest.importorskip("distributed")
    tls = certified(tmp_path / "ours")
    security = distributed.Security(
        tls_ca_file=tls.ca, tls_scheduler_cert=tls.cert, tls_scheduler_key=tls.key, require_encryption=True,
        tls_client_cert=tls.cert, tls_client_key=tls.key,
    )  # fmt: skip
    with distributed.LocalCluster(
        n_workers=0, processes=False, security=security, protocol="tls", host="127.0.0.1", dashboard_address=None
    ) as made:
        yield made.scheduler_address, tls


def test_those_who_know_each_other_talk_and_others_do_not(cluster: tuple[str, pools.Tls], tmp_path: Path) -> None:
    address, tls = cluster
    client = pools.connect(address, tls)
    assert client.scheduler_info()["address"].startswith("tls://")
    client.close()
    for stranger in (None, certified(tmp_path / "theirs")):
        with pytest.raises(SchedulerUnavailable):
            pools.connect(address, stranger)


@pytest.mark.parametrize(
    "tls", [pools.Tls(ca="ca.pem"), pools.Tls(key="key.pem"), pools.Tls(ca="absent.pem", cert="absent.pem")]
)
def test_half_of_it_or_what_is_not_there_is_refused(tls: pools.Tls, tmp_path: Path, monkeypatch: Any) -> None:
    pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidValue, match="--tls"):
        pools.connect("tls://127.0.0.1:1", tls)


def test_options_for_no_scheduler_are_wrong_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["stress", "gap", "--runs", "4", "--jobs", "1", "--tls-ca", "ca.pem", "--out", str(tmp_path / "out")])
    assert end.value.code == 2
    assert "--scheduler" in capsys.readouterr().err
