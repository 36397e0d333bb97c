"""The command line: `jaxbiped COMMAND`."""

import sys
from typing import Annotated

import tyro
from tyro.conf import subcommand

from jaxbiped._checks import ArgumentError
from jaxbiped._progress import tell_stages
from jaxbiped.cli._basin import Basin
from jaxbiped.cli._constraints import Constraints
from jaxbiped.cli._gait import FindGait
from jaxbiped.cli._models import Models
from jaxbiped.cli._walk import Walk

_Command = (
    Annotated[Walk, subcommand("walk")]
    | Annotated[FindGait, subcommand("gait")]
    | Annotated[Basin, subcommand("basin")]
    | Annotated[Models, subcommand("models")]
    | Annotated[Constraints, subcommand("constraints")]
    | Annotated[None, subcommand("version")]
)


def main(arguments: list[str] | None = None) -> None:
    """Runs a command and exits; 2 and one sentence for an argument that is not allowed."""
    command = tyro.cli(_Command, args=arguments, prog="jaxbiped", description=__doc__)
    if command is None:
        from importlib.metadata import version

        print(version("jaxbiped"))
        return
    tell_stages()
    try:
        sys.exit(command.run())
    except ArgumentError as error:
        print(f"jaxbiped: {error}", file=sys.stderr)
        sys.exit(2)
