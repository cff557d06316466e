// What Python calls. Arrays are checked there; 0 means done, 1 no memory, 2 not for these kernels.
#include <algorithm>
#include <atomic>
#include <new>
#include <stdexcept>
#include <vector>

#include "active_sets.hpp"
#include "cells.hpp"
#include "laws.hpp"
#include "levels.hpp"
#include "mesh_sums.hpp"
#include "panels.hpp"
#include "patches.hpp"
#include "pool.hpp"
#include "stars.hpp"

#ifdef _WIN32
#define HEMIVAR_API extern "C" __declspec(dllexport)
#else
#define HEMIVAR_API extern "C" __attribute__((visibility("default")))
#endif

using namespace hemivar;

namespace {

template <class Work>
int guarded(Work&& work) {
    try {
        work();
        return 0;
    } catch (const std::bad_alloc&) {
        return 1;
    } catch (...) {
        return 2;
    }
}

struct Pair {
    double first, second;
    Pair& operator+=(const Pair& other) {
        first += other.first;
        second += other.second;
        return *this;
    }
};

// Sums of N things, four terms side by side, for one sum waits for its last term.
template <int N>
struct Side {
    double part[4][N] = {};

    template <class Term>
    void over(int64_t from, int64_t to, const Term& term) {
        double add[N];
        int64_t k = from;
        for (; k + 4 <= to; k += 4) {
            for (int s = 0; s < 4; ++s) {
                term(k + s, add);
                for (int i = 0; i < N; ++i) part[s][i] += add[i];
            }
        }
        for (; k < to; ++k) {
            term(k, add);
            for (int i = 0; i < N; ++i) part[0][i] += add[i];
        }
    }
    double total(int i) const { return (part[0][i] + part[2][i]) + (part[1][i] + part[3][i]); }
};

// Sums of pieces, added up in their order.
template <class Work>
auto ordered_sum(int64_t n, const Work& work) {
    constexpr int64_t chunk = 8192, most = 512;
    using Value = decltype(work(n, n));
    Value parts[most], sum{};
    for (int64_t first = 0; first < n; first += chunk * most) {
        const int64_t last = std::min(n, first + chunk * most), pieces = (last - first + chunk - 1) / chunk;
        share(pieces, [&](int64_t piece) {
            const int64_t from = first + piece * chunk;
            parts[piece] = work(from, std::min(last, from + chunk));
        });
        for (int64_t piece = 0; piece < pieces; ++piece) sum += parts[piece];
    }
    return sum;
}

// Two sums of n terms, which are written side by side.
template <class Term>
int two_sums(int64_t n, double* out, const Term& term) {
    return guarded([&] {
        const Pair found = ordered_sum(n, [&](int64_t from, int64_t to) {
            Side<2> sum;
            sum.over(from, to, term);
            return Pair{sum.total(0), sum.total(1)};
        });
        out[0] = found.first;
        out[1] = found.second;
    });
}

}  // namespace

HEMIVAR_API int hv_abi() { return 11; }

HEMIVAR_API void hv_set_threads(int count) { Pool::set_threads(count); }

HEMIVAR_API void hv_after_fork() { Pool::renew(); }

HEMIVAR_API Levels* hv_levels_new(int64_t count) {
    Levels* made = nullptr;
    guarded([&] { made = new Levels(count); });
    return made;
}

HEMIVAR_API void hv_levels_free(Levels* levels) { delete levels; }

HEMIVAR_API int hv_levels_matrix(Levels* levels, int64_t k, int64_t n, const int32_t* indptr, const int32_t* indices,
                                 const double* data, int d, int64_t nodes, const int32_t* place, const float* signs,
                                 const int32_t* contact, int64_t contacts) {
    return guarded([&] {
        levels->levels[k] =
            std::make_unique<Level>(Csr{n, n, indptr, indices, data}, d, nodes, place, signs, contact, contacts);
    });
}

