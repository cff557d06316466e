#include "cells.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "pool.hpp"
#include "wide.hpp"

namespace hemivar {

namespace {

constexpr int64_t kPiece = 512;  // cells of a piece of work
constexpr int kMost = 6;         // components of a stress; numbers of what has no tractions are fewer

// The entries of a matrix that are not zero, row after row.
struct Rows {
    int64_t rows;
    std::vector<int32_t> start, column;
    std::vector<double> entry;

    Rows(int64_t rows, int64_t columns, const double* from, bool turned = false) : rows(rows), start(1, 0) {
        for (int64_t i = 0; i < rows; ++i) {
            for (int64_t j = 0; j < columns; ++j) {
                const double one = turned ? from[j * rows + i] : from[i * columns + j];
                if (one == 0.0) continue;
                column.push_back(static_cast<int32_t>(j));
                entry.push_back(one);
            }
            start.push_back(static_cast<int32_t>(column.size()));
        }
    }

    HEMIVAR_INLINE void times(const Doubles* x, Doubles* out, int64_t first, int64_t last) const {
        for (int64_t i = first; i < last; ++i) {
            Doubles sum = {};
            for (int32_t e = start[i]; e < start[i + 1]; ++e) {
                row_by_row();
                sum.add(entry[e], x[column[e]]);
            }
            out[i] = sum;
        }
    }
};

struct Tables {
    const CellElement& e;
    const int64_t d, v, upper, corners, block, moments, given, points;
    const Rows values, tested, loading, slopes;

    explicit Tables(const CellElement& e)
        : e(e), d(e.dim), v(d * (d + 1) / 2), upper(v * (v + 1) / 2), corners(d + 1), block(e.nodes * d),
          moments(corners * block), given(moments + corners * d), points(corners * e.piece_nodes),
          values(points * v, e.degrees, e.values), tested(e.degrees, points * v, e.values, true),
          loading(e.degrees, given, e.loading), slopes(moments + e.inner, e.degrees, e.ways, true) {}

