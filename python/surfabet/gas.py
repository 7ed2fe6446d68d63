"""Growing neural gas: a map as neurons that spread over its surface and know who is next to them.

A scan becomes a number of neurons chosen beforehand, joined by edges where the surface goes on;
each knows colour, normal, how many points it stands for and how these spread.

Fritzke: A Growing Neural Gas Network Learns Topologies, NIPS 1995; used for maps by Morell,
Cazorla, Orts-Escolano and Garcia-Rodriguez: 3D Maps Representation Using GNG, 2014.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from surfabet import _core
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.model import Model

__all__ = ["GasModel", "Neurons", "learn_gas"]


@dataclass(frozen=True, slots=True)
class Neurons:
    """All n neurons of a model as arrays, in the order of the file: along the topology."""

    positions: NDArray[np.float64]
    """World positions, (n, 3), metres."""
    normals: NDArray[np.float32]
    """Unit normals, (n, 3), towards where the surface was seen from if the scan knew; zero where
    unknown."""
    colors: NDArray[np.uint8] | None
    """Colours, (n, 3), 0 to 255; None without."""
    counts: NDArray[np.float64]
    """Points that each neuron stands for, (n,), to a quarter of a doubling."""
    radii: NDArray[np.float64]
    """Radius of the disc over which its points spread, (n,), metres."""
    thicknesses: NDArray[np.float64]
    """Standard deviation of its points across the disc, (n,), metres."""

    @property
    def densities(self) -> NDArray[np.float64]:
        """Points per square metre of surface, (n,); infinite where the disc has no area."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.counts / (np.pi * self.radii**2)

    def __len__(self) -> int:
        return len(self.positions)


@final
class GasModel(Model[_core.GasModel]):
    """A cloud as a gas of neurons with a topology; immutable.

    Made by `learn_gas`, `GasModel.update` and `surfabet.load`. It decodes to its neurons by
    default. At a given spacing every neuron's disc is filled as far as no other neuron is nearer,
    and so are edges between discs that do not meet.
    """

    __slots__ = ()

    def update(
        self,
        cloud: PointCloud,
        n_neurons: int | None = None,
        *,
        progress: Progress = None,
    ) -> GasModel:
        """Adds another scan of the same world: a larger model, this one stays as it is.

        Signals come from the new scan and from points spread over this model's discs, in proportion
        to the numbers of points of both, so that nothing is forgotten where the new scan does not
        reach and both are averaged where it does.

        Parameters
        ----------
        cloud
            The new scan, in the same world frame.
        n_neurons
            Number of neurons afterwards; by default the space that both occupy gets as many per
            volume as this model has.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            For an empty scan, fewer neurons than this model has, or options outside their range.
        """
        options = {}
        with progress_callback(progress) as callback:
            return GasModel(
                self._core.update(cloud, options, n_neurons=n_neurons, progress=callback)
            )

    def mesh(self) -> NDArray[np.uint32]:
        """Triangles of the induced triangulation as rows of three neurons, (t, 3).

        Anticlockwise seen from where the normals point to; no edge is passed twice in one
        direction. Holes of up to twelve edges are closed.
        """
        return self._core.mesh()

    def components(self) -> NDArray[np.uint32]:
        """Connected component of every neuron, (n,), numbered from zero."""
        return self._core.components()

    def geodesic_distances(self, source: int) -> NDArray[np.float64]:
        """Length of the shortest way along edges from one neuron to all, (n,), metres; infinite to
        other components."""
        return self._core.geodesic_distances(source)

    def geodesic_distance(self, source: int, target: int) -> float:
        """Length of the shortest way along edges between two neurons, metres, or infinity."""
        return float(self.geodesic_distances(source)[target])

    @property
    def neurons(self) -> Neurons:
        """All neurons as arrays."""
        return Neurons(
            positions=self._core.positions(),
            normals=self._core.normals(),
            colors=self._core.colors(),
            counts=self._core.counts(),
            radii=self._core.radii(),
            thicknesses=self._core.thicknesses(),
        )

    @property
    def edges(self) -> NDArray[np.uint32]:
        """Pairs of joined neurons, (m, 2), the smaller number first, sorted."""
        return self._core.edges()

    @property
    def mean_error(self) -> float:
        """Mean distance of the input points to their nearest neurons, metres (ME of the paper)."""
        return self._core.mean_error

    @property
    def position_step(self) -> float:
        """Rounding of positions, metres."""
        return self._core.position_step

    def __repr__(self) -> str:
        return (
            f"GasModel({self.n_points} points as {len(self)} neurons with {len(self.edges)} edges, "
            f"mean error {self.mean_error:.3g} m" + (", coloured" if self.has_color else "") + ")"
        )


def learn_gas(
    cloud: PointCloud,
    *,
    progress: Progress = None,
) -> GasModel:
    """Learns a growing neural gas: as many neurons as asked for, spread over the scan.

    The ten steps are Fritzke's. Results depend on input, options and seed alone.

    Parameters
    ----------
    cloud
        The scan.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an empty scan, more neurons than places, or options outside their range.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> points = np.random.default_rng(0).random((2000, 3)) * [1, 1, 0]
    >>> model = sb.learn_gas(sb.PointCloud(points), n_neurons=50)
    >>> len(model), model.components().max()
    (50, np.uint32(0))
    """
    options = {}
    with progress_callback(progress) as callback:
        return GasModel(_core.learn_gas(cloud, options, progress=callback))
