"""Orthogonal matching pursuit beside SPAMS and scikit-learn: speed and error, peers in turn.

    python benches/peers/omp.py [--signals 20000] [--missing 0.2] [--threads 2] [--repeats 5]

Every repetition runs surfabet and then each peer on the same signals with the same number of
threads, so that other load on the machine meets all of them. A ratio is peer time / surfabet time.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass
class Run:
    """One contestant: what is timed, and how its codes become an (n_signals, n_atoms) array."""

    name: str
    code: Callable[[], Any]
    to_dense: Callable[[Any], np.ndarray]
    microseconds: list[float] = field(default_factory=list)


def mixtures(
    n_signals: int, n_features: int, n_atoms: int, atoms_per_signal: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """A random dictionary and noisy sparse mixtures of its atoms."""
    rng = np.random.default_rng(seed)
    dictionary = rng.normal(size=(n_atoms, n_features))
    dictionary /= np.linalg.norm(dictionary, axis=1, keepdims=True)
    signals = rng.normal(scale=0.05, size=(n_signals, n_features))
    for signal in signals:
        support = rng.choice(n_atoms, atoms_per_signal, replace=False)
        signal += rng.normal(size=atoms_per_signal) @ dictionary[support]
    return dictionary.astype(np.float32), signals.astype(np.float32)


def spread(values: list[float]) -> str:
    return f"{statistics.median(values):.2f} ({min(values):.2f}..{max(values):.2f})"


def compare(
    title: str,
    runs: list[Run],
    dictionary: np.ndarray,
    signals: np.ndarray,
    weights: np.ndarray | None,
    repeats: int,
) -> None:
    """Times all runs in turn and prints them; the first is ours."""
    results = [run.code() for run in runs]
    for _ in range(repeats):
        for run in runs:
            start = time.perf_counter()
            run.code()
            run.microseconds.append((time.perf_counter() - start) / len(signals) * 1e6)
    print(f"\n{title}")
    for run, result in zip(runs, results, strict=True):
        squared = (signals - run.to_dense(result) @ dictionary).astype(np.float64) ** 2
        objective = float((squared if weights is None else squared * weights).sum())
        ratios = [p / o for p, o in zip(run.microseconds, runs[0].microseconds, strict=True)]
        ratio = "" if run is runs[0] else f"   ratio {spread(ratios)}"
        print(
            f"  {run.name:32} {spread(run.microseconds):>24} us per signal"
            f"   objective {objective:.7g}{ratio}"
        )


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Matching pursuit beside SPAMS and scikit-learn.")
    parser.add_argument("--signals", type=int, default=20_000)
    parser.add_argument("--features", type=int, default=400)
    parser.add_argument("--atoms", type=int, default=500)
    parser.add_argument("--max-atoms", type=int, default=5)
    parser.add_argument("--missing", type=float, default=0.2)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def described(args: argparse.Namespace) -> str:
    return (
        f"{args.signals} signals of {args.features} features, {args.atoms} atoms, "
        f"{args.max_atoms} per code, {args.threads} threads, {args.repeats} repetitions: "
        "median (min..max)"
    )


def main() -> int:
    args = arguments()
    try:
        import spams
        from sklearn.linear_model import orthogonal_mp_gram
    except ImportError as error:
        print(f"{error.name} is not installed: pip install -r benches/peers/requirements.txt")
        return 0
    import surfabet
    from surfabet import sparse

    surfabet.set_num_threads(args.threads)
    # Mixtures of more atoms than a code may have, as real signals are.
    dictionary, signals = mixtures(
        args.signals, args.features, args.atoms, 2 * args.max_atoms, args.seed
    )
    seen = np.random.default_rng(args.seed + 1).random(signals.shape) >= args.missing
    weights, masked = seen.astype(np.float32), signals * seen
    # SPAMS wants signals and atoms as Fortran-ordered columns.
    atoms_f, signals_f, masked_f, seen_f = (
        np.asfortranarray(a.T) for a in (dictionary, signals, masked, seen)
    )
    print(described(args))

    def ours(name: str, selection: Any, weights: np.ndarray | None) -> Run:
        values = signals if weights is None else masked
        return Run(
            name,
            lambda: sparse.omp(
                dictionary, values, weights=weights, max_atoms=args.max_atoms, selection=selection
            ),
            lambda codes: codes.to_dense(args.atoms),
        )

    limits = {"L": args.max_atoms, "eps": 0.0, "numThreads": args.threads}

    def theirs(name: str, code: Callable[[], Any]) -> Run:
        return Run(name, code, lambda codes: codes.toarray().T)

    title = f"{args.missing:.0%} of the values missing, another mask for every signal"
    runs = [
        ours("surfabet", "least_squares", weights),
        ours("surfabet, by correlation", "correlation", weights),
        theirs("SPAMS ompMask", lambda: spams.ompMask(masked_f, atoms_f, seen_f, **limits)),
    ]
    compare(title, runs, dictionary, signals, weights, args.repeats)
    runs = [
        ours("surfabet", "least_squares", None),
        ours("surfabet, by correlation", "correlation", None),
        theirs("SPAMS omp", lambda: spams.omp(signals_f, atoms_f, **limits)),
        Run(
            "scikit-learn orthogonal_mp_gram",
            lambda: orthogonal_mp_gram(
                dictionary @ dictionary.T,
                dictionary @ signals.T,
                n_nonzero_coefs=args.max_atoms,
            ),
            lambda codes: codes.T,
        ),
    ]
    compare("nothing missing", runs, dictionary, signals, None, args.repeats)
    return 0


if __name__ == "__main__":
    sys.exit(main())
