"""From an equation to its code: what docstrings say is what the index holds."""

import pytest

from gripbench.bench.publishing.equation_pages import _numbers, equations_page, places


def holders(paper, equation):
    return {(p.path, p.name) for p in places() if p.paper == paper and p.equation == equation}


@pytest.mark.parametrize("equation", range(16, 21))
def test_the_ekf_of_li_du_and_li_is_found(equation):
    paths = {path for path, _ in holders("Li, Du & Li (2014)", equation)}
    assert "methods/extended_kalman_filter.py" in paths


def test_every_equation_of_the_estimators_has_a_place():
    for paper, equations in {
        "Li, Du & Li (2014)": range(2, 30),
        "Yoon, Li & Ahn (2015)": range(4, 17),
        "Dakhlallah et al. (2008)": range(1, 13),
        "Anderson & Bevly (2004)": (1, 2, 3, 4, 5, 6, 7, 8),
    }.items():
        lacking = [number for number in equations if not holders(paper, number)]
        assert lacking == [], (paper, lacking)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("eq. 16-20", [16, 17, 18, 19, 20]),
        ("by eq. 2 and 4", [2, 4]),
        ("eq. 1, 2, 5, 7 and 8.", [1, 2, 5, 7, 8]),
        ("eq. 6b here", [6]),
        ("no equation 3", []),
    ],
)
def test_numbers_of_equations(text, numbers):
    assert list(_numbers(text)) == numbers


def test_the_page_names_files_and_functions():
    page = equations_page()
    assert "## Anderson & Bevly (2004)" in page
    assert "gripbench/methods/extended_kalman_filter.py" in page
