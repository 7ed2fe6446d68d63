"""Dictionary learning beside SPAMS and scikit-learn on unmasked data: seconds and objective.

    python benches/peers/ksvd.py [--full] [--threads 2] [--repeats 3]

The methods differ: K-SVD passes over all signals in an iteration, the peers learn online from
mini-batches. So each peer makes as many passes over the data as K-SVD makes iterations, and all
dictionaries are judged alike, by the squared error of codes of the same length that the same
matching pursuit finds over them. Contestants run in turn with the same number of threads.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np


def mixtures(n_signals: int, n_features: int, n_atoms: int, seed: int) -> np.ndarray:
    """Noisy mixtures of five out of `n_atoms` random atoms."""
    rng = np.random.default_rng(seed)
    atoms = rng.normal(size=(n_atoms, n_features))
    atoms /= np.linalg.norm(atoms, axis=1, keepdims=True)
    signals = rng.normal(scale=0.02, size=(n_signals, n_features))
    for signal in signals:
        signal += rng.normal(size=5) @ atoms[rng.choice(n_atoms, 5, replace=False)]
    return signals.astype(np.float32)


def unit(atoms: np.ndarray) -> np.ndarray:
    """Atoms of norm 1; those that a peer left at zero are dropped."""
    norms = np.linalg.norm(atoms, axis=1, keepdims=True)
    return (atoms / np.maximum(norms, 1e-12))[norms[:, 0] > 1e-6].astype(np.float32)


def spread(values: list[float]) -> str:
    return f"{statistics.median(values):.3f} ({min(values):.3f}..{max(values):.3f})"


def main() -> int:
    parser = argparse.ArgumentParser(description="Dictionary learning beside its peers.")
    parser.add_argument("--full", action="store_true", help="500 atoms, 20 000 signals of 400")
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    try:
        import spams
        from sklearn.decomposition import MiniBatchDictionaryLearning
        from threadpoolctl import threadpool_limits
    except ImportError as error:
        print(f"{error.name} is not installed: pip install -r benches/peers/requirements.txt")
        return 0
    import surfabet
    from surfabet import sparse

    surfabet.set_num_threads(args.threads)
    n_signals, n_features, n_atoms = (20_000, 400, 500) if args.full else (2000, 100, 100)
    signals = mixtures(n_signals, n_features, n_atoms, args.seed)
    signals_f = np.asfortranarray(signals.T)
    batch = 512
    passes = args.iterations

    def ours() -> np.ndarray:
        learned = sparse.ksvd(
            signals, n_atoms=n_atoms, max_atoms=5, iterations=passes, convergence=0
        )
        return learned.dictionary

    def spams_dictionary() -> np.ndarray:
        # Mode 3: at most lambda1 atoms in a code, the L0 constraint of K-SVD.
        atoms = spams.trainDL(
            signals_f,
            K=n_atoms,
            mode=3,
            lambda1=5,
            batchsize=batch,
            iter=passes * -(-n_signals // batch),
            numThreads=args.threads,
            verbose=False,
        )
        return unit(atoms.T)

    def sklearn_dictionary() -> np.ndarray:
        learner = MiniBatchDictionaryLearning(
            n_components=n_atoms,
            batch_size=batch,
            max_iter=passes,
            max_no_improvement=None,
            tol=0.0,
            fit_algorithm="lars",
            transform_algorithm="omp",
            transform_n_nonzero_coefs=5,
            random_state=args.seed,
        )
        with threadpool_limits(args.threads):
            return unit(learner.fit(signals).components_)

    runs: dict[str, Callable[[], np.ndarray]] = {
        "surfabet ksvd": ours,
        "SPAMS trainDL": spams_dictionary,
        "scikit-learn MiniBatch": sklearn_dictionary,
    }
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    objectives: dict[str, float] = {}
    print(
        f"{n_signals} signals of {n_features} features, {n_atoms} atoms, 5 per code, "
        f"{args.threads} threads, {passes} passes, {args.repeats} repetitions: median (min..max)"
    )
    for _ in range(args.repeats):
        for name, learn in runs.items():
            start = time.perf_counter()
            dictionary = learn()
            seconds[name].append((time.perf_counter() - start) / passes)
            codes = sparse.omp(dictionary, signals, max_atoms=5)
            objectives[name] = float(sparse.squared_errors(dictionary, signals, codes).sum())
    for name in runs:
        ratios = [p / o for p, o in zip(seconds[name], seconds["surfabet ksvd"], strict=True)]
        ratio = "" if name == "surfabet ksvd" else f"   ratio {spread(ratios)}"
        print(
            f"  {name:24} {spread(seconds[name]):>24} s per pass"
            f"   objective {objectives[name]:.6g}{ratio}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
