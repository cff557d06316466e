#include "stars.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "pool.hpp"

namespace hemivar {

namespace {

constexpr int64_t kPiece = 512;      // vertices of a piece of work
constexpr double kFree = 1e-10;      // part of the largest projection below which no facet takes up a force
constexpr double kApart = 1e-4;      // least ease of a facet at a vertex over the largest one there
constexpr int kMiddle[3] = {4, 5, 3};  // local node in the middle of each facet of a triangle

// Numbers that do not fit together are told from a lack of memory, whoever comes upon them.
template <class Work>
void by_pieces(int64_t count, const Work& work) {
    std::atomic<bool> strange{false};
    share((count + kPiece - 1) / kPiece, [&](int64_t piece) {
        try {
            work(piece * kPiece, std::min(count, (piece + 1) * kPiece));
        } catch (const std::logic_error&) {
            strange = true;
        }
    });
    if (strange) throw std::out_of_range("numbers of a mesh");
}

// The places of the nodes of a facet but for the least one, in one number.
template <int D>
uint64_t key_of(const int64_t* placed, int64_t entry) {
    const int64_t* mine = placed + entry / (D + 1) * (D + 1);
    const int skipped = static_cast<int>(entry % (D + 1));
    uint64_t key = 0;
    for (int a = 1; a < D; ++a) key = key << 32 | static_cast<uint64_t>(mine[a + (a >= skipped)]);
    return key;
}

template <int D>
void sort_facets(Facets& found, int64_t nodes, const int64_t* placed, const uint8_t* second) {
    Array<int64_t>&start = found.start, &first = found.first, &entry = found.entry;
    const int64_t entries = found.cells * (D + 1);
    start.assign(nodes + 1, 0);
    for (int64_t cell = 0; cell < found.cells; ++cell) {
        const int64_t* mine = placed + cell * (D + 1);
        for (int k = 0; k <= D; ++k) {
            if (mine[k] < 0 || mine[k] >= nodes) throw std::out_of_range("place");
            if (k > 0 && mine[k] <= mine[k - 1]) throw std::out_of_range("places do not rise");
        }
        ++start[mine[1] + 1];  // that opposite to the least one
        start[mine[0] + 1] += D;
    }
    for (int64_t i = 0; i < nodes; ++i) start[i + 1] += start[i];
    entry.resize(entries);
    for (int64_t cell = 0; cell < found.cells; ++cell) {
        const int64_t* mine = placed + cell * (D + 1);
        for (int k = 0; k <= D; ++k) entry[start[mine[k == 0]]++] = cell * (D + 1) + k;
    }
    std::copy_backward(start.begin(), start.end() - 1, start.end());
    start[0] = 0;
    first.assign(nodes + 1, 0);
    by_pieces(nodes, [&](int64_t from, int64_t to) {
        std::vector<std::pair<uint64_t, int64_t>> near;  // with the order of the cells of one facet
        for (int64_t i = from; i < to; ++i) {
            near.clear();
            for (int64_t at = start[i]; at < start[i + 1]; ++at) {
                const int64_t one = entry[at];
                near.push_back({key_of<D>(placed, one), second && second[one] ? entries + one : one});
            }
            std::sort(near.begin(), near.end());
            for (size_t k = 0; k < near.size(); ++k) {
                const bool fresh = k == 0 || near[k].first != near[k - 1].first;
                first[i + 1] += fresh;
                entry[start[i] + k] = (near[k].second < entries ? near[k].second : near[k].second - entries) * 2 + fresh;
            }
        }
    });
    for (int64_t i = 0; i < nodes; ++i) first[i + 1] += first[i];
    found.count = first[nodes];
}

template <int D>
void list_facets(const Facets& found, const int64_t* vertices, int64_t* numbers, double* signs, int64_t* owners,
                 int64_t* nodes, int64_t* others) {
    by_pieces(static_cast<int64_t>(found.start.size()) - 1, [&](int64_t from, int64_t to) {
        for (int64_t i = from; i < to; ++i) {
            int64_t facet = found.first[i] - 1;
            for (int64_t at = found.start[i]; at < found.start[i + 1]; ++at) {
                const int64_t one = found.entry[at] / 2, cell = one / (D + 1), skipped = one % (D + 1);
                const bool fresh = found.entry[at] % 2;
                facet += fresh;
                numbers[one] = facet;
                signs[one] = fresh ? 1.0 : -1.0;
                owners[2 * facet + (fresh ? 0 : 1)] = cell;
                if (fresh) owners[2 * facet + 1] = -1;
                for (int a = 0; a < D; ++a) {
                    const int64_t node = vertices[cell * (D + 1) + a + (a >= skipped)];
                    if (fresh) nodes[facet * D + a] = node;
                    others[facet * D + a] = node;
                }
            }
        }
    });
}

}  // namespace

Facets::Facets(int dim, int64_t nodes, int64_t cells, const int64_t* placed, const uint8_t* second)
    : dim(dim), cells(cells) {
    if (nodes < 0 || nodes > int64_t{1} << 32) throw std::length_error("too many for 32 bits");
    dim == 2 ? sort_facets<2>(*this, nodes, placed, second) : sort_facets<3>(*this, nodes, placed, second);
}

void Facets::get(const int64_t* vertices, int64_t* numbers, double* signs, int64_t* owners, int64_t* nodes,
                 int64_t* others) const {
    dim == 2 ? list_facets<2>(*this, vertices, numbers, signs, owners, nodes, others)
             : list_facets<3>(*this, vertices, numbers, signs, owners, nodes, others);
}

namespace {

// The rows of the inverse of a matrix, which are gradients; returns its determinant.
double invert(const double (&B)[2][2], double (*inverse)[2]) {
    const double size = B[0][0] * B[1][1] - B[0][1] * B[1][0];
    inverse[0][0] = B[1][1] / size;
    inverse[0][1] = -B[0][1] / size;
    inverse[1][0] = -B[1][0] / size;
    inverse[1][1] = B[0][0] / size;
    return size;
}

double invert(const double (&B)[3][3], double (*inverse)[3]) {
    for (int i = 0; i < 3; ++i) {  // cross products of columns
        const int p = (i + 1) % 3, q = (i + 2) % 3;
        for (int j = 0; j < 3; ++j) {
            const int r = (j + 1) % 3, s = (j + 2) % 3;
            inverse[i][j] = B[r][p] * B[s][q] - B[s][p] * B[r][q];
        }
    }
    const double size = B[0][0] * inverse[0][0] + B[1][0] * inverse[0][1] + B[2][0] * inverse[0][2];
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) inverse[i][j] /= size;
    }
    return size;
}