    int64_t numbers() const { return given + 2 * e.degrees + 2 * points * v + moments + e.inner + v * v; }
};

// Eight cells, side by side.
struct Work {
    Doubles *given, *degrees, *tested, *stress, *strain, *slopes, *matrix;
    Work(const Tables& t, Doubles* at) {
        given = at;
        degrees = given + t.given;
        tested = degrees + t.e.degrees;
        stress = tested + t.e.degrees;
        strain = stress + t.points * t.v;
        slopes = strain + t.points * t.v;
        matrix = slopes + t.moments + t.e.inner;
    }
};

template <int V>
HEMIVAR_INLINE void fill(const Tables& t, const CellStresses& b, int64_t first, int64_t count, const Work& w) {
    const int64_t d = t.d;
    for (int64_t lane = 0; lane < kEight; ++lane) {
        const int64_t cell = first + std::min(lane, count - 1);
        const double* inverse = b.gradients + cell * t.corners * d + d;
        double from[3], turned;
        const auto put = [&](Doubles* to) {
            for (int64_t r = 0; r < d; ++r) {
                turned = 0.0;
                for (int64_t k = 0; k < d; ++k) turned += inverse[r * d + k] * from[k];
                to[r][lane] = turned;
            }
        };
        for (int64_t f = 0; f < t.corners; ++f) {
            const double sign = b.signs[cell * t.corners + f];
            const double* moments = b.moments + b.cell_facets[cell * t.corners + f] * t.block;
            const double* own = b.own + (cell * t.corners + f) * b.own_nodes * d;
            for (int64_t a = 0; a < t.e.nodes; ++a) {
                const int64_t at = b.own_nodes == 1 ? 0 : a * d;
                for (int64_t k = 0; k < d; ++k) from[k] = sign * moments[a * d + k] - b.sense * own[at + k];
                put(w.given + f * t.block + a * d);
            }
            const int64_t load = (cell * t.corners + f) * d;
            for (int64_t k = 0; k < d; ++k) from[k] = b.loads[load + k] + (b.defect ? b.defect[load + k] : 0.0);
            put(w.given + t.moments + f * d);
        }
        const double* compliance = b.compliance + b.alike[cell] * t.upper;
        for (int p = 0; p < V; ++p) {
            for (int q = p; q < V; ++q) w.matrix[p * V + q][lane] = w.matrix[q * V + p][lane] = *compliance++;
        }
    }
}

// Stresses and strains at the nodes of the pieces, the latter integrated with the functions of the nodes.
template <int V>
HEMIVAR_INLINE void bend(const Tables& t, const Work& w) {
    const int64_t l = t.e.piece_nodes;
    t.values.times(w.degrees, w.stress, 0, t.values.rows);
    for (int64_t piece = 0; piece < t.corners; ++piece) {
        const Doubles* stress = w.stress + piece * l * V;
        Doubles* strain = w.strain + piece * l * V;
        for (int64_t a = 0; a < l; ++a) {
            Doubles mean[V] = {};
            for (int64_t c = 0; c < l; ++c) {
                const double part = t.e.mass[a * l + c];
                for (int q = 0; q < V; ++q) mean[q].add(part, stress[c * V + q]);
            }
            for (int p = 0; p < V; ++p) {
                Doubles sum = w.matrix[p * V] * mean[0];
                for (int q = 1; q < V; ++q) sum.add(w.matrix[p * V + q], mean[q]);
                strain[a * V + p] = sum;
            }
        }
    }
}

// Take off what has no tractions and lowers the energy.
template <int V>
HEMIVAR_INLINE void settle(const Tables& t, const Work& w) {
    const int64_t n = t.e.inner;
    bend<V>(t, w);
    t.tested.times(w.strain, w.tested, 0, t.tested.rows);
    t.slopes.times(w.tested, w.slopes, t.moments, t.moments + n);
    Doubles A[kMost][kMost], x[kMost];
    for (int64_t i = 0; i < n; ++i) {
        x[i] = w.slopes[t.moments + i];
        for (int64_t j = 0; j < n; ++j) {
            A[i][j] = Doubles{};
            const double* energy = t.e.energies + i * n + j;
            for (int p = 0; p < V; ++p) {
                for (int q = p; q < V; ++q, energy += n * n) A[i][j] += *energy * w.matrix[p * V + q];
            }
        }
    }
    for (int64_t k = 0; k < n; ++k) {
        for (int64_t i = k + 1; i < n; ++i) {
            const Doubles factor = A[i][k] / A[k][k];
            for (int64_t j = k; j < n; ++j) A[i][j] -= factor * A[k][j];
            x[i] -= factor * x[k];
        }
    }
    for (int64_t k = n - 1; k >= 0; --k) {
        for (int64_t j = k + 1; j < n; ++j) x[k] -= A[k][j] * x[j];
        x[k] /= A[k][k];
    }
    for (int64_t r = 0; r < t.e.degrees; ++r) {
        const double* way = t.e.ways + r * (t.moments + n) + t.moments;
        for (int64_t i = 0; i < n; ++i) w.degrees[r] -= way[i] * x[i];
    }
}

// The moments of the next cells, which stand apart.
HEMIVAR_INLINE void fetch_moments(const Tables& t, const CellStresses& b, int64_t first, int64_t last) {
    for (int64_t k = first * t.corners; k < last * t.corners; ++k) fetch(b.moments + b.cell_facets[k] * t.block, t.block);
}

template <int V>
HEMIVAR_INLINE void add_up(const Tables& t, const CellStresses& b, int64_t piece) {
    std::vector<double> room((t.numbers() + 1) * kEight);
    const uintptr_t start = reinterpret_cast<uintptr_t>(room.data());
    const Work w(t, reinterpret_cast<Doubles*>((start + sizeof(Doubles) - 1) / sizeof(Doubles) * sizeof(Doubles)));
    const int64_t end = std::min(b.cells, (piece + 1) * kPiece);
    for (int64_t first = piece * kPiece; first < end; first += kEight) {
        const int64_t count = std::min(kEight, end - first);
        fetch_moments(t, b, first + kEight, std::min(end, first + 2 * kEight));
        fill<V>(t, b, first, count, w);
        t.loading.times(w.given, w.degrees, 0, t.loading.rows);
        if (t.e.inner) settle<V>(t, w);
        bend<V>(t, w);
        Doubles energy = {};
        for (int64_t k = 0; k < t.points * V; ++k) energy.add(w.stress[k], w.strain[k]);
        for (int64_t lane = 0; lane < count; ++lane) b.energies[first + lane] = energy[lane];
        if (!b.slopes) continue;
        t.tested.times(w.strain, w.tested, 0, t.tested.rows);
        t.slopes.times(w.tested, w.slopes, 0, t.moments);
        for (int64_t lane = 0; lane < count; ++lane) {
            double* to = b.slopes + (first + lane) * t.moments;
            for (int64_t k = 0; k < t.moments; ++k) to[k] = w.slopes[k][lane];
        }
    }
}

void add_up_any(const Tables& t, const CellStresses& b, int64_t piece) {
    t.v == 3 ? add_up<3>(t, b, piece) : add_up<6>(t, b, piece);
}

HEMIVAR_WIDE void add_up_wide(const Tables& t, const CellStresses& b, int64_t piece) {
    t.v == 3 ? add_up<3>(t, b, piece) : add_up<6>(t, b, piece);
}

template <int D>
void pull_back_one(const double* matrix, const double (&B)[D][D], double size, double* out) {
    constexpr int V = D * (D + 1) / 2;
    constexpr int pairs[2][6][2] = {{{0, 0}, {1, 1}, {0, 1}}, {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};
    double P[V][V], product[V][V];
    const double root = std::sqrt(size);
    for (int r = 0; r < V; ++r) {
        const int i = pairs[D - 2][r][0], j = pairs[D - 2][r][1];
        for (int c = 0; c < V; ++c) {
            const int k = pairs[D - 2][c][0], m = pairs[D - 2][c][1];
            P[r][c] = (B[i][k] * B[j][m] + (k != m ? B[i][m] * B[j][k] : 0.0)) / root;
        }
    }
    for (int p = 0; p < V; ++p) {
        for (int c = 0; c < V; ++c) product[p][c] = 0.0;
        for (int q = 0; q < V; ++q) {
            for (int c = 0; c < V; ++c) product[p][c] += matrix[p * V + q] * P[q][c];
        }
    }
    for (int p = 0; p < V; ++p) {
        for (int q = p; q < V; ++q, ++out) {
            *out = 0.0;
            for (int r = 0; r < V; ++r) *out += P[r][p] * product[r][q];
        }
    }
}

template <int D>
void pull_back_all(int64_t cells, int64_t count, const double* matrices, const double* points,
                   const int64_t* vertices, const double* sizes, double* out) {
    constexpr int64_t V = D * (D + 1) / 2, upper = V * (V + 1) / 2;
    share((cells + kPiece - 1) / kPiece, [&](int64_t piece) {
        for (int64_t cell = piece * kPiece; cell < std::min(cells, (piece + 1) * kPiece); ++cell) {
            const int64_t* at = vertices + cell * (D + 1);
            double B[D][D];
            for (int i = 0; i < D; ++i) {
                for (int k = 0; k < D; ++k) B[i][k] = points[at[k + 1] * D + i] - points[at[0] * D + i];
            }
            pull_back_one<D>(matrices + (count == 1 ? 0 : cell * V * V), B, sizes[cell], out + cell * upper);
        }
    });
}

template <int D>
struct Bubble {
    static constexpr int kPairs = D * (D + 1) / 2;
    double right[D] = {}, matrix[kPairs] = {};  // the latter by rows, above the diagonal
    bool inside = true;

    // r'K^-1 r; nothing where K is not definite.
    double square() const {
        double A[D][D], x[D], sum = 0.0;
        for (int i = 0, at = 0; i < D; ++i) {
            x[i] = right[i];
            for (int k = i; k < D; ++k) A[i][k] = A[k][i] = matrix[at++];
        }
        for (int k = 0; k < D; ++k) {
            if (!(A[k][k] > 0.0)) return 0.0;
            sum += x[k] * x[k] / A[k][k];
            for (int i = k + 1; i < D; ++i) {
                const double factor = A[i][k] / A[k][k];
                x[i] -= factor * x[k];
                for (int j = k + 1; j < D; ++j) A[i][j] -= factor * A[k][j];
            }
        }
        return sum;
    }
};

// Where the component ij of a tensor stands in a vector.
template <int D>
constexpr int kPlace[3][3] = {{0, D == 2 ? 2 : 5, 4}, {D == 2 ? 2 : 5, 1, 3}, {4, 3, 2}};

template <int D>
void strain_one(const double* displacement, const int64_t* vertices, const double* gradient, double volume,
                const double* matrix, double* stress, double* force) {
    constexpr int V = D * (D + 1) / 2;
    double slope[D][D] = {}, vector[V];
    for (int a = 0; a <= D; ++a) {
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) slope[i][j] += displacement[vertices[a] * D + i] * gradient[a * D + j];
        }
    }
    for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
            vector[kPlace<D>[i][j]] = i == j ? slope[i][i] : slope[i][j] + slope[j][i];
        }
    }
    for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
            const double* row = matrix + kPlace<D>[i][j] * V;
            double sum = 0.0;
            for (int p = 0; p < V; ++p) sum += row[p] * vector[p];
            stress[i * D + j] = sum;
        }
    }
    for (int a = 0; a <= D; ++a) {
        for (int i = 0; i < D; ++i) {
            double sum = 0.0;
            for (int j = 0; j < D; ++j) sum += gradient[a * D + j] * stress[i * D + j];
            force[a * D + i] = volume * sum;
        }
    }
}

