"""A report as one HTML page: skeleton, style, and components."""

from __future__ import annotations

import base64
import html
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flyaround.simulator.reports.markup import Content, Markup, element, markup
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

STYLE = """
:root{--ink:#1f2933;--dim:#627080;--paper:#f5f7fa;--card:#fff;--line:#e4e7eb;--link:#1769aa;--bad:#c8453b}
.dark{--ink:#d7dde5;--dim:#8a97a6;--paper:#12171e;--card:#1a212b;--line:#2b3440;--link:#7cc4ee;--bad:#ff8a80;
color-scheme:dark}
body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif}
main{margin:0 auto;padding:32px 24px 64px}
h1{font-size:26px;line-height:1.25;margin:0 0 4px}
h2{font-size:19px;margin:36px 0 8px}h3{font-size:15px;margin:20px 0 6px}
p{margin:4px 0 10px;max-width:95ch}p.dim{max-width:none}a{color:var(--link)}
.dim,figcaption{color:var(--dim);font-size:13px}.dim{margin:2px 0 8px}
figure{background:var(--card);border:1px solid var(--line);border-radius:8px;margin:0;overflow:hidden}
figure img,figure svg{width:100%;height:auto;display:block}figcaption{padding:6px 12px 8px}
.plot{margin:0 0 16px;padding:14px 14px 6px}.plot figcaption{padding:6px 0 2px}
.gallery{display:grid;gap:10px;margin:0 0 12px;align-items:start}
.figures{display:flex;flex-wrap:wrap;gap:12px;margin:20px 0}
.tile{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:11px 16px;flex:1 1 130px}
.tile b{display:block;white-space:nowrap;font-size:22px;line-height:1.35;font-variant-numeric:tabular-nums}
.tile span{color:var(--dim);font-size:13px}.tile.bad b{color:var(--bad)}
.scroll{overflow-x:auto;margin:8px 0 16px}
table{border-collapse:collapse;background:var(--card);border:1px solid var(--line);width:100%}
td,th{padding:6px 12px;text-align:right;border-top:1px solid var(--line);white-space:nowrap;
font-variant-numeric:tabular-nums}
td:first-child,th:first-child{text-align:left}th{border-top:0;color:var(--dim);font-weight:600;font-size:13px}
td small{color:var(--dim)}
table.fold{font-size:13px}table.fold td,table.fold th{padding:6px 8px;white-space:normal;vertical-align:top}
@media(max-width:900px){.gallery{grid-template-columns:repeat(2,1fr)!important}}
@media print{body{background:#fff}figure,.tile{break-inside:avoid}}
"""


FOLDED_STYLE = """\
/* fold */
@media(max-width:LEAST_PXpx){
TABLE{background:none;border:0}
TABLE,TABLE tbody,TABLE td{display:block}
TABLE tbody{display:grid;gap:10px;grid-template-columns:repeat(auto-fill,minmax(min(300px,100%),1fr))}
TABLE tr{display:block;background:var(--card);border:1px solid var(--line);border-radius:8px;padding:6px 0}
TABLE tr:first-child{display:none}
TABLE td{display:flex;justify-content:space-between;gap:16px;border:0;padding:2px 12px;overflow-wrap:anywhere}
TABLE td:first-child{font-weight:600}
TABLE td+td::before{content:attr(data-head);color:var(--dim);text-align:left}
TABLE td:empty{display:none}
}
"""
"""Style of the cards into which the table of selector TABLE turns in windows up to LEAST_PX wide."""

# Width of a wide letter in a folding table, padding of a cell on both sides as in STYLE, and margins of the page: 24 on
# each side as in STYLE, and 16 for a scroll bar.
LETTER_PX, CELL_PX, MARGIN_PX = 8.4, 16, 64


