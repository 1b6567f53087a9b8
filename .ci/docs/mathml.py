"""Formulas of the documentation as MathML, which browsers draw by themselves: no script, no request."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Replace what pymdownx.arithmatex has marked."""
    return FORMULA.sub(lambda found: convert(html.unescape(found.group(1))), content)
