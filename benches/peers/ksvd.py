"""Dictionary learning beside its peers: objectives, and the time surfabet takes to each of them.

    python benches/peers/ksvd.py [--full] [--depth | --color] [--missing 0.2] [--threads 2]
        [--repeats 3]

Signals are noisy mixtures of planted atoms or, with --depth and --color, patches of the depth
images or of the brightness of the pictures of a real room. With nothing missing the peers are
SPAMS and scikit-learn; where values are missing it is wKSVD of inpystem, which takes masks.

All dictionaries are judged alike, by the squared error (of what is seen) of codes of the same
length that the same matching pursuit finds over them. Each peer makes as many passes over the data
as --iterations; SPAMS also --long times as many, and in batches of 128 instead of 512, which suits
it better. For every peer the smallest number of
iterations is sought with which surfabet is at or below its objective, and that run is timed in turn
with the peer's, with the same number of threads.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOM = Path(__file__).resolve().parents[3] / "shared" / "data" / "rgbd_room"
SPARSITY = 5
BATCH = 512
SMALL_BATCH = 128
# Of surfabet, when it looks for the objective of a peer.
MOST_ITERATIONS = 30


@dataclass
class Data:
    """Signals as rows, what of them is seen (None: all), and the atoms they were made of."""

    title: str
    signals: np.ndarray
    seen: np.ndarray | None
    n_atoms: int
    truth: np.ndarray | None = None


@dataclass
class Peer:
    """A contestant: how it learns its dictionary, its seconds and ours to the same objective."""

    name: str
    learn: Callable[[], np.ndarray]
    repeats: int
    seconds: list[float] = field(default_factory=list)
    own: list[float] = field(default_factory=list)


def mixtures(n_signals: int, n_features: int, n_atoms: int, seed: int) -> tuple[np.ndarray, ...]:
    """Noisy mixtures of five out of `n_atoms` random atoms, and the atoms."""
    rng = np.random.default_rng(seed)
    atoms = rng.normal(size=(n_atoms, n_features))
    atoms /= np.linalg.norm(atoms, axis=1, keepdims=True)
    signals = rng.normal(scale=0.02, size=(n_signals, n_features))
    for signal in signals:
        signal += rng.normal(size=SPARSITY) @ atoms[rng.choice(n_atoms, SPARSITY, replace=False)]
    return signals.astype(np.float32), atoms


def depth_patches(
    folder: Path, n_signals: int, side: int, least_seen: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Square patches of depth images in decimetres, means removed, and which pixels are seen."""
    from PIL import Image

    patches = []
    for path in sorted(folder.glob("*.depth.png")):
        depth = np.asarray(Image.open(path)).astype(np.float64)
        depth[(depth < 300) | (depth > 4000)] = 0
        rows, columns = (size // side for size in depth.shape)
        tiles = depth[: rows * side, : columns * side].reshape(rows, side, columns, side)
        patches.append(tiles.swapaxes(1, 2).reshape(-1, side * side) / 100)
    signals = np.concatenate(patches)
    seen = signals > 0
    chosen = np.flatnonzero(seen.mean(1) >= least_seen)
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(chosen, min(n_signals, len(chosen)), replace=False))
    signals, seen = signals[chosen], seen[chosen]
    signals = (signals - signals.sum(1, keepdims=True) / seen.sum(1, keepdims=True)) * seen
    return signals.astype(np.float32), seen