@dataclass
class Page:
    """A report under construction.

    Parameters
    ----------
    title : str
        Title of the window.
    heading : str, optional
        Heading of the page, by default the title.
    width_px : int, optional
        Largest width of the page.
    dark : bool, optional
        Light ink on dark paper, for pages that are mostly images of space.
    style : str, optional
        CSS of this page alone, after the common one.
    parts : list of Markup, optional
        Contents so far, in order.
    """

    title: str
    heading: str | None = None
    width_px: int = 1180
    dark: bool = False
    style: str = ""
    parts: list[Markup] = field(default_factory=list)
    _n_folding_tables: int = field(default=0, init=False)

    def add(self, *content: Content) -> None:
        """Append to the page."""
        self.parts.append(markup(*content))

    def section(self, heading: Content, *content: Content) -> None:
        """Append a second-level heading and its contents."""
        self.add(element("h2", heading), *content)

    def add_folding_table(self, head: Sequence[str], rows: Iterable[Sequence[Content]]) -> None:
        """Append a table that turns into one card per row in a window too narrow for its columns.

        Parameters
        ----------
        head : sequence of str
            Names of the columns; the first column names the rows, and empty cells are omitted from cards.
        rows : iterable of sequence
            Cells of each row.
        """
        cells = [[markup(cell) for cell in row] for row in rows]
        widths = [max(map(_longest_word, column)) for column in zip(head, *cells, strict=True)]
        least = round(sum(LETTER_PX * width + CELL_PX for width in widths)) + MARGIN_PX
        self._n_folding_tables += 1
        name = f"fold-{self._n_folding_tables}"
        self.style += _folded(f"table.{name}", least)
        lines = [element("tr", *(element("th", text) for text in head))]
        for row in cells:
            named = (element("td", cell, data_head=text) for text, cell in zip(head, row, strict=True))
            lines.append(element("tr", *named))
        self.add(element("div", element("table", *lines, class_=f"fold {name}"), class_="scroll"))

    def html(self) -> str:
        """Render the whole document.

        Returns
        -------
        str
            HTML from its doctype to a line feed at the end, with the style included.
        """
        head = markup(
            element("meta", charset="utf-8"),
            element("meta", name="viewport", content="width=device-width"),
            element("title", self.title),
            element("style", Markup(STYLE + self.style)),
        )
        heading = element("h1", self.heading or self.title)
        body = element(
            "main",
            heading,
            *(markup("\n", part) for part in self.parts),
            style=f"max-width:{self.width_px}px",
        )
        document = element("html", "\n", element("head", head), "\n", _body(body, dark=self.dark), lang="en")
        return f"<!doctype html>\n{document}\n"

    def write(self, path: Path) -> Path:
        """Write the page to a file.

        Returns
        -------
        Path
            The given ``path``.

        Raises
        ------
        UserError
            If the folder cannot be written.
        """
        write_atomic(path, self.html().encode())
        return path


def _longest_word(cell: str) -> int:
    """Return the length of the longest word of a cell; a tag counts as a space."""
    text = html.unescape(re.sub(r"<[^>]*>", " ", cell))
    return max(map(len, re.split("[ \n-]", text)))


def _folded(table: str, least_px: int) -> str:
    """Return the style of a table's cards, for windows narrower than it needs."""
    return FOLDED_STYLE.replace("TABLE", table).replace("LEAST_PX", str(least_px))


def _body(main: Markup, *, dark: bool) -> Markup:
    return element("body", "\n", main, "\n", class_="dark" if dark else None)


def note(*content: Content) -> Markup:
    """Build a paragraph of small print.

    Returns
    -------
    Markup
        A ``p`` element.
    """
    return element("p", *content, class_="dim")


def link(address: str, text: Content | None = None) -> Markup:
    """Build a link.

    Returns
    -------
    Markup
        An ``a`` element with ``text``, by default with the address.
    """
    return element("a", address if text is None else text, href=address)


def table(head: Sequence[Content], rows: Iterable[Sequence[Content]]) -> Markup:
    """Build a table; a wide one scrolls by itself.

    Returns
    -------
    Markup
        A ``table`` in a ``div``. The first column, which names the rows, is left-aligned.
    """
    lines = [element("tr", *(element("th", cell) for cell in head))]
    lines += [element("tr", *(element("td", cell) for cell in row)) for row in rows]
    return element("div", element("table", *lines), class_="scroll")


def key_figures(figures: Iterable[tuple[Content, Content]], *, bad: Iterable[str] = ()) -> Markup:
    """Build a line of key figures from (value, label) pairs.

    Returns
    -------
    Markup
        A ``div`` with one tile per figure, in their order; the values of labels in ``bad`` are red.
    """
    marked = set(bad)
    return element(
        "div",
        *(
            element(
                "div",
                element("b", value),
                element("span", label),
                class_="tile bad" if label in marked else "tile",
            )
            for value, label in figures
        ),
        class_="figures",
    )


def picture(source: str, caption: Content, *, alt: str) -> Markup:
    """Build an image with its caption.

    Returns
    -------
    Markup
        A ``figure``; the image is loaded lazily from ``source``, a file next to the page.
    """
    return element(
        "figure", element("img", src=source, alt=alt, loading="lazy"), element("figcaption", caption)
    )


def plot(png: bytes, caption: Content, *, alt: str) -> Markup:
    """Build a plot as wide as the page.

    Returns
    -------
    Markup
        A ``figure`` with the PNG embedded, so that the page can be sent as one file; an empty caption is left out.
    """
    source = "data:image/png;base64," + base64.b64encode(png).decode()
    return element(
        "figure",
        element("img", src=source, alt=alt),
        caption and element("figcaption", caption),
        class_="plot",
    )


def gallery(pictures: Iterable[Content], *, columns: int | None = None, least_px: int = 260) -> Markup:
    """Arrange images side by side.

    Returns
    -------
    Markup
        A ``div`` with ``columns`` images in a line, or as many as fit at ``least_px`` each.
    """
    width = f"repeat({columns},1fr)" if columns else f"repeat(auto-fill,minmax({least_px}px,1fr))"
    return element("div", *pictures, class_="gallery", style=f"grid-template-columns:{width}")
