"""trec_eval, the reference of information retrieval, as an oracle: `python .ci/jobs.py oracles`.

NN is its precision at 1, the first tier its R-precision, the second its recall at twice the number
of relevant results, and mAP its mean average precision. Not collected with the other tests: its
bindings are compiled, and nothing else needs them.
"""

import numpy as np
import pytest
import pytrec_eval

import riemhuman as rh


def trec_scores(distances, labels, names=None):
    """Return NN, FT, ST and mAP by trec_eval, per cent, and the number of queries."""
    n = len(distances)
    names = names or [f"{i:04d}" for i in range(n)]
    # Ranks, as it keeps scores in single precision.
    ranks = np.unique(distances, return_inverse=True)[1].reshape(n, n)
    relevant, run = {}, {}
    for i in range(n):
        others = [j for j in range(n) if j != i]
        found = {names[j]: 1 for j in others if labels[j] == labels[i]}
        if found:
            relevant[str(i)] = found
            run[str(i)] = {names[j]: -float(ranks[i, j]) for j in others}
    tiers = {query: f"recall_{2 * len(found)}" for query, found in relevant.items()}
    measures = {"P.1", "Rprec", "map"} | {tier.replace("_", ".") for tier in tiers.values()}
    measured = pytrec_eval.RelevanceEvaluator(relevant, measures).evaluate(run)
    rows = [
        [scores[name] for name in ("P_1", "Rprec", tiers[query], "map")]
        for query, scores in measured.items()
    ]
    return [*(100.0 * np.mean(rows, axis=0)), len(rows)]


def our_scores(distances, labels):
    found = rh.retrieval.scores(distances, labels)
    tiers = (found.nn, found.first_tier, found.second_tier)
    return [*tiers, found.mean_average_precision, found.n_queries]


@pytest.mark.parametrize("seed", range(20))
def test_random_matrices(seed):
    """Classes of many sizes, with some of one and one of more than half of all items."""
    rng = np.random.default_rng(seed)
    labels = rng.choice(9, 30, p=[0.55, *[0.08] * 3, *[0.042] * 5])
    distances = rng.permutation(900).reshape(30, 30).astype(float)
    np.testing.assert_allclose(
        our_scores(distances, labels), trec_scores(distances, labels), rtol=1e-12
    )
