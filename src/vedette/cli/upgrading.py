"""The command that brings results of earlier formats to the present one: upgrade."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vedette.cli.output import publish, say
from vedette.cli.running import interruptible
from vedette.extras import need


def upgrade(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results folder of a campaign, or of a single run.")],
) -> None:
    """Bring a results folder of an earlier format to the one that this version reads, in place."""
    need("vedette upgrade", "pyarrow")
    with interruptible("nothing is lost; the same command goes on"):
        from vedette.campaigns.upgrading import upgrade_results
        from vedette.simulation.kept import FORMAT_VERSION

        number = upgrade_results(folder)
        if number == FORMAT_VERSION:
            say(f"{folder}: format {number}, which this version reads; nothing was changed")
        else:
            say(f"{folder}: format {number} is now {FORMAT_VERSION}")
            if (tables := folder / "tables").is_dir():
                say(f"next: vedette results {folder} --export {tables}, to write its tables anew")
        publish({"folder": folder, "format_was": number, "format": FORMAT_VERSION})