HEMIVAR_API int hv_levels_transfer(Levels* levels, int64_t k, int64_t rows, int64_t columns, const int32_t* indptr,
                                   const int32_t* indices, const double* data) {
    return guarded([&] {
        levels->transfers[k] = std::make_unique<Transfer>(Csr{rows, columns, indptr, indices, data},
                                                          *levels->levels[k + 1], *levels->levels[k]);
    });
}

HEMIVAR_API Truncation* hv_truncation_new(const Levels* levels) {
    Truncation* made = nullptr;
    guarded([&] { made = new Truncation(*levels); });
    return made;
}

HEMIVAR_API void hv_truncation_free(Truncation* truncation) { delete truncation; }

HEMIVAR_API int64_t hv_contact_entries(const Levels* levels, int64_t k) {
    return static_cast<int64_t>(levels->levels[k]->target.size());
}

HEMIVAR_API int hv_truncation_rows(Truncation* truncation, int64_t k, const uint8_t* held, const double* values) {
    return guarded([&] { truncation->change(k, held, values); });
}

// Another matrix on a level; its scale stays that of the transfers.
HEMIVAR_API int hv_truncation_root(Truncation* truncation, const double* root) {
    return guarded([&] { truncation->set_root(root); });
}

HEMIVAR_API int hv_cycle(const Truncation* truncation, int64_t top, const double* right, double* out) {
    return guarded([&] { truncation->cycle(top, right, out); });
}

// The edges of a mesh, whose cells must stay where they are; how many there are.
HEMIVAR_API int hv_edges_new(int dim, int64_t nodes, int64_t cells, const int64_t* vertices, Edges** made) {
    return guarded([&] { *made = new Edges(Simplices{dim, nodes, cells, vertices}); });
}

HEMIVAR_API void hv_edges_free(Edges* edges) { delete edges; }

HEMIVAR_API int64_t hv_edges_count(const Edges* edges) { return static_cast<int64_t>(edges->other.size()); }

HEMIVAR_API int hv_edges_get(const Edges* edges, int64_t* pairs, int64_t* cell_edges) {
    return guarded([&] { edges->get(pairs, cell_edges); });
}

HEMIVAR_API Graph* hv_graph_new(int64_t nodes, int64_t edges, const int64_t* pairs) {
    Graph* made = nullptr;
    guarded([&] { made = new Graph(nodes, edges, pairs); });
    return made;
}

HEMIVAR_API void hv_graph_free(Graph* graph) { delete graph; }

HEMIVAR_API int hv_graph_add(const Graph* graph, int dim, int64_t nodes, int64_t cells, const int64_t* vertices,
                             const double* points, const double* volumes, int64_t first, int64_t last, int components,
                             int count, int64_t matrices, const int32_t* strains, const double* matrix, double* upper) {
    return guarded([&] {
        graph->add(Simplices{dim, nodes, cells, vertices}, points, volumes, first, last,
                   Law{components, count, strains, matrices, matrix}, upper);
    });
}

HEMIVAR_API int hv_graph_close(const Graph* graph, int components, const double* upper, double* diagonal) {
    return guarded([&] { graph->close(components, upper, diagonal); });
}

// The number of entries; negative if that failed.
HEMIVAR_API int64_t hv_graph_lengths(const Graph* graph, int components, const uint8_t* free, int32_t* indptr) {
    int64_t entries = 0;
    const int failed = guarded([&] { entries = graph->lengths(components, free, indptr); });
    return failed ? -failed : entries;
}

HEMIVAR_API int hv_graph_rows(const Graph* graph, int components, const uint8_t* free, const double* diagonal,
                              const double* upper, const int32_t* indptr, int32_t* indices, double* data) {
    return guarded([&] { graph->rows(components, free, diagonal, upper, indptr, indices, data); });
}

