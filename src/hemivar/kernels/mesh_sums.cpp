// Assembly: from cells to edges, blocks and rows.
#include "mesh_sums.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "levels.hpp"
#include "pool.hpp"

namespace hemivar {

namespace {

constexpr int64_t kCells = 4096;  // cells of a piece of work
constexpr int kPairs[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};  // of a triangle: the first three

constexpr int32_t kAhead = 16;  // blocks asked for before they are needed

inline void fetch(const double* from) {
#if defined(__GNUC__)
    __builtin_prefetch(from);
    __builtin_prefetch(from + 8);
#else
    static_cast<void>(from);
#endif
}

int32_t narrow(int64_t value) {
    if (value < 0 || value > std::numeric_limits<int32_t>::max()) throw std::length_error("too many for 32 bits");
    return static_cast<int32_t>(value);
}

template <class Work>
void by_nodes(int64_t nodes, const Work& work) {
    share((nodes + kChunk - 1) / kChunk,
          [&](int64_t piece) { work(piece, piece * kChunk, std::min(nodes, (piece + 1) * kChunk)); });
}

// The cells of a range that each node has, in order, but for those of which it is the largest node.
struct Incidence {
    Array<int32_t> start, cell;

    Incidence(const Simplices& mesh, int64_t first, int64_t last) {
        const int corners = mesh.dim + 1;
        narrow(mesh.nodes);
        narrow((last - first) * corners);
        start.assign(mesh.nodes + 1, 0);
        for (int64_t cell = first; cell < last; ++cell) {
            const int64_t* mine = mesh.vertices + cell * corners;
            const int64_t largest = *std::max_element(mine, mine + corners);
            for (int c = 0; c < corners; ++c) {
                if (mine[c] < 0 || mine[c] >= mesh.nodes) throw std::out_of_range("node");
                for (int b = 0; b < c; ++b) {
                    if (mine[b] == mine[c]) throw std::out_of_range("the same node twice");
                }
                if (mine[c] != largest) ++start[mine[c] + 1];
            }
        }
        for (int64_t i = 0; i < mesh.nodes; ++i) start[i + 1] += start[i];
        cell.resize(start[mesh.nodes]);
        // Where the next cell of a node goes; at the end it is where those of the next node start.
        for (int64_t one = first; one < last; ++one) {
            const int64_t* mine = mesh.vertices + one * corners;
            const int64_t largest = *std::max_element(mine, mine + corners);
            for (int c = 0; c < corners; ++c) {
                if (mine[c] != largest) cell[start[mine[c]]++] = static_cast<int32_t>(one - first);
            }
        }
        std::copy_backward(start.begin(), start.end() - 1, start.end());
        start[0] = 0;
    }
};

// Gradients of the barycentric coordinates of a cell, times the root of its volume.
template <int D>
void gradients(const double* points, const int64_t* vertices, double volume, double (&found)[D + 1][D]) {
    double side[D][D];
    for (int k = 0; k < D; ++k) {
        for (int i = 0; i < D; ++i) side[k][i] = points[vertices[k + 1] * D + i] - points[vertices[0] * D + i];
    }
    const double scale = 1.0 / ((D == 2 ? 2.0 : 6.0) * std::sqrt(volume));
    if constexpr (D == 2) {
        found[1][0] = side[1][1] * scale;
        found[1][1] = -side[1][0] * scale;
        found[2][0] = -side[0][1] * scale;
        found[2][1] = side[0][0] * scale;
    } else {
        for (int k = 0; k < 3; ++k) {
            const double *left = side[(k + 1) % 3], *right = side[(k + 2) % 3];
            for (int i = 0; i < 3; ++i) {
                const int p = (i + 1) % 3, q = (i + 2) % 3;
                found[k + 1][i] = (left[p] * right[q] - left[q] * right[p]) * scale;
            }
        }
    }
    for (int i = 0; i < D; ++i) {
        found[0][i] = 0.0;
        for (int k = 1; k <= D; ++k) found[0][i] -= found[k][i];
    }
}

template <int C, int D>
void add_cells(const Graph& graph, const Simplices& mesh, const double* points, const double* volumes, int64_t first,
               int64_t last, const Law& law, double* upper) {
    const Incidence incidence(mesh, first, last);
    // One matrix for all cells multiplies the sums of the products of gradients.
    const bool late = C == D && law.matrices == 1;
    double table[C * C][D * D];
    for (int ij = 0; ij < C * C; ++ij) {
        for (int kl = 0; kl < D * D; ++kl) {
            const int row = law.strains[ij / C * D + kl / D], column = law.strains[ij % C * D + kl % D];
            table[ij][kl] = law.matrix[row * law.count + column];
        }
    }
    std::atomic<bool> strange{false};
    by_nodes(mesh.nodes, [&](int64_t, int64_t from, int64_t to) {
        std::vector<double> products;
        std::vector<double> stress(C * law.count);  // of a motion of one node, for each component
        for (int64_t node = from; node < to; ++node) {
            const int32_t begin = graph.above[node], end = graph.above[node + 1];
            if (late) products.assign((end - begin) * D * D, 0.0);
            for (int32_t at = incidence.start[node]; at < incidence.start[node + 1]; ++at) {
                const int64_t cell = incidence.cell[at];
                const int64_t* mine = mesh.vertices + (first + cell) * (D + 1);
                double h[D + 1][D];
                gradients<D>(points, mine, volumes[cell], h);
                const double* own = h[std::find(mine, mine + D + 1, node) - mine];
                if (!late) {
                    const double* matrix = law.matrix + (law.matrices == 1 ? 0 : cell) * law.count * law.count;
                    std::fill(stress.begin(), stress.end(), 0.0);
                    for (int ik = 0; ik < C * D; ++ik) {
                        const double* row = matrix + law.strains[ik] * law.count;
                        for (int s = 0; s < law.count; ++s) stress[ik / D * law.count + s] += own[ik % D] * row[s];
                    }
                }
                for (int b = 0; b <= D; ++b) {
                    if (mine[b] <= node) continue;
                    const auto low = graph.high.begin() + begin, high = graph.high.begin() + end;
                    const auto place = std::lower_bound(low, high, mine[b]);
                    if (place == high || *place != mine[b]) {
                        strange = true;
                        continue;
                    }
                    if (late) {
                        double* sum = &products[(place - low) * D * D];
                        for (int kl = 0; kl < D * D; ++kl) sum[kl] += own[kl / D] * h[b][kl % D];
                        continue;
                    }
                    double* block = upper + (place - graph.high.begin()) * C * C;
                    for (int ij = 0; ij < C * C; ++ij) {
                        const double* force = &stress[ij / C * law.count];
                        double sum = 0.0;
                        for (int l = 0; l < D; ++l) sum += force[law.strains[ij % C * D + l]] * h[b][l];
                        block[ij] += sum;
                    }
                }
            }
            for (int32_t e = begin; late && e < end; ++e) {
                const double* sum = &products[(e - begin) * D * D];
                for (int ij = 0; ij < C * C; ++ij) {
                    double entry = 0.0;
                    for (int kl = 0; kl < D * D; ++kl) entry += table[ij][kl] * sum[kl];
                    upper[static_cast<int64_t>(e) * C * C + ij] += entry;
                }
            }
        }
    });
    if (strange) throw std::out_of_range("edge");
}

}  // namespace

Edges::Edges(const Simplices& given) : mesh(given) {
    const Incidence incidence(mesh, 0, mesh.cells);
    start.assign(mesh.nodes + 1, 0);
    std::vector<std::vector<int32_t>> found((mesh.nodes + kChunk - 1) / kChunk);
    by_nodes(mesh.nodes, [&](int64_t piece, int64_t from, int64_t to) {
        std::vector<int32_t> near;
        for (int64_t node = from; node < to; ++node) {
            near.clear();
            for (int32_t at = incidence.start[node]; at < incidence.start[node + 1]; ++at) {
                const int64_t* mine = mesh.vertices + static_cast<int64_t>(incidence.cell[at]) * (mesh.dim + 1);
                for (int c = 0; c <= mesh.dim; ++c) {
                    if (mine[c] > node) near.push_back(static_cast<int32_t>(mine[c]));
                }
            }
            std::sort(near.begin(), near.end());
            near.erase(std::unique(near.begin(), near.end()), near.end());
            start[node + 1] = static_cast<int32_t>(near.size());
            found[piece].insert(found[piece].end(), near.begin(), near.end());
        }
    });
    int64_t total = 0;
    for (int64_t i = 0; i < mesh.nodes; ++i) start[i + 1] = narrow(total += start[i + 1]);
    other.resize(total);
    by_nodes(mesh.nodes, [&](int64_t piece, int64_t from, int64_t) {
        std::copy(found[piece].begin(), found[piece].end(), other.begin() + start[from]);
    });
}

void Edges::get(int64_t* edges, int64_t* cell_edges) const {
    by_nodes(mesh.nodes, [&](int64_t, int64_t from, int64_t to) {
        for (int64_t node = from; node < to; ++node) {
            for (int64_t e = start[node]; e < start[node + 1]; ++e) {
                edges[2 * e] = node;
                edges[2 * e + 1] = other[e];
            }
        }
    });
    share((mesh.cells + kCells - 1) / kCells, [&](int64_t piece) {
        for (int64_t cell = piece * kCells; cell < std::min(mesh.cells, (piece + 1) * kCells); ++cell) {
            const int64_t* mine = mesh.vertices + cell * (mesh.dim + 1);
            for (int p = 0; p < (mesh.dim == 2 ? 3 : 6); ++p) {
                const int64_t one = mine[kPairs[p][0]], two = mine[kPairs[p][1]];
                const int64_t low = std::min(one, two), high = std::max(one, two);
                const auto end = other.begin() + start[low + 1];
                const auto place = std::lower_bound(other.begin() + start[low], end, high);
                cell_edges[p * mesh.cells + cell] = place - other.begin();
            }
        }
    });
}

Graph::Graph(int64_t count, int64_t total, const int64_t* pairs) : nodes(count), edges(total) {
    narrow(nodes);
    narrow(edges);
    above.assign(nodes + 1, 0);
    below.assign(nodes + 1, 0);
    high.resize(edges);
    low.resize(edges);
    number.resize(edges);
    for (int64_t e = 0; e < edges; ++e) {
        const int64_t one = pairs[2 * e], two = pairs[2 * e + 1];
        if (one < 0 || one >= two || two >= nodes) throw std::out_of_range("node");
        if (e > 0 && (one < low[e - 1] || (one == low[e - 1] && two <= high[e - 1]))) throw std::out_of_range("order");
        low[e] = static_cast<int32_t>(one);
        high[e] = static_cast<int32_t>(two);
        ++above[one + 1];
        ++below[two + 1];
    }
    for (int64_t i = 0; i < nodes; ++i) above[i + 1] += above[i];
    for (int64_t i = 0; i < nodes; ++i) below[i + 1] += below[i];
    for (int64_t e = 0; e < edges; ++e) number[below[high[e]]++] = static_cast<int32_t>(e);
    std::copy_backward(below.begin(), below.end() - 1, below.end());
    below[0] = 0;
}

void Graph::add(const Simplices& mesh, const double* points, const double* volumes, int64_t first, int64_t last,
                const Law& law, double* upper) const {
    if (mesh.nodes != nodes || first < 0 || last < first || last > mesh.cells) throw std::out_of_range("cells");
    for (int k = 0; k < law.components * mesh.dim; ++k) {
        if (law.strains[k] < 0 || law.strains[k] >= law.count) throw std::out_of_range("strain");
    }
    const auto work = mesh.dim == 2 ? (law.components == 1 ? add_cells<1, 2> : add_cells<2, 2>)
                                    : (law.components == 1 ? add_cells<1, 3> : add_cells<3, 3>);
    work(*this, mesh, points, volumes, first, last, law, upper);
}

void Graph::close(int c, const double* upper, double* diagonal) const {
    by_nodes(nodes, [&](int64_t, int64_t from, int64_t to) {
        for (int64_t node = from; node < to; ++node) {
            double *own = diagonal + node * c * c, ahead[9] = {}, behind[9] = {};
            auto add = [&](int64_t e, double* sum) {
                const double* block = upper + e * c * c;
                for (int i = 0; i < c; ++i) {
                    for (int j = i; j < c; ++j) sum[i * c + j] += 0.5 * (block[i * c + j] + block[j * c + i]);
                }
            };
            for (int32_t e = above[node]; e < above[node + 1]; ++e) add(e, ahead);
            for (int32_t at = below[node]; at < below[node + 1]; ++at) add(number[at], behind);
            for (int i = 0; i < c; ++i) {
                for (int j = i; j < c; ++j) own[i * c + j] = own[j * c + i] = -(ahead[i * c + j] + behind[i * c + j]);
            }
        }
    });
}

int64_t Graph::lengths(int c, const uint8_t* free, int32_t* indptr) const {
    Array<uint8_t> width(nodes, 0);
    for (int64_t k = 0; k < nodes * c; ++k) width[k / c] = static_cast<uint8_t>(width[k / c] + (free[k] != 0));
    Array<int32_t> length(nodes);
    by_nodes(nodes, [&](int64_t, int64_t from, int64_t to) {
        for (int64_t node = from; node < to; ++node) {
            int32_t sum = width[node];
            for (int32_t e = above[node]; e < above[node + 1]; ++e) sum += width[high[e]];
            for (int32_t at = below[node]; at < below[node + 1]; ++at) sum += width[low[number[at]]];
            length[node] = sum;
        }
    });
    int64_t total = 0, row = 0;
    indptr[0] = 0;
    for (int64_t node = 0; node < nodes; ++node) {
        for (int i = 0; i < width[node]; ++i) indptr[++row] = narrow(total += length[node]);
    }
    return total;
}

void Graph::rows(int c, const uint8_t* free, const double* diagonal, const double* upper, const int32_t* indptr,
                 int32_t* indices, double* data) const {
    Array<int32_t> unknown(nodes * c);
    int32_t count = 0;
    for (int64_t k = 0; k < nodes * c; ++k) unknown[k] = free[k] ? count++ : -1;
    by_nodes(nodes, [&](int64_t, int64_t from, int64_t to) {
        for (int64_t node = from; node < to; ++node) {
            int32_t at[3] = {-1, -1, -1};
            for (int i = 0; i < c; ++i) {
                if (unknown[node * c + i] >= 0) at[i] = indptr[unknown[node * c + i]];
            }
            // Entry (i, j) of the block is at i * down + j * right.
            auto put = [&](int64_t other, const double* block, int down, int right) {
                for (int j = 0; j < c; ++j) {
                    const int32_t column = unknown[other * c + j];
                    if (column < 0) continue;
                    for (int i = 0; i < c; ++i) {
                        if (at[i] < 0) continue;
                        indices[at[i]] = column;
                        data[at[i]++] = block[i * down + j * right];
                    }
                }
            };
            const int64_t size = static_cast<int64_t>(c) * c;
            for (int32_t k = below[node]; k < below[node + 1]; ++k) {
                if (k + kAhead < edges) fetch(upper + number[k + kAhead] * size);  // they lie far apart
                put(low[number[k]], upper + number[k] * size, 1, c);
            }
            put(node, diagonal + node * size, c, 1);
            for (int32_t e = above[node]; e < above[node + 1]; ++e) put(high[e], upper + e * size, c, 1);
        }
    });
}

void number_alike(int64_t rows, const std::vector<Block>& blocks, double tolerance, int64_t* out) {
    int64_t width = 0;
    for (const Block& block : blocks) width += block.width + 1;
    std::vector<int64_t> kinds, row(width);        // rounded entries, and the logarithm of the largest one
    std::vector<int64_t> table(1 << 10, -1);       // kinds by a hash of these
    std::vector<uint64_t> hashes;
    const auto place = [&](uint64_t hash) {
        size_t at = hash & (table.size() - 1);
        while (table[at] >= 0 && (hashes[table[at]] != hash ||
                                  !std::equal(row.begin(), row.end(), kinds.begin() + table[at] * width))) {
            at = (at + 1) & (table.size() - 1);
        }
        return at;
    };
    for (int64_t i = 0; i < rows; ++i) {
        int64_t* to = row.data();
        uint64_t hash = 0x9e3779b97f4a7c15;
        for (const Block& block : blocks) {
            const double* from = block.values + i * block.width;
            double size = std::numeric_limits<double>::min();
            for (int64_t k = 0; k < block.width; ++k) size = std::max(size, std::abs(from[k]));
            for (int64_t k = 0; k < block.width; ++k) *to++ = std::llrint(from[k] / size / tolerance);
            *to++ = std::llrint(std::log2(size) / tolerance);
        }
        for (int64_t one : row) {
            hash = (hash ^ static_cast<uint64_t>(one)) * 0xff51afd7ed558ccd;
            hash ^= hash >> 32;
        }
        size_t at = place(hash);
        if (table[at] < 0) {
            table[at] = static_cast<int64_t>(hashes.size());
            hashes.push_back(hash);
            kinds.insert(kinds.end(), row.begin(), row.end());
        }
        out[i] = table[at];
        if (2 * hashes.size() <= table.size()) continue;
        table.assign(4 * table.size(), -1);
        for (size_t kind = 0; kind < hashes.size(); ++kind) {  // all of them differ
            size_t free = hashes[kind] & (table.size() - 1);
            while (table[free] >= 0) free = (free + 1) & (table.size() - 1);
            table[free] = static_cast<int64_t>(kind);
        }
    }
}

}  // namespace hemivar
