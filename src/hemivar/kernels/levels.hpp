// Levels of a multigrid hierarchy in blocks of single precision, and the cycle on them.
//
// Unknowns stand in slots: d for each node, those of no unknown empty. Node i is scaled by s_i, one over the root of
// the largest diagonal entry: A~ = S A S is of order one, and the same in every unit.
//
// Rows of nodes with contact unknowns are changed for one solve by a Truncation, which has its own copy of these.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "memory.hpp"

namespace hemivar {

constexpr int64_t kChunk = 256;    // rows of a piece of work
constexpr int64_t kBlocks = 32;    // blocks of the smoother on a large level
constexpr int64_t kSmallest = 512;  // rows of one of these at least

// A matrix by rows, with sorted columns.
struct Csr {
    int64_t rows, columns;
    const int32_t *indptr, *indices;
    const double* data;
};

// The numbers of some rows of nodes.
struct Rows {
    Blank<float> block;    // off the diagonal, d x d each, column by column
    Blank<float> own;      // on it
    Blank<float> inverse;  // its inverse over `weight`; rows and columns of no free unknown are zero
};

struct Level {
    int d = 1;
    int64_t nodes = 0, n = 0;
    bool plain = false;  // slot k is unknown k
    Array<int32_t> place;
    Array<double> unit;  // +- s of the node of an unknown: slots turn those round that are counted backwards
    Array<int32_t> start, column;
    // Entries of a row: in the block of the smoother and before the diagonal, out of the block, in it and behind.
    Array<uint16_t> before, outside;
    Array<float> weight;  // >= 1: how much the smoother adds to a diagonal block for what couples two blocks
    int64_t block = 0;          // rows of a block
    Rows rows;
    // Nodes of contact unknowns, in order; where the entries of their rows in the matrix go in a copy of these.
    Array<int32_t> contact_nodes, contact_slots;
    Array<int64_t> contact_start;  // first block of each in the copy
    Array<int64_t> target;         // >= 0: number in block; < 0: -1 - number in own
    Array<double> contact_factor;   // s_i s_j of each entry

    Level(const Csr& matrix, int d, int64_t nodes, const int32_t* place, const float* signs,
          const int32_t* contact, int64_t contacts, const Array<double>* scaled = nullptr);
    int64_t pieces() const { return (nodes + block - 1) / block; }
};

// From a coarse level to a fine one and back, for scaled unknowns: by nodes where all components are alike, and by blocks
// of rows x columns, column by column, where most of these are full.
struct Transfer {
    int components = 1, rows = 1, columns = 1;
    Array<int32_t> start, column, back_start, back_column;
    Array<float> weight, back_weight;

    Transfer(const Csr& prolongation, const Level& fine, const Level& coarse);

private:
    void to_blocks(const Level& fine, const Level& coarse);
};

// The rows of the contact nodes of a level in a solve: of all nodes where no mesh belongs to it.
struct Changed {
    Rows rows;
    Array<int32_t> held;      // slots
    bool active = false;
};

// Vectors of a cycle: right-hand side, iterate, residual or next iterate of each level.
using Scratch = std::vector<Array<float>>;

struct Levels {
    std::vector<std::unique_ptr<Level>> levels;
    std::vector<std::unique_ptr<Transfer>> transfers;

    explicit Levels(int64_t count) : levels(count), transfers(count) {}
    // Memory for one cycle, kept for the next one.
    std::unique_ptr<Scratch> borrow() const;
    void give_back(std::unique_ptr<Scratch> scratch) const;

private:
    mutable std::mutex idle_lock_;
    mutable std::vector<std::unique_ptr<Scratch>> idle_;
};

struct Truncation {
    const Levels& levels;
    std::vector<Changed> changed;
    // R with R R' about the inverse of the coarsest matrix, and the first column that is not zero of each row.
    Array<float> root;
    Array<int32_t> first;

    explicit Truncation(const Levels& levels) : levels(levels), changed(levels.levels.size()) {}
    const Level& level(int64_t k) const { return *levels.levels[k]; }
    void change(int64_t k, const uint8_t* held, const double* values);
    void set_root(const double* root);
    void cycle(int64_t top, const double* right, double* out) const;
};

}  // namespace hemivar
