"""Published rows as a data set: what is written is what was ranked, without a machine's times."""

import pandas as pd

from gripbench.bench.publishing.dataset import CARD, ROWS, write_dataset


def rows():
    return pd.DataFrame(
        {
            "scenario": ["b@1", "a@1"],
            "seed": [0, 1],
            "label": ["m", "m"],
            "target": ["mu", "mu"],
            "rms": [0.1, 0.2],
            "step_p50": [1e-6, 2e-6],
        }
    )


def test_rows_come_back_in_order_and_without_times(tmp_path):
    write_dataset(tmp_path, rows())
    back = pd.read_parquet(tmp_path / ROWS)
    assert list(back["scenario"]) == ["a@1", "b@1"]
    assert list(back["rms"]) == [0.2, 0.1]
    assert "step_p50" not in back
    assert "2 lines of 1 methods in 2" in (tmp_path / CARD).read_text().replace("\n", " ")


def test_the_same_rows_are_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_dataset(tmp_path / name, rows().sample(frac=1.0, random_state=len(name)))
    assert (tmp_path / "one" / ROWS).read_bytes() == (tmp_path / "two" / ROWS).read_bytes()
