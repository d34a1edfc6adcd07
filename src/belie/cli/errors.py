"""From exceptions to one line on stderr and an exit code: 0 no alert, 1 alert, 2 usage or data error."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

ALERT_RAISED = 1
BAD_INPUT = 2
INTERRUPTED = 130
BROKEN_PIPE = 141  # as a shell reports a program that SIGPIPE ended


class OneLineGroup(TyperGroup):
    """A group of commands whose errors, the user's or ours, are one line and never a traceback.

    ``BELIE_DEBUG=1`` shows tracebacks.
    """

    def invoke(self, ctx: Any) -> Any:
        """Run the command; typer would give exit code 1 to what ends it early, and that means an alert."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, BrokenPipeError) as error:
            raise typer.Exit(exit_code_of(error)) from error

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run the command line, and exit with its code (return it, where not `standalone_mode`)."""
        try:
            code = super().main(args, prog_name, complete_var, False, windows_expand_args, **extra)
            sys.stdout.flush()
        except (Exception, KeyboardInterrupt) as error:
            if os.environ.get("BELIE_DEBUG"):
                traceback.print_exc()
            code = exit_code_of(error)
        if code == BROKEN_PIPE:
            # The interpreter flushes stdout once more when it ends: let it flush into nothing.
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if standalone_mode:
            sys.exit(code if isinstance(code, int) else 0)
        return code


def keep_apart(source: Path, output: Path, flag: str) -> None:
    """Refuse to write onto the recording that is read, or into its folder.

    Raises
    ------
    RecordingError
        If `output` is `source`, or one of the files of the recording's own folder.

    Examples
    --------
    >>> keep_apart(Path("drive.mcap"), Path("drive.html"), "--report")
    """
    from belie.types import RecordingError

    target, origin = output.resolve(), source.resolve()
    if target == origin or (target.exists() and origin in target.parents):
        raise RecordingError(f"{flag} {output} would overwrite the recording itself; choose another name")


def exit_code_of(error: BaseException) -> int:
    """Tell the user what went wrong, in one line on stderr, and give the exit code.

    >>> exit_code_of(BrokenPipeError())
    141
    """
    if isinstance(error, BrokenPipeError):
        return BROKEN_PIPE
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort":
        print("belie: interrupted", file=sys.stderr)
        return INTERRUPTED
    if type(error).__name__ == "NoArgsIsHelpError":  # a command without a word more: its message is the help
        print(getattr(error, "message", error), file=sys.stderr)
        return BAD_INPUT
    print(f"belie: error: {' '.join(_text_of(error).split())}", file=sys.stderr)
    return BAD_INPUT


def _text_of(error: BaseException) -> str:
    if hasattr(error, "format_message"):  # a usage error of the command line
        command = getattr(getattr(error, "ctx", None), "command_path", "belie")
        return f"{error.format_message().rstrip('.')}; see {command} --help"
    from belie.types import BelieError, ConfigError

    if isinstance(error, ConfigError):
        return error.in_words
    if isinstance(error, BelieError):
        return str(error)
    if isinstance(error, ValueError):
        from pydantic import ValidationError

        if isinstance(error, ValidationError):  # the first of its errors says enough
            first = error.errors()[0]
            return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'input or output'}: {error.strerror or error}"
    if isinstance(error, MemoryError):
        return "out of memory"
    frame = traceback.extract_tb(error.__traceback__)[-1:]
    where = f" at {os.path.basename(frame[0].filename)}:{frame[0].lineno}" if frame else ""
    return (
        f"a fault of belie itself: {type(error).__name__}{where}: {error}; "
        "BELIE_DEBUG=1 shows the traceback: please report it"
    )
