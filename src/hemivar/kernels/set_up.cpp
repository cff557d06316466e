// Set-up of multigrid: from matrices by rows (CSR) to levels in blocks of single precision.
#include "levels.hpp"


#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "lanes.hpp"
#include "pool.hpp"

namespace hemivar {

namespace {

// Weights of prolongations, of order one, that are nothing but rounding.
constexpr double kRounded = 1e-14;

// Exactly, for the same numbers must come out in every unit.
double scale_of(double value) { return value > 0.0 && std::isfinite(value) ? 1.0 / std::sqrt(value) : 1.0; }

// The inverse (d, d) of a block over `weight`, on its free components; a pivot that is not positive becomes one.
void invert(const float* own, int d, double weight, const bool* free, float* inverse) {
    double matrix[36], right[36];
    for (int i = 0; i < d; ++i) {
        for (int j = 0; j < d; ++j) {
            const bool both = free[i] && free[j];
            matrix[i * d + j] = both ? weight * own[i * d + j] : 0.0;
            right[i * d + j] = i == j && free[i] ? 1.0 : 0.0;
        }
        if (!free[i]) matrix[i * d + i] = 1.0;
    }
    for (int k = 0; k < d; ++k) {  // Gauss-Jordan; the block is symmetric and positive
        double pivot = matrix[k * d + k];
        const double size = std::abs(static_cast<double>(own[k * d + k])) * weight;
        if (!(pivot > 1e-10 * size)) pivot = size > 0.0 ? size : 1.0;
        for (int j = 0; j < d; ++j) {
            matrix[k * d + j] /= pivot;
            right[k * d + j] /= pivot;
        }
        for (int i = 0; i < d; ++i) {
            const double factor = matrix[i * d + k];
            if (i == k || factor == 0.0) continue;
            for (int j = 0; j < d; ++j) {
                matrix[i * d + j] -= factor * matrix[k * d + j];
                right[i * d + j] -= factor * right[k * d + j];
            }
        }
    }
    for (int i = 0; i < d * d; ++i) inverse[i] = static_cast<float>(right[i]);
}

}  // namespace

Level::Level(const Csr& matrix, int size, int64_t count, const int32_t* places, const float* signs,
             const int32_t* contact, int64_t contacts, const Array<double>* scaled)
    : d(size), nodes(count), n(matrix.rows), place(places, places + matrix.rows), unit(signs, signs + matrix.rows) {
    Array<double> scale(count, 1.0);
    const int64_t dd = static_cast<int64_t>(d) * d;
    Array<int32_t> unknown(nodes * d, -1);
    plain = n == nodes * d;
    for (int64_t k = 0; k < n; ++k) {
        unknown[place[k]] = static_cast<int32_t>(k);
        plain = plain && place[k] == k;
    }
    block = std::max(kSmallest, (nodes + kBlocks - 1) / kBlocks);
    start.assign(nodes + 1, 0);
    const int64_t work = (nodes + kChunk - 1) / kChunk;
    Array<int32_t> owner(n);  // node of each unknown
    for (int64_t k = 0; k < n; ++k) owner[k] = place[k] / d;
    // Whether two rows have the same columns.
    auto same = [&](int32_t row, int32_t other) {
        const int32_t begin = matrix.indptr[row], from = matrix.indptr[other];
        return std::equal(matrix.indices + begin, matrix.indices + matrix.indptr[row + 1], matrix.indices + from,
                          matrix.indices + matrix.indptr[other + 1]);
    };
    // Nodes of the row of a node but its own, in order, behind what is there already.
    auto add_nodes = [&](int64_t i, std::vector<int32_t>& found) {
        const size_t first = found.size();
        bool sorted = true;
        int32_t last = -1;
        for (int c = 0; c < d; ++c) {
            const int32_t row = unknown[i * d + c];
            if (row < 0 || (last >= 0 && same(row, last))) continue;
            last = row;
            for (int32_t e = matrix.indptr[row]; e < matrix.indptr[row + 1]; ++e) {
                const int32_t node = owner[matrix.indices[e]];
                if (node == i || (found.size() > first && found.back() == node)) continue;
                sorted = sorted && (found.size() == first || found.back() < node);
                found.push_back(node);
            }
        }
        if (sorted) return;
        std::sort(found.begin() + first, found.end());
        found.erase(std::unique(found.begin() + first, found.end()), found.end());
    };
    std::vector<std::vector<int32_t>> columns(work);  // of each piece
    share(work, [&](int64_t piece) {
        std::vector<int32_t>& found = columns[piece];
        for (int64_t i = piece * kChunk; i < std::min(nodes, (piece + 1) * kChunk); ++i) {
            const size_t known = found.size();
            add_nodes(i, found);
            start[i + 1] = static_cast<int32_t>(found.size() - known);
            double largest = 0.0;
            for (int c = 0; c < d; ++c) {
                const int32_t row = unknown[i * d + c];
                if (row < 0) continue;
                const int32_t *begin = matrix.indices + matrix.indptr[row], *end = matrix.indices + matrix.indptr[row + 1];
                const int32_t* own = std::lower_bound(begin, end, row);
                if (own != end && *own == row) largest = std::max(largest, std::abs(matrix.data[own - matrix.indices]));
            }
            scale[i] = scale_of(largest);
        }
    });
    for (int64_t k = 0; k < n; ++k) unit[k] = scaled ? (*scaled)[k] : unit[k] * scale[place[k] / d];
    int64_t total = 0, longest = 0;
    for (int64_t i = 0; i < nodes; ++i) {
        longest = std::max(longest, static_cast<int64_t>(start[i + 1]));
        total += start[i + 1];
        if (total > std::numeric_limits<int32_t>::max()) throw std::length_error("blocks");
        start[i + 1] = static_cast<int32_t>(total);
    }
    if (longest > std::numeric_limits<uint16_t>::max()) throw std::length_error("row");
    column.resize(total);
    before.resize(nodes);
    outside.resize(nodes);
    weight.assign(nodes, 1.0f);
    auto make = [&](Blank<float>& part, int64_t blocks) {
        part.resize(blocks * dd + kBeyond);
        std::fill(part.end() - kBeyond, part.end(), 0.0f);
    };
    make(rows.block, total);
    make(rows.own, nodes);
    make(rows.inverse, nodes);
    share(work, [&](int64_t piece) {
        std::vector<int32_t> number;  // where the columns of a node go
        std::vector<float*> entry;    // where the entries of a row go, of the first component
        const int32_t* found = columns[piece].data();
        for (int64_t i = piece * kChunk; i < std::min(nodes, (piece + 1) * kChunk); ++i) {
            const int64_t count_of = start[i + 1] - start[i];
            const int32_t* end = found + count_of;
            const int64_t low = i / block * block, high = std::min(nodes, low + block);
            auto rank = [&](int32_t j) { return j < low || j >= high ? 1 : (j < i ? 0 : 2); };
            int count[3] = {0, 0, 0};
            for (const int32_t* j = found; j < end; ++j) ++count[rank(*j)];
            before[i] = static_cast<uint16_t>(count[0]);
            outside[i] = static_cast<uint16_t>(count[1]);
            int32_t next[3] = {start[i], start[i] + count[0], start[i] + count[0] + count[1]};
            number.resize(count_of);
            for (int64_t e = 0; e < count_of; ++e) {
                number[e] = next[rank(found[e])]++;
                column[number[e]] = found[e];
            }
            std::fill_n(&rows.block[start[i] * dd], count_of * dd, 0.0f);
            std::fill_n(&rows.own[i * dd], dd, 0.0f);
            bool free[6];
            int32_t last = -1;
            for (int c = 0; c < d; ++c) {
                const int32_t row = unknown[i * d + c];
                free[c] = row >= 0;
                if (row < 0) {
                    rows.own[i * dd + c * d + c] = 1.0f;
                    continue;
                }
                const int32_t begin = matrix.indptr[row], length = matrix.indptr[row + 1] - begin;
                if (last < 0 || !same(row, last)) {
                    entry.resize(length);
                    const int32_t* near = found;
                    for (int32_t e = 0; e < length; ++e) {
                        const int32_t other = matrix.indices[begin + e], j = owner[other];
                        if (j != i && (near == end || *near != j)) near = std::lower_bound(found, end, j);
                        float* own = j == i ? &rows.own[i * dd] : &rows.block[number[near - found] * dd];
                        entry[e] = own + (place[other] - j * d) * d;
                    }
                }
                last = row;
                for (int32_t e = 0; e < length; ++e) {
                    const double value = matrix.data[begin + e] * unit[row] * unit[matrix.indices[begin + e]];
                    entry[e][c] = static_cast<float>(value);
                }
            }
            found = end;
            // With all that couples blocks counted twice the sum of smoother and transpose exceeds the matrix.
            double coupled[6] = {0, 0, 0, 0, 0, 0}, most = 0.0;
            for (int64_t e = start[i] + before[i]; e < start[i] + before[i] + outside[i]; ++e) {
                for (int c = 0; c < d * d; ++c) coupled[c % d] += std::abs(rows.block[e * dd + c]);
            }
            for (int c = 0; c < d; ++c) {
                if (free[c]) most = std::max(most, coupled[c] / std::max(1e-30f, std::abs(rows.own[i * dd + c * d + c])));
            }
            weight[i] = static_cast<float>(std::max(1.0, 0.5 * (1.0 + most)));
            invert(&rows.own[i * dd], d, weight[i], free, &rows.inverse[i * dd]);
        }
    });
    // Where the entries of contact rows go.
    for (int64_t k = 0; k < contacts; ++k) {
        contact_slots.push_back(place[contact[k]]);
        contact_nodes.push_back(place[contact[k]] / d);
    }
    std::sort(contact_nodes.begin(), contact_nodes.end());
    contact_nodes.erase(std::unique(contact_nodes.begin(), contact_nodes.end()), contact_nodes.end());
    contact_start.push_back(0);
    for (int32_t i : contact_nodes) contact_start.push_back(contact_start.back() + start[i + 1] - start[i]);
    for (int64_t k = 0; k < contacts; ++k) {
        const int32_t i = contact_slots[k] / d, c = contact_slots[k] % d, row = contact[k];
        const int64_t mine = std::lower_bound(contact_nodes.begin(), contact_nodes.end(), i) - contact_nodes.begin();
        for (int32_t e = matrix.indptr[row]; e < matrix.indptr[row + 1]; ++e) {
            const int32_t slot = place[matrix.indices[e]], j = slot / d, inside = slot % d * d + c;
            contact_factor.push_back(unit[row] * unit[matrix.indices[e]]);
            if (j == i) {
                target.push_back(-1 - (mine * dd + inside));
                continue;
            }
            const auto begin = column.begin() + start[i], end = column.begin() + start[i + 1];
            const int64_t at = std::find(begin, end, j) - begin;
            target.push_back((contact_start[mine] + at) * dd + inside);
        }
    }
}

Transfer::Transfer(const Csr& P, const Level& fine, const Level& coarse) {
    Array<int32_t> row_of(fine.nodes * fine.d, -1);
    Array<uint8_t> there(coarse.nodes * coarse.d, 0);
    for (int64_t k = 0; k < fine.n; ++k) row_of[fine.place[k]] = static_cast<int32_t>(k);
    for (int32_t slot : coarse.place) there[slot] = 1;
    // Weights of groups of so many slots; false if some block of them is no multiple of the identity, but for unknowns that
    // do not exist.
    auto gather = [&](int group) {
        struct Near {
            int32_t column;
            float weight;
            int count;
        };
        const int64_t above = fine.nodes * fine.d / group, pieces = (above + kChunk - 1) / kChunk;
        std::vector<std::vector<Near>> found(pieces);
        start.assign(above + 1, 0);
        std::atomic<bool> alike{true};
        share(pieces, [&](int64_t piece) {
            std::vector<Near>& mine = found[piece];
            for (int64_t i = piece * kChunk; i < std::min(above, (piece + 1) * kChunk) && alike.load(); ++i) {
                const auto begin = static_cast<int64_t>(mine.size());
                bool sorted = true;
                for (int c = 0; c < group; ++c) {
                    const int32_t k = row_of[i * group + c];
                    if (k < 0) continue;
                    for (int32_t e = P.indptr[k]; e < P.indptr[k + 1]; ++e) {
                        if (!(std::abs(P.data[e]) > kRounded)) continue;
                        const int32_t slot = coarse.place[P.indices[e]], column = slot / group;
                        const float w = static_cast<float>(P.data[e] * coarse.unit[P.indices[e]] / fine.unit[k]);
                        if (group > 1 && slot - column * group != c) alike = false;
                        const auto known = group == 1 ? mine.end()
                                                      : std::find_if(mine.begin() + begin, mine.end(), [&](const Near& one) {
                                                            return one.column == column;
                                                        });
                        if (known != mine.end()) {
                            if (!(std::abs(known->weight - w) <= 1e-6f * std::abs(w))) alike = false;
                            ++known->count;
                        } else {
                            sorted = sorted && (static_cast<int64_t>(mine.size()) == begin || mine.back().column < column);
                            mine.push_back({column, w, 1});
                        }
                    }
                }
                start[i + 1] = static_cast<int32_t>(static_cast<int64_t>(mine.size()) - begin);
                if (group == 1) continue;
                if (!sorted) {
                    std::sort(mine.begin() + begin, mine.end(),
                              [](const Near& one, const Near& other) { return one.column < other.column; });
                }
                for (auto one = mine.begin() + begin; one != mine.end(); ++one) {
                    int both = 0;
                    for (int c = 0; c < group; ++c) both += row_of[i * group + c] >= 0 && there[one->column * group + c];
                    if (both != one->count) alike = false;
                }
            }
        });
        if (!alike.load()) return false;
        for (int64_t i = 0; i < above; ++i) start[i + 1] += start[i];
        column.resize(start[above]);
        weight.resize(start[above]);
        share(pieces, [&](int64_t piece) {
            int64_t at = start[piece * kChunk];
            for (const Near& one : found[piece]) {
                column[at] = one.column;
                weight[at++] = one.weight;
            }
        });
        components = group;
        return true;
    };
    if (!(fine.d == coarse.d && fine.d > 1 && gather(fine.d))) {
        gather(1);
        to_blocks(fine, coarse);
    }
    // And back.
    const int64_t under = coarse.nodes * coarse.d / (components * columns), each = rows * columns;
    back_start.assign(under + 1, 0);
    for (int32_t j : column) ++back_start[j + 1];
    for (int64_t j = 0; j < under; ++j) back_start[j + 1] += back_start[j];
    back_column.resize(column.size());
    back_weight.resize(weight.size());
    std::vector<int32_t> next(back_start.begin(), back_start.end() - 1);
    for (size_t i = 0; i + 1 < start.size(); ++i) {
        for (int32_t e = start[i]; e < start[i + 1]; ++e) {
            const int32_t at = next[column[e]]++;
            back_column[at] = static_cast<int32_t>(i);
            for (int64_t w = 0; w < each; ++w) {
                back_weight[at * each + w % rows * columns + w / rows] = weight[e * each + w];
            }
        }
    }
}

void Transfer::to_blocks(const Level& fine, const Level& coarse) {
    const int r = fine.d, c = coarse.d;
    if (r == 1 || c == 1) return;
    Array<int32_t> block_start(fine.nodes + 1, 0), block_column;
    for (int64_t i = 0; i < fine.nodes; ++i) {
        const auto first = static_cast<int64_t>(block_column.size());
        for (int32_t e = start[i * r]; e < start[(i + 1) * r]; ++e) block_column.push_back(column[e] / c);
        std::sort(block_column.begin() + first, block_column.end());
        block_column.erase(std::unique(block_column.begin() + first, block_column.end()), block_column.end());
        block_start[i + 1] = static_cast<int32_t>(block_column.size());
    }
    if (block_column.size() * r * c > 2 * column.size()) return;
    Array<float> block(block_column.size() * r * c, 0.0f);
    for (int64_t i = 0; i < fine.nodes; ++i) {
        const auto begin = block_column.begin() + block_start[i], end = block_column.begin() + block_start[i + 1];
        for (int k = 0; k < r; ++k) {
            for (int32_t e = start[i * r + k]; e < start[i * r + k + 1]; ++e) {
                const int64_t at = std::lower_bound(begin, end, column[e] / c) - block_column.begin();
                block[(at * c + column[e] % c) * r + k] = weight[e];
            }
        }
    }
    rows = r;
    columns = c;
    start.swap(block_start);
    column.swap(block_column);
    weight.swap(block);
}

void Truncation::change(int64_t k, const uint8_t* held, const double* values) {
    const Level& level = *levels.levels[k];
    Changed& changed = this->changed[k];
    const int d = level.d;
    const int64_t dd = static_cast<int64_t>(d) * d, count = static_cast<int64_t>(level.contact_nodes.size());
    Rows& rows = changed.rows;
    rows.block.assign(level.contact_start.back() * dd + kBeyond, 0.0f);
    rows.own.assign(count * dd + kBeyond, 0.0f);
    rows.inverse.assign(count * dd + kBeyond, 0.0f);
    // Rows of components that are no contact unknowns stay.
    for (int64_t m = 0; m < count; ++m) {
        const int64_t i = level.contact_nodes[m];
        std::copy_n(&level.rows.own[i * dd], dd, &rows.own[m * dd]);
        const int64_t length = (level.start[i + 1] - level.start[i]) * dd;
        if (length == 0) continue;
        std::copy_n(&level.rows.block[level.start[i] * dd], length, &rows.block[level.contact_start[m] * dd]);
    }
    for (size_t e = 0; e < level.target.size(); ++e) {
        const float value = static_cast<float>(values[e] * level.contact_factor[e]);
        const int64_t at = level.target[e];
        if (at >= 0) {
            rows.block[at] = value;
        } else {
            rows.own[-1 - at] = value;
        }
    }
    std::vector<uint8_t> free(count * d, 0), there(level.nodes * d, 0);
    for (int32_t slot : level.place) there[slot] = 1;
    for (int64_t m = 0; m < count; ++m) {
        for (int c = 0; c < d; ++c) free[m * d + c] = there[level.contact_nodes[m] * d + c];
    }
    changed.held.clear();
    for (size_t u = 0; u < level.contact_slots.size(); ++u) {
        if (!held[u]) continue;
        const int32_t slot = level.contact_slots[u];
        const auto begin = level.contact_nodes.begin();
        const int64_t m = std::lower_bound(begin, level.contact_nodes.end(), slot / d) - begin;
        changed.held.push_back(slot);
        free[m * d + slot % d] = 0;
    }
    for (int64_t m = 0; m < count; ++m) {
        bool mine[6];
        for (int c = 0; c < d; ++c) mine[c] = free[m * d + c] != 0;
        invert(&rows.own[m * dd], d, level.weight[level.contact_nodes[m]], mine,
               &rows.inverse[m * dd]);
    }
    changed.active = true;
}

void Truncation::set_root(const double* given) {
    const Level& coarsest = level(0);
    const int64_t n = coarsest.n;
    root.resize(n * n);
    first.resize(n);
    for (int64_t i = 0; i < n; ++i) {
        const double scale = coarsest.unit[i];
        int64_t begin = 0;
        while (begin < n && given[i * n + begin] == 0.0) ++begin;
        first[i] = static_cast<int32_t>(begin);
        for (int64_t j = 0; j < n; ++j) root[i * n + j] = static_cast<float>(given[i * n + j] / scale);
    }
}

}  // namespace hemivar