template <int D>
void measure(int64_t cell, const double* points, const int64_t* vertices, const int64_t* numbers, const double* signs,
             double* jacobian, double* gradients, double* normals, double* measures) {
    const int64_t* mine = vertices + cell * (D + 1);
    double B[D][D], (*slope)[D] = reinterpret_cast<double (*)[D]>(gradients + cell * (D + 1) * D);
    for (int i = 0; i < D; ++i) {
        for (int k = 0; k < D; ++k) B[i][k] = points[mine[k + 1] * D + i] - points[mine[0] * D + i];
    }
    std::copy(&B[0][0], &B[0][0] + D * D, jacobian + cell * D * D);
    const double size = std::abs(invert(B, slope + 1)) / (D == 2 ? 1.0 : 2.0);  // dim times the volume
    for (int i = 0; i < D; ++i) {
        slope[0][i] = 0.0;
        for (int k = 1; k <= D; ++k) slope[0][i] -= slope[k][i];
    }
    for (int side = 0; side <= D; ++side) {
        const int64_t at = cell * (D + 1) + side, facet = numbers[at];
        if (signs[at] < 0.0) continue;
        double square = 0.0;
        for (int i = 0; i < D; ++i) {
            const double normal = -size * slope[side][i];
            normals[facet * D + i] = normal;
            square += normal * normal;
        }
        measures[facet] = std::sqrt(square);
    }
}

}  // namespace

void measure_simplices(int dim, int64_t cells, const double* points, const int64_t* vertices, const int64_t* numbers,
                       const double* signs, double* jacobian, double* gradients, double* normals, double* measures) {
    by_pieces(cells, [&](int64_t from, int64_t to) {
        for (int64_t cell = from; cell < to; ++cell) {
            (dim == 2 ? measure<2> : measure<3>)(cell, points, vertices, numbers, signs, jacobian, gradients, normals,
                                                 measures);
        }
    });
}

