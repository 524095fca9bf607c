"""Names that would be paths, code, formulas, markup or escapes if they were written as they are."""

from hypothesis import strategies as st

HOSTILE = (
    "../../x",
    "/abs/dir",
    "..",
    ".",
    "CON.txt",
    "a\0b",
    "x" * 5000,
    "~/.ssh/x",
    "-rf",
    'a"""; open("PWNED","w").write("x"); """',
    "a'''\nimport os; os.system('touch PWNED')\n'''",
    '\\"""+open("PWNED","w").write("x")#',
    '"); system("touch PWNED"); ("',
    "$(touch PWNED)`touch PWNED`'; touch PWNED; '",
    '=HYPERLINK("http://x")',
    "+1+cmd|' /C calc'!A0",
    "@SUM(A1)",
    "\t=1",
    "<script>alert(1)</script>",
    "]]><!--&amp;\"'",
    "a|b\n# heading\n![x](http://x/y.png)",
    "\x1b]0;owned\x07\x1b[2J",
    "a\u202egnp.exe",
    "{requirement}%s%(x)s{0}",
    "$\\frac{a}{b$",
    "umlaut ä, 漢字, \ud800",
)
names = st.one_of(
    st.sampled_from(HOSTILE), st.text(max_size=60), st.text("'\"\\`$\n\r;:./=<>&|", max_size=20)
)
