"""Templates of pages: texts stay their letters, tables become tables, what lacks is an error."""

from pathlib import Path
from types import SimpleNamespace

import jinja2
import pytest

from gripbench.bench.publishing import pages, study_page
from gripbench.bench.publishing.columns import Table

HERE = Path(study_page.__file__).parent
WORDS = "<b>1 & 2</b>"
LETTERS = "&lt;b&gt;1 &amp; 2&lt;/b&gt;"


def study(**changed):
    table = Table.of_texts(("name",), [(WORDS,)])
    content = {
        "said": SimpleNamespace(name=WORDS, description=WORDS), "windows": WORDS, "answer": WORDS,
        "board": table, "target": WORDS, "pictures": ["AAAA"], "undetermined": (WORDS,),
        "quality": WORDS, "found": table, "tuned": table, "left_out": {WORDS: WORDS},
    }  # fmt: skip
    return pages.template(HERE, "study.html").render(content | changed)


def test_every_text_of_a_page_is_its_letters():
    page = study()
    assert WORDS not in page
    assert page.count(LETTERS) == 13
    assert page.count("<table") == 3


def test_what_there_is_not_is_said():
    page = study(found=None, tuned=Table.of_texts(("name",), []), left_out={}, undetermined=())
    assert page.count("<p>Nothing.</p>") == 2
    assert "<p>No method.</p>" in page
    assert "<p>None.</p>" in page


def test_a_name_that_a_page_is_not_given_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="answer"):
        pages.template(HERE, "study.html").render(
            said=SimpleNamespace(name="", description=""), windows=""
        )