void list_stars(int corners, int64_t nodes, int64_t cells, const int64_t* vertices, int64_t* start, int64_t* pairs,
                int32_t* place) {
    const int64_t count = cells * corners;
    std::fill(start, start + nodes + 1, 0);
    for (int64_t k = 0; k < count; ++k) {
        if (vertices[k] < 0 || vertices[k] >= nodes) throw std::out_of_range("node");
        place[k] = static_cast<int32_t>(start[vertices[k] + 1]++);
    }
    for (int64_t i = 0; i < nodes; ++i) {
        if (start[i + 1] > std::numeric_limits<int32_t>::max()) throw std::length_error("too many for 32 bits");
        start[i + 1] += start[i];
    }
    for (int64_t k = 0; k < count; ++k) pairs[start[vertices[k]] + place[k]] = k;
}

namespace {

// Vectors v with A v = 0, but for rounding, of a symmetric matrix: their projection.
template <int D>
void null_space(double (&A)[D][D], double (&out)[D][D]) {
    double V[D][D] = {};
    for (int i = 0; i < D; ++i) V[i][i] = 1.0;
    for (int turn = 0; turn < 30; ++turn) {  // rotations of Jacobi
        double off = 0.0, size = 0.0;
        for (int p = 0; p < D; ++p) {
            for (int q = 0; q < D; ++q) (p == q ? size : off) += A[p][q] * A[p][q];
        }
        if (!(off > 1e-34 * size)) break;
        for (int p = 0; p < D; ++p) {
            for (int q = p + 1; q < D; ++q) {
                if (A[p][q] == 0.0) continue;
                const double theta = (A[q][q] - A[p][p]) / (2.0 * A[p][q]);
                const double t = (theta >= 0.0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
                const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
                for (int k = 0; k < D; ++k) {
                    const double one = A[k][p], two = A[k][q];
                    A[k][p] = c * one - s * two;
                    A[k][q] = s * one + c * two;
                }
                for (int k = 0; k < D; ++k) {
                    const double one = A[p][k], two = A[q][k];
                    A[p][k] = c * one - s * two;
                    A[q][k] = s * one + c * two;
                }
                for (int k = 0; k < D; ++k) {
                    const double one = V[k][p], two = V[k][q];
                    V[k][p] = c * one - s * two;
                    V[k][q] = s * one + c * two;
                }
            }
        }
    }
    for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
            out[i][j] = 0.0;
            for (int n = 0; n < D; ++n) out[i][j] += A[n][n] < kFree * D ? V[i][n] * V[j][n] : 0.0;
        }
    }
}

// Solves with symmetric matrices, of which the rows below the diagonal are stored from their first entry on.
struct Skyline {
    std::vector<int64_t> at;  // entry 0 of a row, were it there
    std::vector<int> low;     // first entry of each row
    std::vector<double> entry, inverse;  // the latter of the diagonal

    // `low` has been set.
    void lay_out() {
        at.resize(low.size());
        int64_t total = 0;
        for (size_t i = 0; i < low.size(); ++i) {
            at[i] = total - low[i];
            total += static_cast<int64_t>(i) - low[i] + 1;
        }
        entry.assign(total, 0.0);
    }
    double& operator()(int i, int j) { return entry[at[i] + j]; }

    // L D L' in its place.
    void factor() {
        inverse.resize(low.size());
        for (int i = 0; i < static_cast<int>(low.size()); ++i) {
            double* row = entry.data() + at[i];
            for (int j = low[i]; j < i; ++j) {
                const double* other = entry.data() + at[j];
                double sum = row[j];
                for (int k = std::max(low[i], low[j]); k < j; ++k) sum -= row[k] * other[k];
                row[j] = sum;
            }
            for (int j = low[i]; j < i; ++j) {
                const double scaled = row[j] * inverse[j];
                row[i] -= scaled * row[j];
                row[j] = scaled;
            }
            inverse[i] = 1.0 / row[i];
        }
    }

    // N right-hand sides, side by side.
    template <int N>
    void solve(double* x) const {
        const int size = static_cast<int>(low.size());
        for (int i = 0; i < size; ++i) {
            for (int k = low[i]; k < i; ++k) {
                for (int c = 0; c < N; ++c) x[i * N + c] -= entry[at[i] + k] * x[k * N + c];
            }
        }
        for (int i = 0; i < size; ++i) {
            for (int c = 0; c < N; ++c) x[i * N + c] *= inverse[i];
        }
        for (int i = size - 1; i >= 0; --i) {
            for (int k = low[i]; k < i; ++k) {
                for (int c = 0; c < N; ++c) x[k * N + c] -= entry[at[i] + k] * x[i * N + c];
            }
        }
    }
};