// K_ik = sum of C_ij,kl G_jl of the numbers G_jl above the diagonal.
template <int D>
void weigh(const double* stiffness, const double* products, double* out) {
    constexpr int V = D * (D + 1) / 2;
    double G[D][D];
    for (int i = 0, at = 0; i < D; ++i) {
        for (int k = i; k < D; ++k) G[i][k] = G[k][i] = products[at++];
    }
    for (int i = 0, at = 0; i < D; ++i) {
        for (int k = i; k < D; ++k, ++at) {
            out[at] = 0.0;
            for (int j = 0; j < D; ++j) {
                for (int l = 0; l < D; ++l) out[at] += stiffness[kPlace<D>[i][j] * V + kPlace<D>[k][l]] * G[j][l];
            }
        }
    }
}

template <int D>
double bubbles(const CellBubbles& b) {
    constexpr int edges = D == 2 ? 3 : 6, pairs = D * (D + 1) / 2;
    std::vector<Bubble<D>> of(b.edges);
    for (int64_t cell = 0; cell < b.cells; ++cell) {
        const double* gradient = b.gradients + cell * (D + 1) * D;
        const double* stress = b.stress + cell * D * D;
        const double volume = b.sizes[cell] / (D == 2 ? 2.0 : 6.0), size = volume / ((D + 1) * (D + 2));
        double load[D] = {};
        for (int k = 0; k < (D + 1) * D; ++k) load[k % D] += b.loads[cell * (D + 1) * D + k] / ((D + 1) * (D + 2));
        for (int e = 0; e < edges; ++e) {
            Bubble<D>& bubble = of[b.cell_edges[cell * edges + e]];
            const double *one = gradient + b.ends[2 * e] * D, *two = gradient + b.ends[2 * e + 1] * D;
            double both[D], products[pairs], own[pairs];
            for (int i = 0; i < D; ++i) both[i] = one[i] + two[i];
            for (int i = 0, at = 0; i < D; ++i) {
                bubble.right[i] += load[i];
                for (int j = 0; j < D; ++j) bubble.right[i] -= volume / (D + 1) * stress[i * D + j] * both[j];
                for (int k = i; k < D; ++k) {
                    products[at++] = size * (one[i] * one[k] + two[i] * two[k] + both[i] * both[k]);
                }
            }
            const double* added = products;
            if (b.matrices > 1) {
                weigh<D>(b.stiffness + cell * pairs * pairs, products, own);
                added = own;
            }
            for (int k = 0; k < pairs; ++k) bubble.matrix[k] += added[k];
        }
        for (int f = 0; f <= D; ++f) {
            if (b.interior[b.cell_facets[cell * (D + 1) + f]]) continue;
            for (int e = 0; e < edges; ++e) {
                if (b.ends[2 * e] != f && b.ends[2 * e + 1] != f) of[b.cell_edges[cell * edges + e]].inside = false;
            }
        }
    }
    double sum = 0.0;
    for (Bubble<D>& bubble : of) {
        if (!bubble.inside) continue;
        if (b.matrices == 1) {
            double own[pairs];
            weigh<D>(b.stiffness, bubble.matrix, own);
            std::copy_n(own, pairs, bubble.matrix);
        }
        sum += bubble.square();
    }
    return sum;
}

}  // namespace

