"""A table, before it is drawn anywhere."""

from __future__ import annotations

from dataclasses import dataclass

NOTHING = "–"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table for terminal, Markdown and page alike.

    Parameters
    ----------
    title, note : str
        What it shows, and how to read it.
    head : tuple of str
        Its columns.
    rows : tuple of tuple of str
        Its cells.
    published : tuple of int
        Columns of figures that others published.
    """

    title: str
    note: str = ""
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    published: tuple[int, ...] = ()
