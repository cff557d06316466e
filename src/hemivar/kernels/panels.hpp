// Triangular solves: a unit lower triangle by columns, and substitution through it and its transpose.
#pragma once

#include <cstdint>
#include <vector>

#include "memory.hpp"

namespace hemivar {

// Neighbouring columns with the same rows below them are one panel: its rows are numbered once, and its numbers lie
// row by row. Columns from `count` on are those of the identity.
class Panels {
public:
    // Of each column its rows in order, the first of them the one of the diagonal.
    Panels(int64_t count, const int32_t* starts, const int32_t* rows, const double* entries);

    // L x = b and L' x = b, in place.
    void forward(double* x) const;
    void backward(double* x) const;

private:
    struct Panel {
        int64_t first, width, rows, row_at, entry_at;
    };
    std::vector<Panel> panels_;
    Array<int32_t> rows_;
    Array<double> entries_;  // of each panel its triangle by columns, without the diagonal, and the rows below it
};

}  // namespace hemivar