template <int D>
struct Sheet {  // a facet at a vertex
    int64_t facet;
    int node;        // of the facet
    int one, two;    // cells around the vertex, the first and the second; -1 for none
    bool unknown;    // whether a boundary facet takes up a force
    double ease, m[D];
};

template <int D>
class Star {
public:
    explicit Star(const StarBody& body) : body(body) {}

    // Moments of the facets at a vertex, and what its cells lack; then what nobody takes up is shared.
    void gather(int64_t vertex) {
        const int64_t* pairs = body.pairs + body.start[vertex];
        n = static_cast<int>(body.start[vertex + 1] - body.start[vertex]);
        pair.assign(pairs, pairs + n);
        lack.resize(n * D);
        sheets.clear();
        for (int c = 0; c < n; ++c) {
            const int64_t cell = pairs[c] / (D + 1), corner = pairs[c] % (D + 1);
            const int64_t at = (cell * body.of_cell + corner) * D;
            for (int i = 0; i < D; ++i) lack[c * D + i] = body.forces[at + i] - body.loads[at + i];
            for (int side = 0; side <= D; ++side) {
                if (side != corner) add(c, cell, side, static_cast<int>(corner) - (corner > side));
            }
        }
        double largest = 0.0;
        for (const Sheet<D>& sheet : sheets) {
            if (sheet.one >= 0) largest = std::max(largest, sheet.ease);
        }
        held = false;
        for (Sheet<D>& sheet : sheets) {
            sheet.ease = std::max(sheet.ease / largest, kApart);
            held |= sheet.unknown;
            for (int i = 0; i < D; ++i) {
                if (sheet.one >= 0) lack[sheet.one * D + i] -= sheet.m[i];
                if (sheet.two >= 0) lack[sheet.two * D + i] += sheet.m[i];
            }
        }
        find_free();
        balance();
    }

    // What was added to the loads of the cells, and what of it is missed.
    void write_defect(int64_t vertex, double* defect, double* missed) const {
        double lost[D] = {};
        if (body.missed && !touches) {
            for (int i = 0; i < D; ++i) {
                for (int j = 0; j < D; ++j) lost[i] -= free[i][j] * body.missed[vertex * D + j];
            }
        }
        for (int c = 0; c < n; ++c) {
            const int64_t cell = pair[c] / (D + 1), at = (cell * body.of_cell + pair[c] % (D + 1)) * D;
            const double part = body.volumes[cell] / around;
            for (int i = 0; i < D; ++i) {
                defect[at + i] = touches ? 0.0 : part * total[i];
                if (body.missed) missed[at + i] = part * lost[i];
            }
        }
    }

    // The nearest moments with which no cell lacks anything; false where the cells do not hang together.
    bool settle() {
        if (!number_cells()) return false;
        held ? solve<D>() : solve<1>();
        for (Sheet<D>& sheet : sheets) {
            const double *one = &lack[std::max(sheet.one, 0) * D], *two = &lack[std::max(sheet.two, 0) * D];
            if (sheet.one >= 0 && sheet.two >= 0) {
                for (int i = 0; i < D; ++i) sheet.m[i] += sheet.ease * (one[i] - two[i]);
            } else if (sheet.unknown) {
                const double* U = body.unknown + body.outer[sheet.facet] * D * D;
                for (int i = 0; i < D; ++i) {
                    for (int j = 0; j < D; ++j) sheet.m[i] += sheet.ease * U[i * D + j] * one[j];
                }
            }
        }
        return true;
    }

    void write(double* moments, bool contact_alone) const {
        for (const Sheet<D>& sheet : sheets) {
            if (sheet.one < 0 || (contact_alone && !body.contact[sheet.facet])) continue;
            std::copy(sheet.m, sheet.m + D, moments + (sheet.facet * body.of_facet + sheet.node) * D);
        }
    }

    // Moments of the stress of a cell at a node of a facet.
    const double* own(int64_t cell, int side, int node) const {
        if (body.own) return body.own + ((cell * (D + 1) + side) * body.of_facet + node) * D;
        return body.forces + (cell * body.of_cell + side) * D;  // less the sign
    }

