"""Triangle matrices are summed where the triangles are."""

import numpy as np
from cases import sphere_template

from riemhuman.surfaces.assembly import TriangleAssembler


def test_sum_equals_a_loop():
    template = sphere_template()
    blocks = np.random.default_rng(0).normal(size=(template.n_faces, 9, 9))
    dense = np.zeros((3 * template.n_vertices,) * 2)
    for face, block in zip(template.faces, blocks, strict=True):
        where = (3 * face[:, None] + np.arange(3)).ravel()
        dense[np.ix_(where, where)] += block
    assembled = TriangleAssembler(template.faces, template.n_vertices).assemble(blocks)
    np.testing.assert_allclose(assembled.toarray(), dense, atol=1e-13)


def test_unused_vertices_have_empty_rows():
    matrix = TriangleAssembler(np.array([[0, 1, 3]]), 5).assemble(np.ones((1, 9, 9)))
    assert matrix.shape == (15, 15)
    assert matrix.nnz == 81
    assert not matrix.toarray()[6:9].any()
