// What is around the vertices of a mesh of simplices: its facets, the cells of each vertex, and tractions that balance
// the cells there (hemivar.bounds.vertex_moments says which).
//
// Moments on facets at different vertices are different numbers, so nobody waits for anybody.
#pragma once

#include <cstdint>

#include "memory.hpp"

namespace hemivar {

// Facets in the order of the places of their nodes. Facet i of a cell is opposite to its vertex i.
struct Facets {
    int dim;
    int64_t cells, count = 0;
    Array<int64_t> entry;  // `2 (cell (dim + 1) + i)`, facet after facet, and 1 for the first cell of a facet
    Array<int64_t> start;  // of the entries of facets by their smallest place
    Array<int64_t> first;  // number of the first facet there

    // Places of the vertices of each cell, rising; `second` marks facets whose cell is the second one, or is null.
    Facets(int dim, int64_t nodes, int64_t cells, const int64_t* placed, const uint8_t* second);
    // With the vertices of the cells: numbers and signs of their facets, cells of the facets (-1 for none), their nodes
    // in the first cell and in the second one, or in the first one again.
    void get(const int64_t* vertices, int64_t* numbers, double* signs, int64_t* owners, int64_t* nodes,
             int64_t* others) const;
};

// Of cells with these vertices and facets: B of `x = B x^ + x_0`, the gradients of the barycentric coordinates, and the
// normals of the facets times their measures, outward from the first cell, and these.
void measure_simplices(int dim, int64_t cells, const double* points, const int64_t* vertices, const int64_t* numbers,
                       const double* signs, double* jacobian, double* gradients, double* normals, double* measures);

// The cells of each vertex as `cell corners + corner`, in order; where they start; and the place of each among them.
void list_stars(int corners, int64_t nodes, int64_t cells, const int64_t* vertices, int64_t* start, int64_t* pairs,
                int32_t* place);

struct StarBody {
    int64_t dim, of_facet, of_cell;  // nodes of a facet and of a cell
    int64_t vertices, nodes, cells, facets;
    const int64_t* cell_nodes;   // cells, of_cell
    const int64_t* cell_facets;  // cells, dim + 1
    const int64_t* owners;       // facets, 2
    const uint8_t* interior;     // facets
    const uint8_t* contact;      // facets
    const double* measures;      // facets
    const double* volumes;       // cells
    const double* dear;          // cells: what the square of a moment costs, times the square of the measure
    const double* forces;        // cells, of_cell, dim
    const double* loads;         // cells, of_cell, dim
    const double* own;           // cells, dim + 1, of_facet, dim: moments of the cells; null where these are -forces
    const int64_t* outer;        // facets: where those of the boundary stand in the next three
    const double* given;         // outer facets, of_facet, dim
    const double* unknown;       // outer facets, dim, dim
    const double* pressures;     // outer facets, of_facet, dim; or null
    const double* missed;        // nodes, dim; or null
    const int64_t* start;        // vertices + 1
    const int64_t* pairs;        // cells (dim + 1)
    const int32_t* place;        // cells (dim + 1)
};

// Tractions in equilibrium on all cells, what nodes lack, and what of it is missed (facets, of_facet, dim; twice cells,
// of_cell, dim; the last where `missed` is there). Returns a vertex around which not all cells share facets, or -1.
int64_t settle_stars(const StarBody& body, double* moments, double* defect, double* missed);

// Moments on contact facets at these vertices, which share the forces of the nodes there.
void share_on_contact(const StarBody& body, int64_t count, const int64_t* vertices, double* moments);

}  // namespace hemivar
