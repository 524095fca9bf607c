import pytest

from falsifier.views.html import Html, el, join


@pytest.mark.parametrize(
    ("made", "markup"),
    [
        # Texts are escaped, and elements are not.
        (el("p", "1 < 2 & 3", el("b", "x")), "<p>1 &lt; 2 &amp; 3<b>x</b></p>"),
        (join("<", Html("<br>"), '"'), "&lt;<br>&quot;"),
        (join(), ""),
        # Attributes are escaped always; their names are Python's, and numbers are short.
        (el("a", href='"><script>'), '<a href="&quot;&gt;&lt;script&gt;"></a>'),
        (el("a", href=Html('"')), '<a href="&quot;"></a>'),
        (el("p", class_="a", aria_label="b", title=None), '<p class="a" aria-label="b"></p>'),
        (el("td", width=1 / 3, height=100.0), '<td width="0.333333" height="100"></td>'),
        # Elements without content are closed as their kind is.
        (el("br"), "<br>"),
        (el("td"), "<td></td>"),
        (el("circle", el("title", "t")), "<circle><title>t</title></circle>"),
    ],
)
def test_values_become_markup(made: str, markup: str) -> None:
    assert isinstance(made, Html) and made == markup