    int side_of(int64_t cell, int64_t facet) const {
        const int64_t* facets = body.cell_facets + cell * (D + 1);
        const int side = static_cast<int>(std::find(facets, facets + D + 1, facet) - facets);
        if (side > D) throw std::out_of_range("facet of a cell");
        return side;
    }

    // Between two cells: the mean of both sides, each weighed by what a change costs there.
    void mean(int64_t one, int side, int64_t two, int other, int node, double* m) const {
        const double *mine = own(one, side, node), *theirs = own(two, other, node);
        const double share = body.dear[one] / (body.dear[one] + body.dear[two]), sign = body.own ? 1.0 : -1.0;
        for (int i = 0; i < D; ++i) m[i] = sign * (share * mine[i] - (1.0 - share) * theirs[i]);
    }

    // On the boundary: what is given, or stated by pressures; of the cell along directions in which nothing is.
    // Returns whether there are such.
    bool boundary(int64_t facet, int64_t cell, int side, int node, double* m) const {
        const double *U = body.unknown + body.outer[facet] * D * D, *mine = own(cell, side, node);
        const int64_t at = (body.outer[facet] * body.of_facet + node) * D;
        const double sign = body.own ? 1.0 : -1.0;
        double off[D];
        bool some = false;
        for (int i = 0; i < D; ++i) {
            const double stated = body.pressures ? body.pressures[at + i] : 0.0;
            m[i] = body.given[at + i] + stated;
            off[i] = sign * mine[i] - m[i];
        }
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) {
                some |= U[i * D + j] != 0.0;
                m[i] += U[i * D + j] * off[j];
            }
        }
        return some;
    }

