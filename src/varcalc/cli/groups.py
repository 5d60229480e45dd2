"""How commands are found, and what becomes of one that is stopped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from varcalc.progress import Interrupted, heard
from varcalc.spelling import near
from varcalc_command import EXIT_AFTER_INTERRUPT

T = TypeVar("T")


class Commands(click.Group):
    """A group that suggests the command that may have been meant, and ends with the status of Ctrl-C after it."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the first argument names."""
        if args and self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            known = self.list_commands(ctx)
            remedy = near(args[0], known) or f"; there are {', '.join(known)}"
            raise click.UsageError(f"there is no command {args[0]!r}{remedy}", ctx)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Carry the command out."""
        try:
            with heard():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo("stopped", err=True)
            raise SystemExit(EXIT_AFTER_INTERRUPT) from None


def kept(call: Callable[[], T]) -> tuple[T, bool]:
    """What ``call`` gives back, or what was known when Ctrl-C stopped it; and whether it did."""
    try:
        return call(), False
    except Interrupted as stop:
        if stop.known is None:
            raise
        return stop.known, True


def end(*, stopped: bool, failed: bool, status: int = 1) -> None:
    """End the command with the status of what became of it."""
    if stopped:
        click.echo("stopped; what was finished by then is above", err=True)
        raise SystemExit(EXIT_AFTER_INTERRUPT)
    if failed:
        raise SystemExit(status)
