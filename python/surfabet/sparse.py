"""Sparse coding of signals with missing values: matching pursuit and weighted K-SVD.

Signals are rows of an array, with a weight per value: 0 (or ``False``) where nothing was observed,
1 (or ``True``) where something was, anything between for what is less certain.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_choice, check_integer, check_number
from surfabet._core import Ksvd, SparseCodes
from surfabet._progress import Progress, progress_callback
from surfabet.errors import wrong_type

__all__ = ["Ksvd", "SparseCodes", "ksvd", "omp", "reconstruct", "squared_errors"]

Selection = Literal["least_squares", "correlation"]


def _as_weights(weights: ArrayLike | None) -> NDArray[Any] | None:
    if weights is None:
        return None
    array = np.asarray(weights)
    return array.astype(np.float32) if array.dtype == np.bool_ else array


def _check_coding(max_atoms: object, tolerance: object, selection: object) -> None:
    check_integer("max_atoms", max_atoms, 1)
    check_number("tolerance", tolerance, "0 or a positive number", least=0.0)
    check_choice("selection", selection, ("least_squares", "correlation"))


def _check_codes(codes: object) -> None:
    if not isinstance(codes, SparseCodes):
        raise wrong_type("codes", codes, "SparseCodes, as omp gives them")


def omp(
    dictionary: ArrayLike,
    signals: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    max_atoms: int = 5,
    tolerance: float = 0.0,
    selection: Selection = "least_squares",
) -> SparseCodes:
    """Sparse codes of signals over a dictionary, by orthogonal matching pursuit.

    Minimises ``sum(weights * (signals - codes @ dictionary)**2)`` greedily, signal by signal.

    Parameters
    ----------
    dictionary : array_like of shape (n_atoms, n_features)
        Atoms of norm 1.
    signals : array_like of shape (n_signals, n_features)
        Finite values; those of weight 0 are ignored.
    weights : array_like of shape (n_signals, n_features), optional
        A mask, or how much the error of each value counts. Default: all count 1.
    max_atoms : int
        Most atoms in a code.
    tolerance : float
        A code is complete when the root of the weighted mean of its squared errors falls to this.
    selection : {"least_squares", "correlation"}
        Take the atom that lowers the error most once all coefficients are solved for again, or
        the one with the largest cosine with the residual (classical matching pursuit).

    Returns
    -------
    SparseCodes
        One code per signal, atoms in the order they were chosen. Signals that are zero, or of
        which nothing is observed, have empty codes.

    Raises
    ------
    InvalidInputError
        Shapes do not fit, a number is not finite, or an atom is not of norm 1.

    Notes
    -----
    Computed in single precision; the result does not depend on the number of threads.

    Examples
    --------
    >>> import surfabet.sparse as sparse
    >>> codes = sparse.omp([[1, 0, 0], [0, 0.6, 0.8]], [[3, 1.2, 99]], weights=[[1, 1, 0]])
    >>> codes.to_dense(2).round(4)
    array([[3., 2.]], dtype=float32)
    """
    _check_coding(max_atoms, tolerance, selection)
    return _core.sparse_omp(
        dictionary, signals, _as_weights(weights), max_atoms, tolerance, selection
    )


def ksvd(
    signals: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    n_atoms: int = 256,
    max_atoms: int = 5,
    tolerance: float = 0.0,
    selection: Selection = "least_squares",
    iterations: int = 20,
    convergence: float = 1e-3,
    random_state: int = 0,
    max_coherence: float = 0.9,
    update_iterations: int = 8,
    update_tolerance: float = 1e-4,
    progress: Progress = None,
) -> Ksvd:
    """Learn a dictionary and sparse codes over it, by weighted K-SVD.

    Minimises ``sum(weights * (signals - codes @ dictionary)**2)`` over both, with at most
    `max_atoms` entries in a code. With a mask as weights that is eq. 1 of Hierarchical Sparse
    Coded Surface Models (Ruhnke, Bo, Fox, Burgard, 2014); without weights it is plain K-SVD.

    Parameters
    ----------
    signals : array_like of shape (n_signals, n_features)
        Finite values; those of weight 0 are ignored.
    weights : array_like of shape (n_signals, n_features), optional
        A mask, or how much the error of each value counts. Default: all count 1.
    n_atoms : int
        Most atoms of the dictionary; the number of signals limits it too.
    max_atoms : int
        Most atoms in a code.
    tolerance : float
        A code is complete when the root of the weighted mean of its squared errors falls to this.
    selection : {"least_squares", "correlation"}
        How atoms are chosen, see `omp`.
    iterations : int
        Most iterations.
    convergence : float
        Least relative decrease of the objective for another iteration; 0 to take all of them.
    random_state : int
        Seeds the choice of the signals that become the first atoms.
    max_coherence : float
        Atoms whose absolute cosine exceeds this count as the same: new ones are less alike, and of
        two that remain one is dropped at the end if the objective stands it.
    update_iterations : int
        Most updates of every atom between two codings of the signals.
    update_tolerance : float
        Least relative decrease of the objective by an update of all atoms for another one.
    progress : None, bool or callable
        None, True for a bar on stderr, or a callable of stage and fraction.

    Returns
    -------
    Ksvd
        Dictionary (atoms that are in use only), codes, objective of the first dictionary and after
        every iteration, number of atoms replaced and cropped.

    Notes
    -----
    Codes of the first dictionary have two fifths of `max_atoms`, those of the next iterations a
    fifth more each. Atoms that earn little, unused ones and those for which another can stand in,
    are replaced by directions that the residuals of many signals share and, once the objective
    falls slowly, by the second of two lines into which the signals of an atom fall. Replacements
    that raise the objective are undone.

    Raises
    ------
    InvalidInputError
        Shapes do not fit, a number is not finite, or an option is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import surfabet.sparse as sparse
    >>> rng = np.random.default_rng(0)
    >>> signals = np.outer(rng.normal(size=50), rng.normal(size=8))
    >>> seen = rng.random(signals.shape) < 0.7
    >>> learned = sparse.ksvd(signals * seen, weights=seen, n_atoms=1, max_atoms=1, convergence=0)
    >>> again = sparse.reconstruct(learned.dictionary, learned.codes)
    >>> bool(np.allclose(again, signals, atol=1e-3))
    True
    """
    _check_coding(max_atoms, tolerance, selection)
    counts = {"n_atoms": (n_atoms, 1), "iterations": (iterations, 0)}
    counts |= {"update_iterations": (update_iterations, 0), "random_state": (random_state, 0)}
    for name, (count, least) in counts.items():
        check_integer(name, count, least)
    shares = {"convergence": convergence, "update_tolerance": update_tolerance}
    for name, share in shares.items():
        check_number(name, share, "0 or a positive number", least=0.0)
    check_number("max_coherence", max_coherence, "a number from 0 to 1", least=0.0, most=1.0)
    with progress_callback(progress) as callback:
        return _core.sparse_ksvd(
            signals,
            _as_weights(weights),
            n_atoms,
            max_atoms,
            tolerance,
            selection,
            iterations,
            convergence,
            random_state,
            max_coherence,
            update_iterations,
            update_tolerance,
            callback,
        )


def reconstruct(dictionary: ArrayLike, codes: SparseCodes) -> NDArray[np.float32]:
    """Signals that codes stand for, ``codes.to_dense(n_atoms) @ dictionary``.

    Parameters
    ----------
    dictionary : array_like of shape (n_atoms, n_features)
        Atoms of norm 1.
    codes : SparseCodes
        Codes over it.

    Returns
    -------
    ndarray of shape (n_signals, n_features), float32

    Raises
    ------
    InvalidInputError
        A code uses an atom that the dictionary does not have.

    Examples
    --------
    >>> import surfabet.sparse as sparse
    >>> codes = sparse.SparseCodes([0, 1, 1], [1], [2.0])
    >>> sparse.reconstruct([[1, 0], [0, 1]], codes)
    array([[0., 2.],
           [0., 0.]], dtype=float32)
    """
    _check_codes(codes)
    return _core.sparse_reconstruct(dictionary, codes)


def squared_errors(
    dictionary: ArrayLike,
    signals: ArrayLike,
    codes: SparseCodes,
    *,
    weights: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Weighted squared error of every signal, ``sum(weights * (signals - again)**2, axis=1)``.

    Parameters
    ----------
    dictionary : array_like of shape (n_atoms, n_features)
        Atoms of norm 1.
    signals : array_like of shape (n_signals, n_features)
        Finite values.
    codes : SparseCodes
        One code per signal.
    weights : array_like of shape (n_signals, n_features), optional
        Default: all count 1.

    Returns
    -------
    ndarray of shape (n_signals,), float64

    Raises
    ------
    InvalidInputError
        Dictionary, signals, weights and codes do not fit together.

    Examples
    --------
    >>> import surfabet.sparse as sparse
    >>> codes = sparse.SparseCodes([0, 1], [0], [2.0])
    >>> sparse.squared_errors([[1, 0], [0, 1]], [[2, 3]], codes, weights=[[1, 0.5]])
    array([4.5])
    """
    _check_codes(codes)
    return _core.sparse_squared_errors(dictionary, signals, _as_weights(weights), codes)
