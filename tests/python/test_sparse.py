"""Sparse coding from Python: against scikit-learn and numpy, and the seam itself."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

import surfabet
from surfabet import sparse
from surfabet.errors import InvalidInputError


def random_dictionary(rng, n_atoms, n_features):
    atoms = rng.normal(size=(n_atoms, n_features))
    return (atoms / np.linalg.norm(atoms, axis=1, keepdims=True)).astype(np.float32)


def test_agrees_with_scikit_learn_where_nothing_is_missing():
    linear_model = pytest.importorskip("sklearn.linear_model")
    rng = np.random.default_rng(0)
    dictionary = random_dictionary(rng, 60, 40)
    signals = rng.normal(size=(200, 40)).astype(np.float32)
    codes = sparse.omp(dictionary, signals, max_atoms=6, selection="correlation")
    expected = linear_model.orthogonal_mp(
        dictionary.T.astype(float), signals.T.astype(float), n_nonzero_coefs=6
    ).T
    np.testing.assert_allclose(codes.to_dense(60), expected, atol=2e-5)


def test_agrees_with_scikit_learn_on_the_observed_part_of_a_signal():
    linear_model = pytest.importorskip("sklearn.linear_model")
    rng = np.random.default_rng(1)
    dictionary = random_dictionary(rng, 30, 40)
    signals = rng.normal(size=(50, 40)).astype(np.float32)
    mask = rng.random(signals.shape) < 0.7
    codes = sparse.omp(dictionary, signals, weights=mask, max_atoms=4, selection="correlation")
    for signal, seen, code in zip(signals, mask, codes.to_dense(30), strict=True):
        atoms = dictionary[:, seen].T.astype(float)
        norms = np.linalg.norm(atoms, axis=0)
        expected = linear_model.orthogonal_mp(
            atoms / norms, signal[seen].astype(float), n_nonzero_coefs=4
        )
        np.testing.assert_allclose(code, expected / norms, atol=2e-5)


def test_coefficients_solve_the_weighted_least_squares_problem():
    rng = np.random.default_rng(2)
    dictionary = random_dictionary(rng, 50, 30)
    signals = rng.normal(size=(40, 30)).astype(np.float32)
    weights = rng.random(signals.shape).astype(np.float32)
    codes = sparse.omp(dictionary, signals, weights=weights, max_atoms=5)
    errors = sparse.squared_errors(dictionary, signals, codes, weights=weights)
    for i, (atoms, coefficients) in enumerate(codes):
        root = np.sqrt(weights[i].astype(float))
        design = dictionary[atoms].T.astype(float) * root[:, None]
        expected, residual, *_ = np.linalg.lstsq(design, signals[i] * root, rcond=None)
        np.testing.assert_allclose(coefficients, expected, atol=1e-4)
        np.testing.assert_allclose(errors[i], residual[0], rtol=1e-4)


def test_reconstruction_is_the_dense_product():
    rng = np.random.default_rng(3)
    dictionary = random_dictionary(rng, 20, 10)
    signals = rng.normal(size=(30, 10))
    codes = sparse.omp(dictionary, signals, max_atoms=3)
    again = sparse.reconstruct(dictionary, codes)
    np.testing.assert_allclose(again, codes.to_dense(20) @ dictionary, atol=1e-5)
    expected = ((signals - again) ** 2).sum(axis=1)
    got = sparse.squared_errors(dictionary, signals, codes)
    np.testing.assert_allclose(got, expected, rtol=1e-4)


def test_ksvd_learns_from_what_is_seen():
    rng = np.random.default_rng(4)
    truth = random_dictionary(rng, 12, 24)
    coefficients = rng.normal(size=(400, 12)) * (rng.random((400, 12)) < 0.2)
    signals = coefficients @ truth
    seen = rng.random(signals.shape) < 0.7
    fractions = []
    learned = sparse.ksvd(
        signals * seen,
        weights=seen,
        n_atoms=12,
        max_atoms=4,
        iterations=8,
        convergence=0,
        progress=lambda stage, fraction: fractions.append((stage, fraction)),
    )
    assert learned.iterations == 8
    assert learned.stop_reason == "iterations"
    assert len(learned.objective) == 9
    assert np.all(np.diff(learned.objective) <= 1e-6 * (signals**2).sum())
    assert learned.dictionary.shape == (12 - learned.cropped, 24)
    np.testing.assert_allclose(np.linalg.norm(learned.dictionary, axis=1), 1, atol=1e-5)
    assert len(learned.codes) == 400
    errors = sparse.squared_errors(learned.dictionary, signals * seen, learned.codes, weights=seen)
    np.testing.assert_allclose(errors.sum(), learned.objective[-1], rtol=1e-9)
    assert fractions[-1] == ("dictionary", 1.0)
    assert "12 atoms" in repr(learned) or learned.cropped


def test_one_atom_without_weights_is_the_leading_singular_vector():
    rng = np.random.default_rng(5)
    signals = rng.normal(size=(60, 9)) * np.array([3, 1, 1, 1, 1, 1, 1, 1, 1])
    learned = sparse.ksvd(signals, n_atoms=1, max_atoms=1, iterations=30, convergence=0)
    expected = np.linalg.svd(signals)[2][0]
    assert abs(expected @ learned.dictionary[0]) == pytest.approx(1, abs=1e-5)


def test_threads_do_not_change_a_bit():
    rng = np.random.default_rng(6)
    signals = rng.normal(size=(500, 20)).astype(np.float32)
    weights = rng.random(signals.shape).astype(np.float32)
    results = []
    try:
        for n_threads in (1, 2, 8):
            surfabet.set_num_threads(n_threads)
            learned = sparse.ksvd(signals, weights=weights, n_atoms=30, max_atoms=3, iterations=3)
            results.append((learned.dictionary.tobytes(), learned.codes.coefficients.tobytes()))
    finally:
        surfabet.set_num_threads(None)
    assert results[0] == results[1] == results[2]


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.uint8])
def test_any_real_dtype_and_layout_is_taken(dtype):
    values = np.arange(24).reshape(4, 6).astype(dtype)
    dictionary = np.eye(6)
    expected = sparse.omp(dictionary, values.astype(np.float32), max_atoms=6)
    for view in (np.asfortranarray(values), values[::-1][::-1], np.repeat(values, 2, 1)[:, ::2]):
        codes = sparse.omp(dictionary, view, max_atoms=6)
        np.testing.assert_array_equal(codes.coefficients, expected.coefficients)


def test_codes_are_a_read_only_sequence():
    codes = sparse.SparseCodes([0, 2, 2, 3], [1, 0, 1], [2.0, 3.0, -1.0])
    assert len(codes) == 3
    assert codes[-1][0].tolist() == [1]
    assert [len(atoms) for atoms, _ in codes] == [2, 0, 1]
    with pytest.raises(IndexError):
        codes[3]
    with pytest.raises(IndexError):
        codes[-4]
    with pytest.raises(ValueError, match="read-only"):
        codes.coefficients[0] = 1
    with pytest.raises(InvalidInputError, match="n_atoms is 1"):
        codes.to_dense(1)


def test_empty_input_is_fine():
    codes = sparse.omp(np.eye(4), np.empty((0, 4)))
    assert len(codes) == 0
    learned = sparse.ksvd(np.zeros((3, 4)), n_atoms=2)
    assert learned.dictionary.shape == (0, 4)
    assert len(learned.codes) == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sparse.omp(np.eye(3), [[1, np.nan, 0]]), "signal 0 has NaN at feature 1"),
        (lambda: sparse.omp(np.eye(3), np.ones((2, 4))), "3 features and the signals 4"),
        (lambda: sparse.omp(2 * np.eye(3), np.ones((2, 3))), "atom 0 has norm 2"),
        (lambda: sparse.omp(np.eye(3), np.ones(3)), r"of the shape \(n, m\)"),
        (lambda: sparse.omp(np.eye(3), np.ones((2, 3)), max_atoms=0), "max_atoms is 0"),
        (lambda: sparse.omp(np.eye(3), np.ones((2, 3)), weights=np.ones((3, 2))), "weights"),
        (lambda: sparse.omp(np.eye(3), np.ones((2, 3)), weights=-np.ones((2, 3))), "weight row 0"),
        (lambda: sparse.omp(np.eye(3), np.ones((2, 3)), selection="best"), "selection"),
        (lambda: sparse.ksvd(np.ones((2, 3)), n_atoms=0), "n_atoms is 0"),
        (lambda: sparse.ksvd(np.ones((2, 3)), convergence=2), "convergence is 2"),
        (lambda: sparse.SparseCodes([0, 5], [1], [1.0]), "offsets"),
        (lambda: sparse.reconstruct(np.eye(2), sparse.SparseCodes([0, 1], [7], [1.0])), "atom 7"),
    ],
)
def test_wrong_input_is_named(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


def test_an_exception_in_the_callback_stops_the_learning():
    def interrupt(stage, fraction):
        raise KeyboardInterrupt

    rng = np.random.default_rng(7)
    signals = rng.normal(size=(3000, 50))
    with pytest.raises(KeyboardInterrupt):
        sparse.ksvd(signals, n_atoms=200, iterations=1000, convergence=0, progress=interrupt)


def test_docstring_examples():
    assert doctest.testmod(sparse).failed == 0