private:
    const StarBody& body;
    int n = 0;
    bool held = false, touches = false;
    double free[D][D], total[D], around = 0.0;
    std::vector<int64_t> pair;
    std::vector<double> lack;  // then potentials
    std::vector<Sheet<D>> sheets;
    std::vector<int> next, many, number, queue;
    std::vector<double> x;
    Skyline matrix;

    void add(int c, int64_t cell, int side, int node) {
        const int64_t facet = body.cell_facets[cell * (D + 1) + side];
        const int64_t one = body.owners[2 * facet], two = body.owners[2 * facet + 1];
        if (body.interior[facet] && one != cell) return;  // the first cell brings it
        Sheet<D> sheet{facet, node, c, -1, false, 0.0, {}};
        const double cost = body.dear[one] + (two < 0 ? 0.0 : body.dear[two]);
        sheet.ease = body.measures[facet] * body.measures[facet] / cost;
        if (body.interior[facet]) {
            const int other = side_of(two, facet);
            const int64_t there = two * (D + 1) + node + (node >= other);
            sheet.two = body.place[there];
            if (sheet.two < 0 || sheet.two >= n || pair[sheet.two] != there) throw std::out_of_range("star");
            mean(one, side, two, other, node, sheet.m);
        } else if (one == cell) {
            sheet.unknown = boundary(facet, cell, side, node, sheet.m);
        } else {  // of two bodies that touch the second one
            sheet.one = -1;
            sheet.two = c;
            boundary(facet, one, side_of(one, facet), node, sheet.m);
        }
        sheets.push_back(sheet);
    }

    // Directions along which no facet at the vertex takes up a force.
    void find_free() {
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) free[i][j] = i == j ? 1.0 : 0.0;
        }
        if (!held) return;
        double taken[D][D] = {};
        for (const Sheet<D>& sheet : sheets) {
            if (!sheet.unknown) continue;
            const double* U = body.unknown + body.outer[sheet.facet] * D * D;
            for (int i = 0; i < D; ++i) {
                for (int j = 0; j < D; ++j) taken[i][j] += sheet.ease * U[i * D + j];
            }
        }
        null_space<D>(taken, free);
    }

    // What is lacking along these directions: contact facets share it, else it becomes a load.
    void balance() {
        double sum[D] = {}, size = 0.0;
        around = 0.0;
        for (int c = 0; c < n; ++c) {
            around += body.volumes[pair[c] / (D + 1)];
            for (int i = 0; i < D; ++i) sum[i] += lack[c * D + i];
        }
        for (int i = 0; i < D; ++i) {
            total[i] = 0.0;
            for (int j = 0; j < D; ++j) total[i] += free[i][j] * sum[j];
        }
        for (const Sheet<D>& sheet : sheets) {
            if (sheet.one >= 0 && body.contact[sheet.facet]) size += body.measures[sheet.facet];
        }
        touches = size > 0.0;
        for (Sheet<D>& sheet : sheets) {
            if (!touches || sheet.one < 0 || !body.contact[sheet.facet]) continue;
            const double part = body.measures[sheet.facet] / size;
            for (int i = 0; i < D; ++i) {
                sheet.m[i] += part * total[i];
                lack[sheet.one * D + i] -= part * total[i];
            }
        }
        for (int c = 0; c < n && !touches; ++c) {
            const double part = body.volumes[pair[c] / (D + 1)] / around;
            for (int i = 0; i < D; ++i) lack[c * D + i] -= part * total[i];
        }
    }

    // Numbers of the cells in the order in which they are reached: neighbours have numbers that are near.
    bool number_cells() {
        next.resize(n * D);
        many.assign(n, 0);
        for (const Sheet<D>& sheet : sheets) {
            if (sheet.one < 0 || sheet.two < 0) continue;
            if (many[sheet.one] == D || many[sheet.two] == D) throw std::out_of_range("facets of a cell");
            next[sheet.one * D + many[sheet.one]++] = sheet.two;
            next[sheet.two * D + many[sheet.two]++] = sheet.one;
        }
        number.assign(n, -1);
        queue.clear();
        const auto reach = [&](int c) {
            if (number[c] >= 0) return;
            number[c] = static_cast<int>(queue.size());
            queue.push_back(c);
        };
        if (n > 0) reach(0);
        for (size_t at = 0; at < queue.size(); ++at) {
            for (int k = 0; k < many[queue[at]]; ++k) reach(next[queue[at] * D + k]);
        }
        return static_cast<int>(queue.size()) == n;
    }

    // Potentials in place of what is lacking, C components of a cell coupled. The last cell is held where all may move.
    template <int C>
    void solve() {
        if (n == 0) return;
        matrix.low.resize(n * C);
        for (int c = 0; c < n; ++c) {
            int low = number[c];
            for (int k = 0; k < many[c]; ++k) low = std::min(low, number[next[c * D + k]]);
            for (int i = 0; i < C; ++i) matrix.low[number[c] * C + i] = low * C;
        }
        matrix.lay_out();
        for (const Sheet<D>& sheet : sheets) {
            const int one = sheet.one < 0 ? -1 : number[sheet.one] * C, two = sheet.two < 0 ? -1 : number[sheet.two] * C;
            if (one >= 0 && two >= 0) {
                for (int i = 0; i < C; ++i) {
                    matrix(one + i, one + i) += sheet.ease;
                    matrix(two + i, two + i) += sheet.ease;
                    matrix(std::max(one, two) + i, std::min(one, two) + i) -= sheet.ease;
                }
            } else if (sheet.unknown) {
                for (int i = 0; i < C; ++i) {
                    for (int j = 0; j <= i; ++j) {
                        matrix(one + i, one + j) += sheet.ease * body.unknown[(body.outer[sheet.facet] * D + i) * D + j];
                    }
                }
            }
        }
        for (int i = 0; i < C; ++i) {
            for (int j = 0; j <= i; ++j) matrix((n - 1) * C + i, (n - 1) * C + j) += free[i][j];
        }
        matrix.factor();
        x.resize(n * D);
        for (int c = 0; c < n; ++c) std::copy_n(&lack[c * D], D, &x[number[c] * D]);
        matrix.template solve<D / C>(x.data());
        for (int c = 0; c < n; ++c) std::copy_n(&x[number[c] * D], D, &lack[c * D]);
    }
};

// In the middle of a facet of triangles with quadratic elements: one moment, which one equation determines.
struct Middle {
    const StarBody& body;
    const Star<2> around;
    explicit Middle(const StarBody& body) : body(body), around(body) {}

    struct End {
        int64_t at, node;  // of the cells
        double lack[2], volume;
    };

    End end(int64_t cell, int side, const double* m, double sign) const {
        const int64_t at = cell * body.of_cell + kMiddle[side];
        End out{2 * at, body.cell_nodes[at], {}, body.volumes[cell]};
        for (int i = 0; i < 2; ++i) out.lack[i] = body.forces[2 * at + i] - body.loads[2 * at + i] - sign * m[i];
        return out;
    }