def brightness_patches(folder: Path, n_signals: int, side: int, seed: int) -> np.ndarray:
    """Square patches of the brightness of pictures, in hundreds of grey levels, means removed."""
    from PIL import Image

    patches = []
    for path in sorted(folder.glob("*.color.jpg")):
        image = np.asarray(Image.open(path).convert("L")).astype(np.float64)
        rows, columns = (size // side for size in image.shape)
        tiles = image[: rows * side, : columns * side].reshape(rows, side, columns, side)
        patches.append(tiles.swapaxes(1, 2).reshape(-1, side * side) / 100)
    signals = np.concatenate(patches)
    rng = np.random.default_rng(seed)
    signals = signals[np.sort(rng.choice(len(signals), n_signals, replace=False))]
    return (signals - signals.mean(1, keepdims=True)).astype(np.float32)


def unit(atoms: np.ndarray) -> np.ndarray:
    """Atoms of norm 1; those that a peer left at zero are dropped."""
    norms = np.linalg.norm(atoms, axis=1, keepdims=True)
    return (atoms / np.maximum(norms, 1e-12))[norms[:, 0] > 1e-6].astype(np.float32)


def recovered(truth: np.ndarray, dictionary: np.ndarray) -> float:
    """Share of the true atoms that an atom of the dictionary is within a cosine of 0.99 of."""
    return float((np.abs(truth @ dictionary.T).max(1) > 0.99).mean())


def spread(values: list[float]) -> str:
    return f"{statistics.median(values):.3g} ({min(values):.3g}..{max(values):.3g})"


def spams_peer(data: Data, passes: int, batch: int, threads: int, repeats: int) -> Peer:
    import spams

    columns = np.asfortranarray(data.signals.T)

    def learn() -> np.ndarray:
        # Mode 3: at most lambda1 atoms in a code, the L0 constraint of K-SVD.
        atoms = spams.trainDL(
            columns,
            K=data.n_atoms,
            mode=3,
            lambda1=SPARSITY,
            batchsize=batch,
            iter=passes * -(-len(data.signals) // batch),
            numThreads=threads,
            verbose=False,
        )
        return unit(atoms.T)

    return Peer(f"SPAMS, batches of {batch}, {passes} passes", learn, repeats)


def sklearn_peer(data: Data, passes: int, threads: int, seed: int) -> Peer:
    from sklearn.decomposition import MiniBatchDictionaryLearning
    from threadpoolctl import threadpool_limits

    def learn() -> np.ndarray:
        learner = MiniBatchDictionaryLearning(
            n_components=data.n_atoms,
            batch_size=BATCH,
            max_iter=passes,
            max_no_improvement=None,
            tol=0.0,
            fit_algorithm="lars",
            transform_algorithm="omp",
            transform_n_nonzero_coefs=SPARSITY,
            random_state=seed,
        )
        with threadpool_limits(threads):
            return unit(learner.fit(data.signals).components_)

    return Peer(f"scikit-learn MiniBatch, {passes} passes", learn, 1)


def inpystem_peer(data: Data, passes: int, threads: int, seed: int) -> Peer:
    from inpystem.restore.DL_ITKrMM import wKSVD_core
    from threadpoolctl import threadpool_limits

    masks = np.ones_like(data.signals) if data.seen is None else data.seen

    def learn() -> np.ndarray:
        # Its first atoms come from the global generator.
        np.random.seed(seed)  # noqa: NPY002
        with threadpool_limits(threads):
            # One of its atoms is constant and is not learned: it gets one more.
            atoms, _ = wKSVD_core(
                data.signals.T.astype(float),
                masks.T.astype(float),
                K=data.n_atoms + 1,
                S=SPARSITY,
                Nit=passes,
                verbose=False,
            )
        return unit(atoms.T)

    return Peer(f"inpystem wKSVD, {passes} passes", learn, 1)


def described(data: Data) -> str:
    n_signals, n_features = data.signals.shape
    return (
        f"\n{data.title}: {n_signals} signals of {n_features} features, {data.n_atoms} atoms, "
        f"{SPARSITY} per code: median (min..max)"
    )


def compare(data: Data, peers: list[Peer], iterations: int, threads: int, seed: int) -> None:
    """Runs and prints surfabet, then every peer beside the run that reaches its objective."""
    from surfabet import sparse

    def run(iterations: int) -> sparse.Ksvd:
        return sparse.ksvd(
            data.signals,
            weights=data.seen,
            n_atoms=data.n_atoms,
            max_atoms=SPARSITY,
            iterations=iterations,
            convergence=0,
            random_state=seed,
        )

    def learn(iterations: int) -> np.ndarray:
        return run(iterations).dictionary

    def judge(dictionary: np.ndarray) -> float:
        codes = sparse.omp(dictionary, data.signals, weights=data.seen, max_atoms=SPARSITY)
        errors = sparse.squared_errors(dictionary, data.signals, codes, weights=data.seen)
        return float(errors.sum())

    # On one thread processor time, which other load disturbs least.
    clock = time.process_time if threads == 1 else time.perf_counter

    def timed(work: Callable[[], np.ndarray], seconds: list[float]) -> np.ndarray:
        start = clock()
        dictionary = work()
        seconds.append(clock() - start)
        return dictionary

    def share(dictionary: np.ndarray) -> str:
        if data.truth is None:
            return ""
        return f"   recovered {recovered(data.truth, dictionary):.3f}"

    print(described(data))
    if data.truth is not None:
        print(f"  {'the planted atoms':36} objective {judge(unit(data.truth)):<10.6g}")
    own: list[float] = []
    for _ in range(max(peer.repeats for peer in peers)):
        dictionary = timed(lambda: learn(iterations), own)
    print(
        f"  {f'surfabet, {iterations} iterations':36} objective {judge(dictionary):<10.6g}"
        f" {spread(own):>26} s{share(dictionary)}"
        f"   with its own codes {run(iterations).objective[-1]:.6g}"
    )
    for peer in peers:
        dictionary = timed(peer.learn, peer.seconds)
        objective = judge(dictionary)
        tried = range(1, MOST_ITERATIONS + 1)
        reaching = next((m for m in tried if judge(learn(m)) <= objective), None)
        for repeat in range(peer.repeats if reaching else 0):
            timed(lambda m=reaching: learn(m), peer.own)
            if repeat + 1 < peer.repeats:
                timed(peer.learn, peer.seconds)
        line = (
            f"  {peer.name:36} objective {objective:<10.6g} {spread(peer.seconds):>26} s"
            f"{share(dictionary)}"
        )
        if reaching is None:
            print(f"{line}   not reached by surfabet in {MOST_ITERATIONS} iterations", flush=True)
            continue
        ratios = [p / o for p, o in zip(peer.seconds, peer.own, strict=True)]
        print(
            f"{line}   surfabet there after {reaching} iterations, {spread(peer.own)} s: "
            f"ratio {spread(ratios)}",
            flush=True,
        )


def load(args: argparse.Namespace) -> Data:
    n_signals, n_features, n_atoms = (20_000, 400, 500) if args.full else (2000, 100, 100)
    for folder in (args.depth, args.color):
        if folder is not None and not folder.is_dir():
            sys.exit(f"{folder} is not there; give the folder of a room with depth images")
    if args.depth is not None:
        least = 0.5 if args.missing else 1.0
        signals, seen = depth_patches(
            args.depth, n_signals, math.isqrt(n_features), least, args.seed
        )
        title, truth = "patches of depth images", None
    elif args.color is not None:
        signals = brightness_patches(args.color, n_signals, math.isqrt(n_features), args.seed)
        seen = np.ones(signals.shape, bool)
        title, truth = "patches of brightness", None
    else:
        signals, truth = mixtures(n_signals, n_features, n_atoms, args.seed)
        seen = np.ones(signals.shape, bool)
        title = "planted atoms"
    if args.missing:
        seen &= np.random.default_rng(args.seed + 1).random(seen.shape) >= args.missing
        title += f", {1 - seen.mean():.0%} missing"
    return Data(title, signals * seen, seen if args.missing else None, n_atoms, truth)


def main() -> int:
    parser = argparse.ArgumentParser(description="Dictionary learning beside its peers.")
    parser.add_argument("--full", action="store_true", help="500 atoms, 20 000 signals of 400")
    parser.add_argument(
        "--depth",
        type=Path,
        nargs="?",
        const=ROOM,
        help="patches of the depth images of this folder, by default of the real room",
    )
    parser.add_argument(
        "--color",
        type=Path,
        nargs="?",
        const=ROOM,
        help="patches of the pictures of this folder, by default of the real room",
    )
    parser.add_argument("--missing", type=float, default=0.0, help="share of the values left out")
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--long", type=int, default=4, help="further run of SPAMS, times as long")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    import surfabet

    surfabet.set_num_threads(args.threads)
    data = load(args)
    try:
        if args.missing:
            peers = [inpystem_peer(data, args.iterations, args.threads, args.seed)]
        else:
            peers = [
                spams_peer(data, args.iterations, BATCH, args.threads, args.repeats),
                spams_peer(data, args.iterations, SMALL_BATCH, args.threads, args.repeats),
                spams_peer(data, args.long * args.iterations, BATCH, args.threads, args.repeats),
                sklearn_peer(data, args.iterations, args.threads, args.seed),
            ]
    except ImportError as error:
        print(f"{error.name} is not installed: pip install -r benches/peers/requirements.txt")
        return 0
    compare(data, peers, args.iterations, args.threads, args.seed)
    return 0


if __name__ == "__main__":
    sys.exit(main())
