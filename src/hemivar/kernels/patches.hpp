// Patches of facets with the cells on their sides, on which an equilibrated (admissible) stress is improved.
//
// A patch is a list of cells, each seen at one of its vertices, edges or facets, that share no cell with other patches
// of their colour. So every number is written by one patch, and no bit depends on the number of threads.
#pragma once

#include <cstdint>

namespace hemivar {

constexpr int64_t kColours = 256;

// What stays between sweeps. The names and shapes are those of the Python module that fills it in.
struct PatchBody {
    int64_t dim, nodes, inner, cells, facets;
    const double* energies;    // (n + i, v, n + i): n moments of a cell, i numbers without tractions
    const double* compliance;  // (kinds, v)
    const double* gradients;   // (M, d + 1, d), of the barycentric coordinates
    const double* signs;       // (M, d + 1)
    const double* points;      // (N, d)
    const int64_t *cell_facets, *facet_nodes;
    const int64_t* alike;      // (M,), the kind of each cell
};

struct PatchSweep {
    int64_t seen_of_cell, sides_of_seen, patches, colours;
    const int64_t *sides, *start, *seen, *order, *bounds;
    const uint8_t* free;
    const int64_t* rows;  // null without prices
    const double *matrices, *offsets;
    double *slope, *moments;  // (M, n), (F, n / (d + 1)), changed in place
};

// The patches of cells in the order of cells, and colours as small as can be, given out in an order of the patches.
// The number of colours; -1 if it is more than kColours.
int64_t colour_patches(int64_t cells, int64_t seen_of_cell, const int64_t* patches, int64_t count,
                       const int64_t* ranked, int64_t* start, int64_t* seen, int64_t* order, int64_t* bounds);

void improve_patches(const PatchBody& body, const PatchSweep& sweep);

}  // namespace hemivar
