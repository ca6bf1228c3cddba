"""Pages of reports: text is escaped wherever it comes from, and a page is one well-formed document."""

import base64
import re
from html import escape
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flyaround.simulator.reports.markup import VOID, Markup, element, markup
from flyaround.simulator.reports.page import Page, gallery, key_figures, link, note, picture, plot, table
from flyaround.simulator.reports.pictures import jpeg
from flyaround.simulator.reports.plots import figure_with_axes, png

HOSTILE = "<script>alert('\"&')</script>"


class Reader(HTMLParser):
    """Text and open elements of a document."""

    def __init__(self):
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def read(html):
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader


@given(st.text(alphabet=st.characters(exclude_categories=("C",))))
def test_any_text_comes_out_as_it_went_in(text):
    assert read(element("p", text)).text == text
    (found,) = re.findall(r'title="([^"]*)"', element("p", title=text))
    assert not set(found) & set("<>\"'")


def test_markup_is_not_escaped_twice():
    assert element("b", element("i", "a < b")) == "<b><i>a &lt; b</i></b>"
    assert markup("a", None, ["b", (1, Markup("<br>"))]) == "ab1<br>"


def test_attributes_have_the_names_of_html():
    found = element("text", class_="x", text_anchor="end", hidden=True, id=None, open=False)
    assert found == '<text class="x" text-anchor="end" hidden></text>'


@pytest.mark.parametrize("dark", [False, True])
def test_a_page_of_every_piece_is_well_formed_and_harmless(tmp_path, *, dark):
    page = Page(HOSTILE, dark=dark, width_px=900)
    page.add(note(HOSTILE), link("a.csv"), key_figures([(HOSTILE, HOSTILE), (3, "wrong")], bad=["wrong"]))
    page.section(HOSTILE, table((HOSTILE, "b"), [(HOSTILE, 1.5)]))
    page.add(gallery([picture("a.jpg", HOSTILE, alt=HOSTILE)], columns=3), plot(b"x", HOSTILE, alt=HOSTILE))
    text = page.write(tmp_path / "index.html").read_text()
    reader = read(text)
    assert "script" not in reader.seen
    assert reader.text.count(HOSTILE) == 10
    assert 'class="tile bad"' in text
    assert ('class="dark"' in text) is dark


def test_a_plot_is_carried_in_the_page():
    figure, (ax,) = figure_with_axes(1, 1, 2.0)
    ax.plot([0, 1], [0, 1])
    data = png(figure)
    (source,) = re.findall(r'src="data:image/png;base64,([^"]+)"', plot(data, None, alt="a line"))
    assert base64.b64decode(source) == data
    assert data.startswith(b"\x89PNG")


@pytest.mark.parametrize("shape", [(8, 8), (8, 8, 3)])
def test_pictures_are_jpeg_files(shape):
    assert jpeg(np.full(shape, 90, np.uint8)).startswith(b"\xff\xd8")


def test_a_folding_table_becomes_cards_where_its_words_do_not_fit():
    page = Page("t")
    page.add_folding_table(("name", HOSTILE), [(HOSTILE, element("b", 1.5)), ("few", "")])
    page.add_folding_table(("name", *"abcdefgh"), [("few", *["a-very-long-word 0.00611"] * 8)])
    html = page.html()
    reader = read(html)
    assert "script" not in reader.seen
    # the card's label is the column's head
    assert html.count(f'data-head="{escape(HOSTILE)}"') == 2
    assert '<td data-head="a">a-very-long-word 0.00611</td>' in html
    # a break between words or at a hyphen, not within 0.00611: eight columns of it, and the first
    few, many = (int(px) for px in re.findall(r"@media\(max-width:(\d+)px\){\ntable\.fold-", html))
    letters = 4 + 8 * len("0.00611")
    assert many == pytest.approx(letters * 8.4 + 9 * 16 + 64, abs=1)
    assert few < many
    with pytest.raises(ValueError, match="zip"):
        page.add_folding_table(("a", "b"), [("1",)])
