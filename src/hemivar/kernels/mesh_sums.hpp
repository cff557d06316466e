// Assembly over the cells of a mesh of simplices, by nodes.
//
// Each row has one owner, who adds up what belongs to it in the order of the cells: nobody waits for anybody, and no sum
// depends on the number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "memory.hpp"

namespace hemivar {

struct Simplices {
    int dim;  // 2 or 3
    int64_t nodes, cells;
    const int64_t* vertices;  // dim + 1 of each cell
};

// The edges of a mesh: for each node those to larger ones, in order.
struct Edges {
    Simplices mesh;
    Array<int32_t> start, other;

    explicit Edges(const Simplices& mesh);
    // Nodes of the edges, and the edges of the cells: those of one local pair after those of another.
    void get(int64_t* edges, int64_t* cell_edges) const;
};

// A linear law: strain s is the sum of the derivatives k of components i with strains[i * dim + k] == s.
struct Law {
    int components, count;  // of strains
    const int32_t* strains;
    int64_t matrices;  // one for all cells, or one for each
    const double* matrix;
};

// Which nodes couple: a symmetric matrix of blocks has one of each node and one of each edge.
struct Graph {
    int64_t nodes, edges;
    Array<int32_t> above, high;    // the edges of a node to larger ones, and these
    Array<int32_t> below, number;  // those to smaller ones
    Array<int32_t> low;

    Graph(int64_t nodes, int64_t edges, const int64_t* pairs);

    // Adds the blocks of the edges in cells first, first + 1, ..., last - 1; the matrices and volumes are those of these.
    void add(const Simplices& mesh, const double* points, const double* volumes, int64_t first, int64_t last,
             const Law& law, double* upper) const;
    // Blocks of the nodes that make every row sum to zero, symmetric.
    void close(int components, const double* upper, double* diagonal) const;
    // Where the rows of the free components start; the number of entries.
    int64_t lengths(int components, const uint8_t* free, int32_t* indptr) const;
    // These rows.
    void rows(int components, const uint8_t* free, const double* diagonal, const double* upper, const int32_t* indptr,
              int32_t* indices, double* data) const;
};

// Numbers of rows in the order in which they come: the same where all blocks of two rows are, but for a part `tolerance`
// of the largest entry of each.
struct Block {
    int64_t width;
    const double* values;
};
void number_alike(int64_t rows, const std::vector<Block>& blocks, double tolerance, int64_t* out);

}  // namespace hemivar
