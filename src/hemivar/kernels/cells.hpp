// Stresses of cells: what they add to the misfit (constitutive error) and to its gradient, in one pass.
#pragma once

#include <cstdint>

namespace hemivar {

// The element on the reference simplex. The names and shapes are those of the Python module that fills it in.
struct CellElement {
    int64_t dim, nodes, inner, degrees, piece_nodes;  // d, l, i, n, p
    const double* values;     // ((d + 1) p, v, n)
    const double* mass;       // (p, p)
    const double* loading;    // (n, k + d (d + 1)): of the k moments of a cell, and of loads
    const double* ways;       // (n, k + i)
    const double* energies;   // (v (v + 1) / 2, i, i): of what has no tractions
};

struct CellStresses {
    int64_t cells, facets, own_nodes;
    const double* compliance;  // (kinds, v (v + 1) / 2), on the reference simplex
    const int64_t* alike;      // (M,), the kind of each cell
    const double* gradients;   // (M, d + 1, d), of the barycentric coordinates
    const double* signs;       // (M, d + 1)
    const int64_t* cell_facets;
    const double* moments;     // (F, l, d)
    const double* own;         // (M, d + 1, own_nodes, d), times `sense` what is taken off the moments
    double sense;
    const double *loads, *defect;  // (M, d + 1, d); the latter may be null
    double *energies, *slopes;     // (M,), (M, k); the latter may be null
};

// P'D P / J for P of s -> B s B', the upper triangle; matrices are (count, v, v), those of all cells or one.
void pull_back(int64_t dim, int64_t cells, int64_t count, const double* matrices, const double* points,
               const int64_t* vertices, const double* sizes, double* out);

void add_up_cells(const CellElement& element, const CellStresses& body);

// Stresses (M, d, d) of linear elements, and their nodal forces (M, d + 1, d); matrices are (count, v, v),
// those of all cells or one.
void strain_cells(int64_t dim, int64_t cells, int64_t count, const double* displacement, const int64_t* vertices,
                  const double* gradients, const double* sizes, const double* matrices, double* stresses,
                  double* forces);

// What linear elements leave of the loads, seen by the bubbles of the edges.
struct CellBubbles {
    int64_t dim, cells, edges, facets, matrices;
    const double* stiffness;    // (matrices, v, v), those of all cells or one
    const double *gradients, *sizes;  // (M, d + 1, d), (M,)
    const double *stress, *loads;     // (M, d, d), (M, d + 1, d)
    const int64_t *cell_edges, *cell_facets, *ends;  // (M, e), (M, d + 1), (e, 2)
    const uint8_t* interior;    // (F,)
};

// The sum over the edges inside of r'K^-1 r, with r and K of the bubble of each.
double unresolved_square(const CellBubbles& body);

}  // namespace hemivar
