"""Pages of the site that are files of the repository: design notes, changelog, how to contribute."""

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
# Links as the repository has them -> as the site has them.
_LINK = re.compile(r"\]\((?:docs|\.\./docs)/")


def on_files(files: Files, config: MkDocsConfig, **_: Any) -> Files:
    """Add the pages."""
    for path in [ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "design").glob("*.md"))]:
        place = path.relative_to(ROOT).as_posix()
        name = place.lower() if path.parent == ROOT else place
        up = "../" * name.count("/")
        content = _LINK.sub(f"]({up}", path.read_text(encoding="utf-8"))
        files.append(File.generated(config, name, content=content))
    return files
