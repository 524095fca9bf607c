from falsifier.views.html import Html, el, join, whole_options


def test_texts_are_escaped_and_elements_are_not() -> None:
    assert el("p", "1 < 2 & 3", el("b", "x")) == "<p>1 &lt; 2 &amp; 3<b>x</b></p>"
    assert join("<", Html("<br>"), '"') == "&lt;<br>&quot;"
    assert isinstance(join(), Html)


def test_attributes_are_escaped_always() -> None:
    assert el("a", href='"><script>') == '<a href="&quot;&gt;&lt;script&gt;"></a>'
    assert el("a", href=Html('"')) == '<a href="&quot;"></a>'


def test_names_of_attributes_are_pythons() -> None:
    assert el("p", class_="a", aria_label="b", title=None) == '<p class="a" aria-label="b"></p>'


def test_numbers_are_short() -> None:
    assert el("td", width=1 / 3, height=100.0) == '<td width="0.333333" height="100"></td>'


def test_elements_without_content_are_closed_as_their_kind_is() -> None:
    assert (el("br"), el("td")) == ("<br>", "<td></td>")
    assert el("circle", el("title", "t")) == "<circle><title>t</title></circle>"


def test_lines_do_not_end_within_the_name_of_an_option() -> None:
    text = whole_options("try --api-base <b>, or a-b --x")
    assert str(text) == (
        'try <span class="option">--api-base</span> &lt;b&gt;, or a-b <span class="option">--x</span>'
    )
