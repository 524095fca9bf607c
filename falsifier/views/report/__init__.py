"""Reports on runs and campaigns: a self-contained HTML page, or Markdown.

::

    Path("report.html").write_text(html_report(Path("runs/nightly")), encoding="utf-8")
"""

from falsifier.views.report.markdown import markdown_report as markdown_report
from falsifier.views.report.page import html_report as html_report
