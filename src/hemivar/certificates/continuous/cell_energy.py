"""The stored energy of a material that is not linear, on cells with one strain each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.mechanics.material import Material
from hemivar.mesh.mesh import Mesh

__all__ = ["CellEnergy", "cell_energy"]

#: Of points, strains and masks of regions.
_Values = Callable[[Array, Array, Mapping[str, BoolArray] | None], Array]


@dataclass(frozen=True, eq=False)
class CellEnergy:
    """A stored energy W at places of cells: where it varies within a cell, its mean by a rule of integration."""

    material: Material
    places: Array  # (M, p, d)
    weights: Array  # (p,)
    regions: Mapping[str, BoolArray]  # (M,)

    def at(self, cells: slice) -> CellEnergy:
        """Of some cells."""
        regions = {name: mask[cells] for name, mask in self.regions.items()}
        return CellEnergy(self.material, self.places[cells], self.weights, regions)

    def value(self, strain: Array) -> Array:
        """W (M, q) at strains (M, q, v), with engineering shear strains."""
        return self._mean(self.material.energy, strain)

    def stress(self, strain: Array) -> Array:
        """Its derivative (M, q, v) by the strain."""
        return self._mean(self.material.stress, strain)

    def tangent(self, strain: Array) -> Array:
        """Its second derivative (M, q, v, v)."""
        return self._mean(self.material.tangent, strain)

    def lower(self) -> Array:
        """C_low of each cell, shape (M, v, v)."""
        strain = np.zeros((len(self.places), 1, 1))
        found = self._mean(lambda places, _, regions: self.material.lower_tensor(places, regions), strain)
        return np.asarray(found[:, 0])

    def _mean(self, values: _Values, strain: Array) -> Array:
        count, many, _ = strain.shape
        masks = {name: np.repeat(mask, many) for name, mask in self.regions.items()}
        flat = strain.reshape(count * many, -1)
        total: Array | None = None
        for place, weight in zip(self.places.transpose(1, 0, 2), self.weights, strict=True):
            found = weight * values(np.repeat(place, many, axis=0), flat, masks)
            total = found if total is None else total + found
        assert total is not None
        return np.asarray(total.reshape(count, many, *total.shape[1:]))


def cell_energy(material: Material, mesh: Mesh, vertices: IntArray, degree: int) -> CellEnergy:
    """That of cells, given by their vertices (M, d + 1): seen at centroids where the material is uniform."""
    barycentric, weights = quadrature_rule(mesh.dim, 1 if material.uniform else degree)
    places = np.einsum("pa,mad->mpd", barycentric, mesh.points[vertices])
    return CellEnergy(material, places, weights, region_masks(mesh))