// y = A x of a matrix by rows.
HEMIVAR_API int hv_multiply(int64_t n, const int32_t* indptr, const int32_t* indices, const double* data,
                             const double* x, double* y) {
    constexpr int64_t chunk = 4 * kChunk;
    return guarded([&] {
        share((n + chunk - 1) / chunk, [&](int64_t piece) {
            for (int64_t i = piece * chunk; i < std::min(n, (piece + 1) * chunk); ++i) {
                double sum = 0.0;
                for (int32_t e = indptr[i]; e < indptr[i + 1]; ++e) sum += data[e] * x[indices[e]];
                y[i] = sum;
            }
        });
    });
}

// C += A B of matrices by rows, `rows` of A and C and `columns` of B and C; 2 if C has no place for an entry.
HEMIVAR_API int hv_add_product(int64_t rows, int64_t columns, const int32_t* starts, const int32_t* indices,
                               const double* data, const int32_t* right_starts, const int32_t* right_indices,
                               const double* right_data, const int32_t* out_starts, const int32_t* out_indices,
                               double* out) {
    constexpr int32_t kSide = 5;  // columns of a node stand side by side: three at once, of two nodes or one
    std::atomic<bool> beyond{false};
    const int status = guarded([&] {
        const int64_t chunk = kChunk;
        share((rows + chunk - 1) / chunk, [&](int64_t piece) {
            std::vector<int32_t> place(columns, -1);
            for (int64_t i = piece * chunk; i < std::min(rows, (piece + 1) * chunk); ++i) {
                for (int32_t e = out_starts[i]; e < out_starts[i + 1]; ++e) place[out_indices[e]] = e;
                for (int32_t e = starts[i]; e < starts[i + 1]; ++e) {
                    const double factor = data[e];
                    if (factor == 0.0) continue;
                    const int32_t j = indices[e];
                    const int32_t end = right_starts[j + 1];
                    for (int32_t f = right_starts[j]; f < end;) {
                        const int32_t column = right_indices[f], at = place[column];
                        if (at >= out_starts[i] && f + kSide < end && right_indices[f + kSide] == column + kSide &&
                            place[column + kSide] == at + kSide) {
                            for (int s = 0; s <= kSide; ++s) out[at + s] += factor * right_data[f + s];
                            f += kSide + 1;
                            continue;
                        }
                        if (at >= out_starts[i]) {
                            out[at] += factor * right_data[f];
                        } else if (right_data[f] != 0.0) {
                            beyond = true;
                        }
                        ++f;
                    }
                }
            }
        });
    });
    return status ? status : (beyond.load() ? 2 : 0);
}

// The diagonal of a matrix by rows with sorted columns; 2 if rows do not follow one another up to the number of entries.
HEMIVAR_API int hv_diagonal(int64_t n, int64_t entries, const int32_t* indptr, const int32_t* indices,
                            const double* data, double* out) {
    constexpr int64_t chunk = 4 * kChunk;
    std::atomic<bool> strange{false};
    const auto piece_of_rows = [&](int64_t piece) {
        for (int64_t i = piece * chunk; i < std::min(n, (piece + 1) * chunk); ++i) {
            const int32_t begin = indptr[i], end = indptr[i + 1];
            if (begin < 0 || begin > end || end > entries) {
                strange = true;
                return;
            }
            const int32_t* place = std::lower_bound(indices + begin, indices + end, static_cast<int32_t>(i));
            out[i] = place < indices + end && *place == i ? data[place - indices] : 0.0;
        }
    };
    const int failed = guarded([&] { share((n + chunk - 1) / chunk, piece_of_rows); });
    return strange ? 2 : failed;
}

// x += length p, r -= length q; the square of r.
HEMIVAR_API int hv_advance(int64_t n, double length, const double* p, const double* q, double* x, double* r,
                           double* square) {
    const auto piece = [&](int64_t from, int64_t to) {
        Side<1> sum;
        sum.over(from, to, [&](int64_t k, double* add) {
            x[k] += length * p[k];
            r[k] -= length * q[k];
            add[0] = r[k] * r[k];
        });
        return sum.total(0);
    };
    return guarded([&] { *square = ordered_sum(n, piece); });
}

