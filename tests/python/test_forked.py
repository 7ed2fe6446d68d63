"""surfabet in processes that were forked after it was used."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork"
)

SCRIPT = """
import multiprocessing, sys, warnings
from concurrent.futures import ProcessPoolExecutor
import numpy as np
import surfabet as sb

warnings.simplefilter("ignore", DeprecationWarning)
fork = multiprocessing.get_context("fork")
grid = np.arange(0, 4, 0.02)
u, v = np.meshgrid(grid, grid)
cloud = sb.PointCloud(np.stack([u.ravel(), v.ravel(), 0.1 * np.sin(u.ravel())], axis=1))
before = sb.learn_patches(cloud).to_bytes()
sb.learn_patches_tiled(cloud, sys.argv[1] + "/here.sfb", tile=1.28, resolution=0.02)


def again(n_threads):
    if n_threads:
        sb.set_num_threads(None)
        assert sb.survey(cloud).spacing > 0
        sb.set_num_threads(n_threads)
        sb.survey(cloud)
        sb.set_num_threads(None)
        assert sb.survey(cloud).spacing > 0
        sb.set_num_threads(n_threads)
    made = sb.PointCloud(cloud.points)
    model = sb.learn_patches(made)
    vertices = sb.from_bytes(before).mesh().vertices
    same = model.to_bytes() == before
    return sb.get_num_threads(), same, len(vertices) > 0, sb.survey(made).spacing


n = sb.get_num_threads()
with ProcessPoolExecutor(1, mp_context=fork) as executor:
    assert executor.submit(again, None).result() == (n, True, True, sb.survey(cloud).spacing)
sb.set_num_threads(3)
with ProcessPoolExecutor(1, mp_context=fork) as executor:
    assert executor.submit(again, None).result()[:3] == (3, True, True)
with ProcessPoolExecutor(1, mp_context=fork) as executor:
    assert executor.submit(again, 2).result()[:3] == (2, True, True)
with ProcessPoolExecutor(2, mp_context=fork) as executor:
    path = sys.argv[1] + "/there.sfb"
    sb.learn_patches_tiled(
        cloud, path, tile=1.28, resolution=0.02, executor=executor, workers=2
    )
assert open(path, "rb").read() == open(sys.argv[1] + "/here.sfb", "rb").read()
print("done")
"""


def test_work_goes_on_in_forked_processes(tmp_path: Path) -> None:
    """With as many threads as in the parent, and with the same bytes."""
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout == "done\n", done.stderr