    void write(const End& end, const double* total, const double* free, double part, double* defect,
               double* missed) const {
        for (int i = 0; i < 2; ++i) {
            defect[end.at + i] = part * total[i];
            if (!body.missed) continue;
            missed[end.at + i] = 0.0;
            for (int j = 0; j < 2 && free; ++j) {
                missed[end.at + i] -= part * free[2 * i + j] * body.missed[2 * end.node + j];
            }
        }
    }

    void settle(int64_t facet, bool contact_alone, double* moments, double* defect, double* missed) const {
        const int64_t one = body.owners[2 * facet], two = body.owners[2 * facet + 1];
        const int side = around.side_of(one, facet), other = two < 0 ? 0 : around.side_of(two, facet);
        double m[2], *out = moments + (facet * body.of_facet + 2) * 2;
        const double unit[4] = {1.0, 0.0, 0.0, 1.0}, none[2] = {};
        if (body.interior[facet]) {
            around.mean(one, side, two, other, 2, m);
            const End first = end(one, side, m, 1.0), second = end(two, other, m, -1.0);
            const double total[2] = {first.lack[0] + second.lack[0], first.lack[1] + second.lack[1]};
            const double part = first.volume / (first.volume + second.volume);
            write(first, total, unit, part, defect, missed);
            write(second, total, unit, second.volume / (first.volume + second.volume), defect, missed);
            for (int i = 0; i < 2; ++i) out[i] = m[i] + first.lack[i] - part * total[i];
            return;
        }
        around.boundary(facet, one, side, 2, m);
        const double* U = body.unknown + 4 * body.outer[facet];
        const double free[4] = {1.0 - U[0], -U[1], -U[2], 1.0 - U[3]};
        const End first = end(one, side, m, 1.0);
        const double total[2] = {free[0] * first.lack[0] + free[1] * first.lack[1],
                                 free[2] * first.lack[0] + free[3] * first.lack[1]};
        const bool touches = body.contact[facet];
        for (int i = 0; i < 2; ++i) out[i] = m[i] + (touches ? total[i] : 0.0);
        if (contact_alone) return;
        const double left[2] = {first.lack[0] - total[0], first.lack[1] - total[1]};
        for (int i = 0; i < 2; ++i) out[i] += U[2 * i] * left[0] + U[2 * i + 1] * left[1];
        write(first, touches ? none : total, touches ? nullptr : free, 1.0, defect, missed);
        if (two < 0) return;
        const End second = end(two, other, m, -1.0);
        write(second, second.lack, free, 1.0, defect, missed);
    }
};

template <int D>
int64_t settle_by(const StarBody& body, double* moments, double* defect, double* missed) {
    std::atomic<int64_t> pinched{body.vertices};
    by_pieces(body.vertices, [&](int64_t from, int64_t to) {
        Star<D> star(body);
        for (int64_t vertex = from; vertex < to; ++vertex) {
            star.gather(vertex);
            star.write_defect(vertex, defect, missed);
            if (star.settle()) {
                star.write(moments, false);
                continue;
            }
            int64_t least = pinched.load();
            while (vertex < least && !pinched.compare_exchange_weak(least, vertex)) {}
        }
    });
    if (body.of_facet > D) {
        by_pieces(body.facets, [&](int64_t from, int64_t to) {
            const Middle middle(body);
            for (int64_t facet = from; facet < to; ++facet) middle.settle(facet, false, moments, defect, missed);
        });
    }
    return pinched < body.vertices ? pinched.load() : -1;
}

template <int D>
void share_by(const StarBody& body, int64_t count, const int64_t* vertices, double* moments) {
    by_pieces(count, [&](int64_t from, int64_t to) {
        Star<D> star(body);
        for (int64_t k = from; k < to; ++k) {
            star.gather(vertices[k]);
            star.write(moments, true);
        }
    });
    if (body.of_facet == D) return;
    const Middle middle(body);
    for (int64_t facet = 0; facet < body.facets; ++facet) {
        if (body.contact[facet]) middle.settle(facet, true, moments, nullptr, nullptr);
    }
}

}  // namespace

int64_t settle_stars(const StarBody& body, double* moments, double* defect, double* missed) {
    return body.dim == 2 ? settle_by<2>(body, moments, defect, missed) : settle_by<3>(body, moments, defect, missed);
}

void share_on_contact(const StarBody& body, int64_t count, const int64_t* vertices, double* moments) {
    body.dim == 2 ? share_by<2>(body, count, vertices, moments) : share_by<3>(body, count, vertices, moments);
}

}  // namespace hemivar