// p'q and p'Dp.
HEMIVAR_API int hv_curvature(int64_t n, const double* p, const double* q, const double* diagonal, double* out) {
    return two_sums(n, out, [&](int64_t k, double* add) {
        add[0] = p[k] * q[k];
        add[1] = p[k] * p[k] * diagonal[k];
    });
}

// z'r and z'q.
HEMIVAR_API int hv_products(int64_t n, const double* z, const double* r, const double* q, double* out) {
    return two_sums(n, out, [&](int64_t k, double* add) {
        add[0] = z[k] * r[k];
        add[1] = z[k] * q[k];
    });
}

// p = z + factor p.
HEMIVAR_API int hv_turn(int64_t n, double factor, const double* z, double* p) {
    constexpr int64_t chunk = 8192;
    const auto turn = [&](int64_t piece) {
        const int64_t to = std::min(n, (piece + 1) * chunk);
        for (int64_t k = piece * chunk; k < to; ++k) p[k] = z[k] + factor * p[k];
    };
    return guarded([&] { share((n + chunk - 1) / chunk, turn); });
}

HEMIVAR_API Panels* hv_panels_new(int64_t count, const int32_t* starts, const int32_t* rows, const double* entries) {
    Panels* made = nullptr;
    guarded([&] { made = new Panels(count, starts, rows, entries); });
    return made;
}

HEMIVAR_API void hv_panels_free(Panels* panels) { delete panels; }

HEMIVAR_API void hv_panels_forward(const Panels* panels, double* x) { panels->forward(x); }

HEMIVAR_API void hv_panels_backward(const Panels* panels, double* x) { panels->backward(x); }

// tables: stiffness, bounds, anchor, base, slope, knots, low, high, first, last, matrix, weights, compliance,
// coefficient or null.
HEMIVAR_API ActiveSets* hv_active_sets_new(int64_t n, int64_t states, const double* const* tables) {
    ActiveSets* made = nullptr;
    const double* const* t = tables;
    guarded([&] {
        const Tables law{n, states, t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8], t[9], t[13]};
        made = new ActiveSets(law, t[10], t[11], t[12]);
    });
    return made;
}

HEMIVAR_API void hv_active_sets_free(ActiveSets* sets) { delete sets; }

HEMIVAR_API int hv_active_sets_run(ActiveSets* sets, const double* load, double* r, double* lam, double* of_law,
                                   int64_t most, double atol, double rtol, double load_size, double* told) {
    return sets->run(load, r, lam, of_law, most, atol, rtol, load_size, told);
}

HEMIVAR_API double hv_active_sets_distance(ActiveSets* sets, const double* r, const double* lam) {
    return sets->distance(r, lam);
}

HEMIVAR_API void hv_law_value(const PointLaw* law, int64_t m, int64_t d, const double* r, double* out) {
    law->value(m, d, r, out);
}

HEMIVAR_API void hv_law_linearise(const PointLaw* law, int64_t m, int64_t d, const double* r, uint8_t* smooth,
                                  double* gradient, double* hessian) {
    law->linearise(m, d, r, smooth, gradient, hessian);
}

HEMIVAR_API void hv_law_nearest(const PointLaw* law, int64_t m, int64_t d, const double* r, const double* lam,
                                double* out) {
    law->nearest(m, d, r, lam, out);
}

HEMIVAR_API void hv_law_clamp(const PointLaw* law, int64_t m, int64_t d, const double* start, const double* end,
                              double* out) {
    law->clamp(m, d, start, end, out);
}

HEMIVAR_API void hv_law_distance(const PointLaw* law, int64_t m, int64_t d, const double* r, const double* lam,
                                 const double* tau, double* out) {
    law->distance(m, d, r, lam, tau, out);
}

// 0 where every point has its minimiser, 1 where others must look.
HEMIVAR_API int hv_law_minimise(const PointLaw* law, int64_t m, int64_t d, const double* a, const double* b,
                                double* out) {
    return law->minimise(m, d, a, b, out) ? 0 : 1;
}

