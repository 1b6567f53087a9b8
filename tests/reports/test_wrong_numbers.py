"""Every option that takes a number says in words what is no number, and shows a short name for it."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from crossbody.reports.cli import cli


def commands(group: click.Group, *path: str) -> list[tuple[tuple[str, ...], click.Command]]:
    found = []
    for name, one in group.commands.items():
        found += commands(one, *path, name) if isinstance(one, click.Group) else [((*path, name), one)]
    return found


OPTIONS = [
    (path, one) for path, command in commands(cli) for one in command.params
    if isinstance(one, click.Option) and not one.is_flag
    and isinstance(one.type, click.types.IntParamType | click.types.FloatParamType)
]  # fmt: skip


@pytest.mark.parametrize(("path", "option"), OPTIONS, ids=[f"{'-'.join(path)} {one.name}" for path, one in OPTIONS])
def test_what_is_no_number_is_told_in_words(path: tuple[str, ...], option: click.Option) -> None:
    done = CliRunner().invoke(cli, [*path, option.opts[0], "abc"])
    assert done.exit_code == 2
    said = " ".join(done.output.split())
    assert f"Invalid value for '{option.opts[0]}" in said
    assert "number" in said
    assert not any(word in said.lower() for word in ("float", "integer"))
    assert option.metavar, "a type is no name of a value"
    assert len(option.metavar) <= len("MB")
