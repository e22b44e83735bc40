"""A real local Ray cluster gives the scores of one process."""

import pytest

import gripbench
from gripbench.bench.ranking.summary import scores_csv

pytest.importorskip("ray", reason="needs: pip install 'gripbench[ray]'")


@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_two_workers_give_the_scores_of_one_process(short_scenario, tmp_path):
    arguments = {"scenarios": [short_scenario], "methods": ["slip_slope"], "seeds": 12}
    alone = gripbench.run(**arguments, results=tmp_path / "alone", workers=1)
    spread = gripbench.run(**arguments, results=tmp_path / "ray", workers=2, backend="ray")
    assert scores_csv(spread) == scores_csv(alone)