// The number of colours of patches; -1 if these are too many, -2 if there is no memory.
HEMIVAR_API int64_t hv_patch_order(int64_t cells, int64_t seen_of_cell, const int64_t* patches, int64_t count,
                                   const int64_t* ranked, int64_t* start, int64_t* seen, int64_t* order,
                                   int64_t* bounds) {
    int64_t colours = -2;
    guarded([&] {
        colours = colour_patches(cells, seen_of_cell, patches, count, ranked, start, seen, order, bounds);
    });
    return colours;
}

HEMIVAR_API int hv_improve_patches(const PatchBody* body, const PatchSweep* sweep) {
    return guarded([&] { improve_patches(*body, *sweep); });
}

HEMIVAR_API int hv_pull_back(int64_t dim, int64_t cells, int64_t count, const double* matrices, const double* points,
                             const int64_t* vertices, const double* sizes, double* out) {
    return guarded([&] { pull_back(dim, cells, count, matrices, points, vertices, sizes, out); });
}

HEMIVAR_API int hv_strains(int64_t dim, int64_t cells, int64_t count, const double* displacement,
                           const int64_t* vertices, const double* gradients, const double* sizes,
                           const double* matrices, double* stresses, double* forces) {
    return guarded([&] {
        strain_cells(dim, cells, count, displacement, vertices, gradients, sizes, matrices, stresses, forces);
    });
}

HEMIVAR_API int hv_cells(const CellElement* element, const CellStresses* body) {
    return guarded([&] { add_up_cells(*element, *body); });
}

HEMIVAR_API int hv_unresolved(const CellBubbles* body, double* square) {
    return guarded([&] { *square = unresolved_square(*body); });
}

HEMIVAR_API int hv_facets_new(int dim, int64_t nodes, int64_t cells, const int64_t* placed, const uint8_t* second,
                              Facets** made) {
    return guarded([&] { *made = new Facets(dim, nodes, cells, placed, second); });
}

HEMIVAR_API void hv_facets_free(Facets* facets) { delete facets; }

HEMIVAR_API int64_t hv_facets_count(const Facets* facets) { return facets->count; }

HEMIVAR_API int hv_facets_get(const Facets* facets, const int64_t* vertices, int64_t* numbers, double* signs,
                              int64_t* owners, int64_t* nodes, int64_t* others) {
    return guarded([&] { facets->get(vertices, numbers, signs, owners, nodes, others); });
}

HEMIVAR_API int hv_measure_simplices(int dim, int64_t cells, const double* points, const int64_t* vertices,
                                     const int64_t* numbers, const double* signs, double* jacobian, double* gradients,
                                     double* normals, double* measures) {
    return guarded([&] {
        measure_simplices(dim, cells, points, vertices, numbers, signs, jacobian, gradients, normals, measures);
    });
}

HEMIVAR_API int hv_number_alike(int64_t rows, int64_t width, const double* values, int64_t more, const double* others,
                                double tolerance, int64_t* out) {
    return guarded([&] {
        std::vector<Block> blocks{{width, values}};
        if (others != nullptr) blocks.push_back({more, others});
        number_alike(rows, blocks, tolerance, out);
    });
}

HEMIVAR_API int hv_stars(int corners, int64_t nodes, int64_t cells, const int64_t* vertices, int64_t* start,
                         int64_t* pairs, int32_t* place) {
    return guarded([&] { list_stars(corners, nodes, cells, vertices, start, pairs, place); });
}

HEMIVAR_API int hv_settle_stars(const StarBody* body, double* moments, double* defect, double* missed,
                                int64_t* pinched) {
    return guarded([&] { *pinched = settle_stars(*body, moments, defect, missed); });
}

HEMIVAR_API int hv_share_on_contact(const StarBody* body, int64_t count, const int64_t* vertices, double* moments) {
    return guarded([&] { share_on_contact(*body, count, vertices, moments); });
}

// On Windows an extension must have one; nobody imports it.
HEMIVAR_API void* PyInit__compiled() { return nullptr; }