void pull_back(int64_t dim, int64_t cells, int64_t count, const double* matrices, const double* points,
               const int64_t* vertices, const double* sizes, double* out) {
    (dim == 2 ? pull_back_all<2> : pull_back_all<3>)(cells, count, matrices, points, vertices, sizes, out);
}

void strain_cells(int64_t dim, int64_t cells, int64_t count, const double* displacement, const int64_t* vertices,
                  const double* gradients, const double* sizes, const double* matrices, double* stresses,
                  double* forces) {
    const auto one = dim == 2 ? strain_one<2> : strain_one<3>;
    const int64_t v = dim * (dim + 1) / 2, square = dim * dim, corners = dim + 1;
    share((cells + kPiece - 1) / kPiece, [&](int64_t piece) {
        for (int64_t cell = piece * kPiece; cell < std::min(cells, (piece + 1) * kPiece); ++cell) {
            one(displacement, vertices + cell * corners, gradients + cell * corners * dim,
                sizes[cell] / (dim == 2 ? 2.0 : 6.0), matrices + (count == 1 ? 0 : cell * v * v),
                stresses + cell * square, forces + cell * corners * dim);
        }
    });
}

double unresolved_square(const CellBubbles& body) { return body.dim == 2 ? bubbles<2>(body) : bubbles<3>(body); }

void add_up_cells(const CellElement& element, const CellStresses& body) {
    const Tables tables(element);
    const auto piece = wide_registers() ? add_up_wide : add_up_any;
    share((body.cells + kPiece - 1) / kPiece, [&](int64_t at) { piece(tables, body, at); });
}

}  // namespace hemivar
