#include "patches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <unordered_map>
#include <utility>
#include <vector>

#include "pool.hpp"
#include "wide.hpp"

namespace hemivar {

namespace {

constexpr int64_t kPiece = 64;  // patches of a piece of work
constexpr int64_t kMany = 64;   // patches of one kind whose system is solved beforehand
constexpr int kModes = 6, kBlock = 9, kDim = 3;

struct Quad {
    double lane[4] = {};
    HEMIVAR_INLINE void add(double weight, const double* from) {
        for (int k = 0; k < 4; ++k) lane[k] += weight * from[k];
    }
    HEMIVAR_INLINE void put(double* out) const {
        for (int k = 0; k < 4; ++k) out[k] = lane[k];
    }
};

// Sums of `count` weighted rows of n numbers, so many side by side as registers hold.
HEMIVAR_INLINE void combine_rows(int64_t n, const double* from, const double* weights, int64_t count, double* out) {
    int64_t at = 0;
    for (; at + 24 <= n; at += 24) {
        Quad a, b, c, d, e, f;
        for (int64_t v = 0; v < count; ++v) {
            row_by_row();
            const double* row = from + v * n + at;
            a.add(weights[v], row);
            b.add(weights[v], row + 4);
            c.add(weights[v], row + 8);
            d.add(weights[v], row + 12);
            e.add(weights[v], row + 16);
            f.add(weights[v], row + 20);
        }
        a.put(out + at), b.put(out + at + 4), c.put(out + at + 8);
        d.put(out + at + 12), e.put(out + at + 16), f.put(out + at + 20);
    }
    for (; at + 12 <= n; at += 12) {
        Quad a, b, c;
        for (int64_t v = 0; v < count; ++v) {
            row_by_row();
            const double* row = from + v * n + at;
            a.add(weights[v], row);
            b.add(weights[v], row + 4);
            c.add(weights[v], row + 8);
        }
        a.put(out + at), b.put(out + at + 4), c.put(out + at + 8);
    }
    for (; at + 4 <= n; at += 4) {
        Quad a;
        for (int64_t v = 0; v < count; ++v) {
            row_by_row();
            a.add(weights[v], from + v * n + at);
        }
        a.put(out + at);
    }
    for (; at < n; ++at) {
        double sum = 0.0;
        for (int64_t v = 0; v < count; ++v) sum += weights[v] * from[v * n + at];
        out[at] = sum;
    }
}

// U with U'U / diag(U) the matrix, in its place above the diagonal; false where it is not definite. Sums go along rows,
// which compilers do side by side.
HEMIVAR_INLINE bool eliminate_rows(int64_t n, double* A) {
    for (int64_t k = 0; k < n; ++k) {
        const double* top = A + k * n;
        if (!(top[k] > 0.0) || !std::isfinite(top[k])) return false;
        for (int64_t i = k + 1; i < n; ++i) {
            const double factor = top[i] / top[k];
            double* row = A + i * n;
            for (int64_t j = i; j < n; ++j) row[j] -= factor * top[j];
        }
    }
    return true;
}

void combine_any(int64_t n, const double* from, const double* weights, int64_t count, double* out) {
    combine_rows(n, from, weights, count, out);
}

HEMIVAR_WIDE void combine_wide(int64_t n, const double* from, const double* weights, int64_t count, double* out) {
    combine_rows(n, from, weights, count, out);
}

bool eliminate_any(int64_t n, double* A) { return eliminate_rows(n, A); }

HEMIVAR_WIDE bool eliminate_wide(int64_t n, double* A) { return eliminate_rows(n, A); }

const auto combine = wide_registers() ? combine_wide : combine_any;
const auto eliminate = wide_registers() ? eliminate_wide : eliminate_any;

void substitute(int64_t n, const double* U, double* x) {
    for (int64_t k = 0; k < n; ++k) {
        x[k] /= U[k * n + k];
        for (int64_t i = k + 1; i < n; ++i) x[i] -= U[k * n + i] * x[k];
    }
    for (int64_t k = n - 1; k >= 0; --k) {
        double sum = 0.0;
        for (int64_t i = k + 1; i < n; ++i) sum += U[k * n + i] * x[i];
        x[k] -= sum / U[k * n + k];
    }
}

struct Sizes {
    int64_t d, l, block, corners, n, inner, whole, own, modes, v, sides;
    Sizes(const PatchBody& body, const PatchSweep& sweep)
        : d(body.dim), l(body.nodes), block(l * d), corners(d + 1), n(corners * block), inner(body.inner),
          whole(n + inner), own(d == 3 ? 3 : (l == 2 ? 1 : 3)), modes(d * (d + 1) / 2), v(modes * (modes + 1) / 2),
          sides(sweep.sides_of_seen) {}
};

// Which facets and cells a patch has, and how it hangs together.
struct Shape {
    std::vector<int64_t> cells, facets;
    std::vector<int> local;                // what each cell is seen at
    std::vector<int> place;                // of the sides of each cell among the facets; -1 for others
    std::vector<int> ends;                 // first and second cell of each facet; the number of cells for none
    std::vector<signed char> circuits;     // facets of each circuit: 1 where it leaves the first cell, -1 the second
    int64_t width = 0;
    bool priced = false;

    int64_t fields(const Sizes& z) const { return static_cast<int64_t>(facets.size()) * z.own + width * z.modes; }
};

struct Gatherer {
    const PatchBody& body;
    const PatchSweep& sweep;
    const Sizes& z;
    std::vector<int> parent, through;
    std::vector<int> queue;

    void gather(int64_t patch, Shape& out) const {
        const int64_t first = sweep.start[patch], last = sweep.start[patch + 1];
        const int count = static_cast<int>(last - first);
        out.cells.clear();
        out.facets.clear();
        out.local.clear();
        out.ends.clear();
        out.place.assign(count * z.sides, -1);
        out.priced = false;
        for (int c = 0; c < count; ++c) {
            const int64_t cell = sweep.seen[first + c] / sweep.seen_of_cell;
            const int64_t at = sweep.seen[first + c] % sweep.seen_of_cell;
            out.cells.push_back(cell);
            out.local.push_back(static_cast<int>(at));
            for (int64_t s = 0; s < z.sides; ++s) {
                const int64_t side = sweep.sides[at * z.sides + s], facet = body.cell_facets[cell * z.corners + side];
                if (!sweep.free[facet]) continue;
                size_t j = 0;
                while (j < out.facets.size() && out.facets[j] != facet) ++j;
                if (j == out.facets.size()) {
                    out.facets.push_back(facet);
                    out.ends.insert(out.ends.end(), {count, count});
                    if (sweep.rows && sweep.rows[facet] >= 0) out.priced = true;
                }
                out.place[c * z.sides + s] = static_cast<int>(j);
                out.ends[2 * j + (body.signs[cell * z.corners + side] < 0.0 ? 1 : 0)] = c;
            }
        }
    }

    // The facets, with the sign of their direction, on the way from a cell to the root of its tree, added to a row.
    void climb(const Shape& shape, int node, int sign, signed char* row) const {
        while (through[node] >= 0) {
            const int j = through[node];
            row[j] = static_cast<signed char>(row[j] + (shape.ends[2 * j] == node ? sign : -sign));
            node = parent[node];
        }
    }

    void close(Shape& shape) {
        const int cells = static_cast<int>(shape.cells.size()), facets = static_cast<int>(shape.facets.size());
        parent.assign(cells + 1, -1);
        through.assign(cells + 1, -1);
        std::vector<char> reached(cells + 1, 0), used(facets, 0);
        for (int start = cells; start >= 0; --start) {
            if (reached[start]) continue;
            reached[start] = 1;
            queue.assign(1, start);
            for (size_t at = 0; at < queue.size(); ++at) {
                for (int j = 0; j < facets; ++j) {
                    const int one = shape.ends[2 * j], two = shape.ends[2 * j + 1];
                    if (one != queue[at] && two != queue[at]) continue;
                    const int other = one == queue[at] ? two : one;
                    if (reached[other]) continue;
                    reached[other] = used[j] = 1;
                    parent[other] = queue[at];
                    through[other] = j;
                    queue.push_back(other);
                }
            }
        }
        shape.circuits.clear();
        shape.width = 0;
        for (int j = 0; j < facets; ++j) {
            if (used[j]) continue;
            shape.circuits.resize((shape.width + 1) * facets, 0);
            signed char* row = &shape.circuits[shape.width * facets];
            row[j] = 1;
            climb(shape, shape.ends[2 * j + 1], 1, row);
            climb(shape, shape.ends[2 * j], -1, row);
            ++shape.width;
        }
    }
};

// Moments along an edge of a facet, whose nodes are `at`, or across it, are added to `out`.
template <class T>
HEMIVAR_INLINE void along_facet(const Sizes& z, const T* at, int64_t number, const T& size, T* out) {
    if (z.d == 3) {
        const int64_t one = number == 2 ? 1 : 0, two = number == 0 ? 1 : 2;
        for (int64_t i = 0; i < 3; ++i) {
            const T along = size * (at[two * 3 + i] - at[one * 3 + i]);
            out[one * 3 + i] += along;
            out[two * 3 + i] -= along;
        }
        return;
    }
    const T along[2] = {at[2] - at[0], at[3] - at[1]};
    const T way[2] = {size * (number == 2 ? -1.0 * along[1] : along[0]), size * (number == 2 ? along[0] : along[1])};
    for (int64_t i = 0; i < 2; ++i) {
        if (number == 0) {
            out[i] += way[i];
            out[2 + i] -= way[i];
        } else {
            out[i] += 0.5 * way[i];
            out[2 + i] += 0.5 * way[i];
            out[4 + i] -= way[i];
        }
    }
}

// Moments of a facet with a force and a moment about the middle of the patch are added to `out`.
template <class T>
HEMIVAR_INLINE void flow_through(const Sizes& z, const T* at, const T* flow, T* out) {
    const double share = 1.0 / static_cast<double>(z.l);
    T middle[kDim] = {};
    for (int64_t a = 0; a < z.l; ++a) {
        for (int64_t i = 0; i < z.d; ++i) {
            middle[i] += share * at[a * z.d + i];
            out[a * z.d + i] += share * flow[i];
        }
    }
    if (z.d == 2) {
        const T left = flow[2] - (middle[0] * flow[1] - middle[1] * flow[0]);
        T square = {};
        for (int64_t a = 0; a < z.l; ++a) {
            const T one = at[2 * a] - middle[0], two = at[2 * a + 1] - middle[1];
            square += one * one + two * two;
        }
        const T turn = left / square;
        for (int64_t a = 0; a < z.l; ++a) {
            out[2 * a] -= turn * (at[2 * a + 1] - middle[1]);
            out[2 * a + 1] += turn * (at[2 * a] - middle[0]);
        }
        return;
    }
    T left[3], a[3], b[3], n[3], turn = {}, along = {}, across = {}, square = {};
    for (int i = 0; i < 3; ++i) {
        const int p = (i + 1) % 3, q = (i + 2) % 3;
        left[i] = flow[3 + i] - (middle[p] * flow[q] - middle[q] * flow[p]);
        a[i] = at[3 + i] - at[i];
        b[i] = at[6 + i] - at[i];
    }
    for (int i = 0; i < 3; ++i) {
        const int p = (i + 1) % 3, q = (i + 2) % 3;
        n[i] = a[p] * b[q] - a[q] * b[p];
        square += n[i] * n[i];
    }
    for (int i = 0; i < 3; ++i) {
        n[i] /= square;
        turn += 0.5 * left[i] * n[i];
        along += left[i] * a[i];
        across += left[i] * b[i];
    }
    for (int i = 0; i < 3; ++i) {
        const T one = turn * b[i] - across * n[i], two = along * n[i] - turn * a[i];
        out[3 + i] += one;
        out[6 + i] += two;
        out[i] -= one + two;
    }
}

// Moments of facet j of a patch, whose nodes are `at`, of a change of its fields, added to `out`.
template <class T>
HEMIVAR_INLINE void moments_of(const Sizes& z, const Shape& shape, int64_t j, const T* at, const T* change, T* out) {
    const int64_t facets = static_cast<int64_t>(shape.facets.size());
    for (int64_t o = 0; o < z.own; ++o) along_facet(z, at, o, change[j * z.own + o], out);
    if (shape.width == 0) return;
    T flow[kModes] = {};
    for (int64_t w = 0; w < shape.width; ++w) {
        const double sign = shape.circuits[w * facets + j];
        for (int64_t m = 0; m < z.modes; ++m) flow[m] += sign * change[facets * z.own + w * z.modes + m];
    }
    flow_through(z, at, flow, out);
}

// The nodes of the facets of a patch about its middle.
struct Fields {
    const PatchBody& body;
    const Sizes& z;
    std::vector<double> x;

    void place(const Shape& shape) {
        const int64_t facets = static_cast<int64_t>(shape.facets.size());
        x.resize(facets * z.block);
        double middle[kDim] = {};
        for (int64_t j = 0; j < facets; ++j) {
            for (int64_t a = 0; a < z.l; ++a) {
                const double* from = body.points + body.facet_nodes[shape.facets[j] * z.l + a] * z.d;
                for (int64_t i = 0; i < z.d; ++i) {
                    x[j * z.block + a * z.d + i] = from[i];
                    middle[i] += from[i];
                }
            }
        }
        for (int64_t i = 0; i < z.d; ++i) middle[i] /= static_cast<double>(facets * z.l);
        for (int64_t a = 0; a < facets * z.l; ++a) {
            for (int64_t i = 0; i < z.d; ++i) x[a * z.d + i] -= middle[i];
        }
    }

    void add_own(int64_t j, int64_t number, double size, double* out) const {
        along_facet(z, &x[j * z.block], number, size, out);
    }
    void add_flow(int64_t j, const double* flow, double* out) const { flow_through(z, &x[j * z.block], flow, out); }
};

// The misfit of a patch in its fields: those of the facets in turn, then those of the circuits.
struct System {
    std::vector<int> columns, starts;       // the fields that each cell sees, and where those of a cell begin
    std::vector<double> seen, bent;  // field by field, their moments on its sides, and what they add to its slopes
    std::vector<double> H, R, unit, b, change;
    int64_t q = 0;
};

class Improver {
public:
    Improver(const PatchBody& body, const PatchSweep& sweep)
        : body(body), sweep(sweep), z(body, sweep), gatherer{body, sweep, z, {}, {}, {}}, fields{body, z, {}} {}

    void gather(int64_t patch) { gatherer.gather(patch, shape); }

    // What makes patches of one kind: cells alike, seen at the same places, with facets in the same order.
    void key(std::vector<int64_t>& out) const {
        out.clear();
        for (size_t c = 0; c < shape.cells.size(); ++c) {
            out.push_back(body.alike[shape.cells[c]] * sweep.seen_of_cell + shape.local[c]);
            for (int64_t s = 0; s < z.sides; ++s) {
                const int j = shape.place[c * z.sides + s];
                out.push_back(j < 0 ? -1 : 2 * j + (shape.ends[2 * j] == static_cast<int>(c) ? 0 : 1));
            }
        }
    }

    void prepare(int64_t patch) {
        gather(patch);
        gatherer.close(shape);
        fields.place(shape);
        assemble();
    }

    // Improve a patch by itself.
    void improve(int64_t patch) {
        gather(patch);
        if (shape.facets.empty()) return;
        gatherer.close(shape);
        fields.place(shape);
        assemble();
        slopes();
        if (shape.priced) charge();
        if (!solve()) return;
        apply();
    }

    // minus the inverse of the matrix in units of its diagonal, in place of R; zero where rounding decides.
    void invert() {
        const int64_t q = system.q;
        std::vector<double> scaled(system.H), &unit = system.unit;
        unit.assign(q, 0.0);
        for (int64_t i = 0; i < q; ++i) {
            const double own = system.H[i * q + i];
            unit[i] = own > 0.0 ? 1.0 / std::sqrt(own) : 0.0;
        }
        for (int64_t i = 0; i < q * q; ++i) scaled[i] *= unit[i / q] * unit[i % q];
        std::vector<double> inverse(q * q, 0.0), factor(scaled);
        bool good = eliminate(q, factor.data());
        for (int64_t i = 0; i < q && good; ++i) {
            inverse[i * q + i] = 1.0;
            substitute(q, factor.data(), &inverse[i * q]);
        }
        for (int64_t i = 0; i < q && good; ++i) {  // off the unit matrix by less than 1, so it lowers every misfit
            double off = 0.0;
            for (int64_t j = 0; j < q; ++j) {
                double sum = i == j ? -1.0 : 0.0;
                for (int64_t t = 0; t < q; ++t) sum += scaled[i * q + t] * inverse[j * q + t];
                off += std::abs(sum);
            }
            good = off < 1.0;
        }
        for (int64_t i = 0; i < q * q; ++i) inverse[i] = good ? -inverse[i] : 0.0;
        system.R.swap(inverse);
    }

    Shape shape;
    System system;

private:
    // Energies of the cells in what they see of the fields.
    void assemble() {
        const int64_t cells = static_cast<int64_t>(shape.cells.size()), facets = static_cast<int64_t>(shape.facets.size());
        const int64_t rows = z.sides * z.block;
        const int64_t q = system.q = shape.fields(z);
        own.assign(facets * z.own * z.block, 0.0);
        flows.assign(shape.width ? facets * z.modes * z.block : 0, 0.0);
        for (int64_t j = 0; j < facets; ++j) {
            for (int64_t o = 0; o < z.own; ++o) fields.add_own(j, o, 1.0, &own[(j * z.own + o) * z.block]);
            for (int64_t m = 0; m < z.modes && shape.width; ++m) {
                double unit[kModes] = {};
                unit[m] = 1.0;
                fields.add_flow(j, unit, &flows[(j * z.modes + m) * z.block]);
            }
        }
        system.columns.clear();
        system.starts.assign(1, 0);
        for (int64_t c = 0; c < cells; ++c) {
            const int* place = &shape.place[c * z.sides];
            for (int64_t s = 0; s < z.sides; ++s) {
                for (int64_t o = 0; o < z.own && place[s] >= 0; ++o) {
                    system.columns.push_back(static_cast<int>(place[s] * z.own + o));
                }
            }
            for (int64_t w = 0; w < shape.width; ++w) {
                bool passes = false;
                for (int64_t s = 0; s < z.sides; ++s) {
                    passes = passes || (place[s] >= 0 && shape.circuits[w * facets + place[s]] != 0);
                }
                for (int64_t m = 0; m < z.modes && passes; ++m) {
                    system.columns.push_back(static_cast<int>(facets * z.own + w * z.modes + m));
                }
            }
            system.starts.push_back(static_cast<int>(system.columns.size()));
        }
        const int64_t total = static_cast<int64_t>(system.columns.size());
        system.seen.assign(total * rows, 0.0);
        system.bent.resize(total * z.n);
        system.H.assign(q * q, 0.0);
        for (int64_t c = 0; c < cells; ++c) {
            see(c, facets, rows);
            bend(c, facets, rows);
            const int first = system.starts[c], size = system.starts[c + 1] - first;
            turned.resize(rows * size);
            for (int64_t s = 0; s < z.sides; ++s) {
                if (shape.place[c * z.sides + s] < 0) {
                    std::fill_n(&turned[s * z.block * size], z.block * size, 0.0);
                    continue;
                }
                const double* bent = &system.bent[first * z.n + side(shape.local[c], s) * z.block];
                for (int64_t t = 0; t < z.block; ++t) {
                    for (int j = 0; j < size; ++j) turned[(s * z.block + t) * size + j] = bent[j * z.n + t];
                }
            }
            local.resize(size);
            for (int i = 0; i < size; ++i) {
                const auto [from, count] = seen_rows(c, system.columns[first + i], facets, rows);
                const double* seen = &system.seen[(first + i) * rows + from];
                combine(size, &turned[from * size], seen, count, local.data());
                double* to = &system.H[system.columns[first + i] * q];
                for (int j = 0; j < size; ++j) to[system.columns[first + j]] += local[j];
            }
        }
    }

    // The moments of the sides of a cell on which a field has some: the first one, and how many.
    std::pair<int64_t, int64_t> seen_rows(int64_t c, int64_t column, int64_t facets, int64_t rows) const {
        if (column >= facets * z.own) return {0, rows};
        const int* place = &shape.place[c * z.sides];
        return {(std::find(place, place + z.sides, static_cast<int>(column / z.own)) - place) * z.block, z.block};
    }

    int64_t side(int local, int64_t s) const { return sweep.sides[local * z.sides + s]; }

    // Moments of the fields on the sides of a cell, outward, on the reference simplex.
    void see(int64_t c, int64_t facets, int64_t rows) {
        const int64_t cell = shape.cells[c];
        const double* inverse = body.gradients + (cell * z.corners + 1) * z.d;
        for (int64_t s = 0; s < z.sides; ++s) {
            const int64_t j = shape.place[c * z.sides + s];
            if (j < 0) continue;
            const double sign = body.signs[cell * z.corners + side(shape.local[c], s)];
            const int first = system.starts[c], fields = system.starts[c + 1] - first;
            for (int i = 0; i < fields; ++i) {
                const int64_t column = system.columns[first + i], field = column - facets * z.own;
                const double* from;
                double size = sign;
                if (field < 0) {
                    if (column / z.own != j) continue;
                    from = &own[column * z.block];
                } else {
                    size *= shape.circuits[field / z.modes * facets + j];
                    if (size == 0.0) continue;
                    from = &flows[(j * z.modes + field % z.modes) * z.block];
                }
                double* to = &system.seen[(first + i) * rows + s * z.block];
                for (int64_t a = 0; a < z.l; ++a) {
                    for (int64_t r = 0; r < z.d; ++r) {
                        double sum = 0.0;
                        for (int64_t t = 0; t < z.d; ++t) sum += inverse[r * z.d + t] * from[a * z.d + t];
                        to[a * z.d + r] = size * sum;
                    }
                }
            }
        }
    }

    // What these moments add to the slopes of the cell, the least over what has no tractions.
    void bend(int64_t c, int64_t facets, int64_t rows) {
        const double* weights = body.compliance + body.alike[shape.cells[c]] * z.v;
        const int first = system.starts[c], last = system.starts[c + 1];
        energy.resize((rows + z.inner) * z.whole);
        whole.resize((last - first) * z.whole);
        for (int64_t s = 0; s < z.sides; ++s) {
            if (shape.place[c * z.sides + s] < 0) {
                std::fill_n(&energy[s * z.block * z.whole], z.block * z.whole, 0.0);
                continue;
            }
            for (int64_t t = 0; t < z.block; ++t) {
                row_of_energy(side(shape.local[c], s) * z.block + t, weights, &energy[(s * z.block + t) * z.whole]);
            }
        }
        for (int i = first; i < last; ++i) {
            const auto [from, count] = seen_rows(c, system.columns[i], facets, rows);
            const double* seen = &system.seen[i * rows + from];
            combine(z.whole, &energy[from * z.whole], seen, count, &whole[(i - first) * z.whole]);
        }
        if (z.inner) {
            std::vector<double> block(z.inner * z.inner);
            for (int64_t i = 0; i < z.inner; ++i) {
                row_of_energy(z.n + i, weights, &energy[(rows + i) * z.whole]);
                for (int64_t j = 0; j < z.inner; ++j) block[i * z.inner + j] = energy[(rows + i) * z.whole + z.n + j];
            }
            if (eliminate(z.inner, block.data())) {
                for (int i = first; i < last; ++i) {
                    double* to = &whole[(i - first) * z.whole];
                    substitute(z.inner, block.data(), to + z.n);
                    for (int64_t r = 0; r < z.inner; ++r) {
                        const double part = to[z.n + r];
                        for (int64_t k = 0; k < z.n; ++k) to[k] -= part * energy[(rows + r) * z.whole + k];
                    }
                }
            }
        }
        for (int i = first; i < last; ++i) {
            std::copy_n(&whole[(i - first) * z.whole], z.n, &system.bent[i * z.n]);
        }
    }

    void row_of_energy(int64_t row, const double* weights, double* out) const {
        combine(z.whole, body.energies + row * z.v * z.whole, weights, z.v, out);
    }

    void slopes() {
        const int64_t rows = z.sides * z.block;
        system.b.assign(system.q, 0.0);
        for (size_t c = 0; c < shape.cells.size(); ++c) {
            for (int64_t s = 0; s < z.sides; ++s) {
                if (shape.place[c * z.sides + s] < 0) continue;
                const double* slope = sweep.slope + shape.cells[c] * z.n + side(shape.local[c], s) * z.block;
                for (int i = system.starts[c]; i < system.starts[c + 1]; ++i) {
                    const double* seen = &system.seen[i * rows + s * z.block];
                    double sum = 0.0;
                    for (int64_t t = 0; t < z.block; ++t) sum += seen[t] * slope[t];
                    system.b[system.columns[i]] += sum;
                }
            }
        }
    }

    // Add the price of contact tractions.
    void charge() {
        const int64_t facets = static_cast<int64_t>(shape.facets.size()), q = system.q;
        std::vector<double> on(q * kBlock), priced(q * kBlock), half(kBlock);
        for (int64_t j = 0; j < facets; ++j) {
            const int64_t row = sweep.rows[shape.facets[j]];
            if (row < 0) continue;
            std::fill(on.begin(), on.end(), 0.0);
            std::copy_n(&own[j * z.own * z.block], z.own * z.block, &on[j * z.own * z.block]);
            for (int64_t w = 0; w < shape.width; ++w) {
                const double sign = shape.circuits[w * facets + j];
                for (int64_t k = 0; k < z.modes * z.block && sign != 0.0; ++k) {
                    on[(facets * z.own + w * z.modes) * z.block + k] = sign * flows[j * z.modes * z.block + k];
                }
            }
            const double* P = sweep.matrices + row * z.block * z.block;
            const double* m = sweep.moments + shape.facets[j] * z.block;
            for (int64_t r = 0; r < z.block; ++r) {
                half[r] = sweep.offsets[row * z.block + r];
                for (int64_t t = 0; t < z.block; ++t) half[r] += P[r * z.block + t] * m[t];
            }
            for (int64_t i = 0; i < q; ++i) {
                for (int64_t r = 0; r < z.block; ++r) {
                    double sum = 0.0;
                    for (int64_t t = 0; t < z.block; ++t) sum += P[r * z.block + t] * on[i * z.block + t];
                    priced[i * z.block + r] = sum;
                    system.b[i] += on[i * z.block + r] * half[r];
                }
            }
            for (int64_t i = 0; i < q; ++i) {
                for (int64_t k = 0; k < q; ++k) {
                    double sum = 0.0;
                    for (int64_t r = 0; r < z.block; ++r) sum += on[i * z.block + r] * priced[k * z.block + r];
                    system.H[i * q + k] += sum;
                }
            }
        }
    }

    // The least misfit; false where rounding decides.
    bool solve() {
        const int64_t q = system.q;
        std::vector<double>& unit = numbers;
        unit.resize(q);
        scaled.resize(q * q);
        for (int64_t i = 0; i < q; ++i) {
            if (!(system.H[i * q + i] > 0.0)) return false;
            unit[i] = 1.0 / std::sqrt(system.H[i * q + i]);
        }
        for (int64_t i = 0; i < q; ++i) {
            for (int64_t j = 0; j < q; ++j) scaled[i * q + j] = system.H[i * q + j] * unit[i] * unit[j];
        }
        if (!eliminate(q, scaled.data())) return false;
        system.change.resize(q);
        for (int64_t i = 0; i < q; ++i) system.change[i] = -unit[i] * system.b[i];
        substitute(q, scaled.data(), system.change.data());
        double value = 0.0;
        for (int64_t i = 0; i < q; ++i) system.change[i] *= unit[i];
        for (int64_t i = 0; i < q; ++i) {
            double sum = 0.0;
            for (int64_t j = 0; j < q; ++j) sum += system.H[i * q + j] * system.change[j];
            value += system.change[i] * (0.5 * sum + system.b[i]);
        }
        return value < 0.0;
    }

    // Change the slopes of the cells, and the moments of the facets, whose nodes `fields` knows.
    void apply() {
        for (size_t c = 0; c < shape.cells.size(); ++c) {
            double* to = sweep.slope + shape.cells[c] * z.n;
            const int first = system.starts[c], size = system.starts[c + 1] - first;
            turned.resize(size + z.n);
            for (int i = 0; i < size; ++i) turned[i] = system.change[system.columns[first + i]];
            combine(z.n, &system.bent[first * z.n], turned.data(), size, &turned[size]);
            for (int64_t k = 0; k < z.n; ++k) to[k] += turned[size + k];
        }
        for (size_t j = 0; j < shape.facets.size(); ++j) {
            double moved[kBlock] = {};
            moments_of(z, shape, static_cast<int64_t>(j), &fields.x[j * z.block], system.change.data(), moved);
            double* to = sweep.moments + shape.facets[j] * z.block;
            for (int64_t t = 0; t < z.block; ++t) to[t] += moved[t];
        }
    }

    const PatchBody& body;
    const PatchSweep& sweep;
    const Sizes z;
    Gatherer gatherer;
    Fields fields;
    std::vector<double> own, flows, energy, whole, local, turned, scaled, numbers;
};

// Patches that are translates of each other, solved once. Their tables are in single precision: what a change gains hangs
// on them, while the moments are those of the fields on the facets of each patch, in double precision. Whatever the units,
// the largest entry of a table is about one: fields count in their `unit`, and a table is times its `size`.
struct Kind {
    Shape shape;
    int64_t q = 0, columns = 0, slopes = 0;  // fields; these, and the slopes of a cell, made up to fours
    std::vector<int> fields, starts, seen_by;  // those of the cells; the cell and the side at which each facet is seen
    std::vector<float> seen, bent, inverse;
    std::vector<double> unit;
    double size_of_seen = 1.0, size_of_bent = 1.0;

    void keep(const Sizes& z, const Shape& of, const System& system) {
        shape = of;
        q = system.q;
        columns = fours(q);
        slopes = fours(z.n);
        fields = system.columns;
        starts = system.starts;
        unit = system.unit;
        seen_by.assign(shape.facets.size(), 0);
        for (size_t at = 0; at < shape.place.size(); ++at) {
            if (shape.place[at] >= 0) seen_by[shape.place[at]] = static_cast<int>(at);
        }
        const int64_t rows = z.sides * z.block;
        std::vector<double> moments(system.seen), slopes_of(system.bent);
        size_of_seen = in_units(moments, rows);
        size_of_bent = in_units(slopes_of, z.n);
        for (size_t c = 0; c + 1 < starts.size(); ++c) {
            const int64_t first = starts[c], size = starts[c + 1] - first;
            std::vector<double> turned(rows * size);
            for (int64_t k = 0; k < rows * size; ++k) turned[k] = moments[(first + k % size) * rows + k / size];
            put(seen, rows, size, turned.data());
            put(bent, size, z.n, &slopes_of[first * z.n]);
        }
        put(inverse, q, q, system.R.data());
    }

    static int64_t fours(int64_t n) { return (n + 3) / 4 * 4; }

private:
    // Rows of n numbers, one for each field that a cell sees, in units of these and over the largest, which is returned.
    double in_units(std::vector<double>& table, int64_t n) const {
        double most = 0.0;
        for (size_t i = 0; i < fields.size(); ++i) {
            for (int64_t k = 0; k < n; ++k) {
                double& entry = table[i * n + k];
                entry *= unit[fields[i]];
                most = std::max(most, std::abs(entry));
            }
        }
        if (!(most > 0.0 && most < std::numeric_limits<double>::infinity())) {
            std::fill(table.begin(), table.end(), 0.0);
            return 1.0;
        }
        for (double& entry : table) entry /= most;
        return most;
    }

    static void put(std::vector<float>& to, int64_t rows, int64_t columns, const double* from) {
        for (int64_t i = 0; i < rows; ++i) {
            to.insert(to.end(), from + i * columns, from + (i + 1) * columns);
            to.resize(to.size() + fours(columns) - columns, 0.0f);
        }
    }
};

// Sums of weighted rows of n numbers, four of them at a time, for eight patches.
HEMIVAR_INLINE void combine_eight(int64_t n, const float* from, const Floats* weights, int64_t count, Floats* out) {
    for (int64_t first = 0; first < n; first += 4) {
        Floats one = {}, two = {}, three = {}, four = {};
        for (int64_t v = 0; v < count; ++v) {
            row_by_row();
            const float* row = from + v * n + first;
            one.add(row[0], weights[v]);
            two.add(row[1], weights[v]);
            three.add(row[2], weights[v]);
            four.add(row[3], weights[v]);
        }
        out[first] = one;
        out[first + 1] = two;
        out[first + 2] = three;
        out[first + 3] = four;
    }
}

// What eight patches of a kind need beside it.
struct Room {
    std::vector<int64_t> cells, facets;
    std::vector<Floats> seen, part, loads, change;
    std::vector<Doubles> places, changes;
};

// Improve up to eight patches of a kind, side by side.
HEMIVAR_INLINE void improve_alike(const PatchBody& body, const PatchSweep& sweep, const Sizes& z, const Kind& kind,
                                  const int64_t* patches, int64_t count, Room& room) {
    const int64_t cells = static_cast<int64_t>(kind.shape.local.size()), rows = z.sides * z.block;
    const int64_t facets = static_cast<int64_t>(kind.shape.facets.size()), wide = std::max(kind.columns, kind.slopes);
    room.cells.resize(cells * kEight);
    room.facets.resize(facets * kEight);
    for (int64_t c = 0; c < cells; ++c) {
        for (int64_t lane = 0; lane < kEight; ++lane) {
            const int64_t patch = patches[std::min(lane, count - 1)];
            room.cells[c * kEight + lane] = sweep.seen[sweep.start[patch] + c] / sweep.seen_of_cell;
        }
    }
    for (int64_t j = 0; j < facets; ++j) {
        const int64_t c = kind.seen_by[j] / z.sides, at = kind.shape.local[c] * z.sides + kind.seen_by[j] % z.sides;
        for (int64_t lane = 0; lane < kEight; ++lane) {
            const int64_t cell = room.cells[c * kEight + lane];
            const int64_t facet = room.facets[j * kEight + lane] = body.cell_facets[cell * z.corners + sweep.sides[at]];
            fetch(body.facet_nodes + facet * z.l, z.l);
            fetch(sweep.moments + facet * z.block, z.block);
        }
    }
    room.seen.resize(std::max(rows, kind.columns));
    room.part.resize(wide);
    room.loads.assign(kind.columns, Floats{});
    room.change.resize(kind.columns);
    const auto slopes_at = [&](int64_t c, int64_t lane, int64_t s) {
        const int64_t side = sweep.sides[kind.shape.local[c] * z.sides + s];
        return sweep.slope + room.cells[c * kEight + lane] * z.n + side * z.block;
    };
    double largest[kEight] = {}, over[kEight], size_of[kEight];
    for (int64_t c = 0; c < cells; ++c) {
        for (int64_t lane = 0; lane < kEight; ++lane) {
            for (int64_t s = 0; s < z.sides; ++s) {
                const double* slope = slopes_at(c, lane, s);
                for (int64_t t = 0; t < z.block; ++t) largest[lane] = std::max(largest[lane], std::abs(slope[t]));
            }
        }
    }
    for (int64_t lane = 0; lane < kEight; ++lane) {
        if (!(largest[lane] > std::numeric_limits<double>::min() * 4.0)) largest[lane] = 1.0;
        over[lane] = 1.0 / largest[lane];
        size_of[lane] = largest[lane] * kind.size_of_seen;
    }
    const float* seen = kind.seen.data();
    for (int64_t c = 0; c < cells; ++c) {
        const int64_t first = kind.starts[c], size = kind.starts[c + 1] - first, columns = Kind::fours(size);
        for (int64_t lane = 0; lane < kEight; ++lane) {
            for (int64_t s = 0; s < z.sides; ++s) {
                const double* slope = slopes_at(c, lane, s);
                for (int64_t t = 0; t < z.block; ++t) {
                    room.seen[s * z.block + t][lane] = static_cast<float>(slope[t] * over[lane]);
                }
            }
        }
        combine_eight(columns, seen, room.seen.data(), rows, room.part.data());
        for (int64_t i = 0; i < size; ++i) room.loads[kind.fields[first + i]] += room.part[i];
        seen += rows * columns;
    }
    combine_eight(kind.columns, kind.inverse.data(), room.loads.data(), kind.q, room.change.data());
    const float* bent = kind.bent.data();
    for (int64_t c = 0; c < cells; ++c) {
        const int64_t first = kind.starts[c], size = kind.starts[c + 1] - first;
        for (int64_t i = 0; i < size; ++i) room.seen[i] = room.change[kind.fields[first + i]];
        combine_eight(kind.slopes, bent, room.seen.data(), size, room.part.data());
        bent += size * kind.slopes;
        for (int64_t lane = 0; lane < count; ++lane) {
            double* to = sweep.slope + room.cells[c * kEight + lane] * z.n;
            const double size_of_part = size_of[lane] * kind.size_of_bent;
            for (int64_t k = 0; k < z.n; ++k) to[k] += size_of_part * room.part[k][lane];
        }
    }
    room.places.resize(facets * z.block);
    room.changes.resize(kind.q);
    for (int64_t i = 0; i < kind.q; ++i) {
        const double unit = kind.unit[i];
        for (int64_t lane = 0; lane < kEight; ++lane) room.changes[i][lane] = size_of[lane] * unit * room.change[i][lane];
    }
    Doubles middle[kDim] = {};
    for (int64_t j = 0; j < facets; ++j) {
        for (int64_t lane = 0; lane < kEight; ++lane) {
            const int64_t* nodes = body.facet_nodes + room.facets[j * kEight + lane] * z.l;
            for (int64_t a = 0; a < z.l; ++a) {
                for (int64_t i = 0; i < z.d; ++i) room.places[j * z.block + a * z.d + i][lane] = body.points[nodes[a] * z.d + i];
            }
        }
        for (int64_t t = 0; t < z.block; ++t) middle[t % z.d] += room.places[j * z.block + t];
    }
    for (int64_t i = 0; i < z.d; ++i) middle[i] = middle[i] * (1.0 / static_cast<double>(facets * z.l));
    for (int64_t t = 0; t < facets * z.block; ++t) room.places[t] -= middle[t % z.d];
    for (int64_t j = 0; j < facets; ++j) {
        Doubles moved[kBlock] = {};
        moments_of(z, kind.shape, j, &room.places[j * z.block], room.changes.data(), moved);
        for (int64_t lane = 0; lane < count; ++lane) {
            double* to = sweep.moments + room.facets[j * kEight + lane] * z.block;
            for (int64_t t = 0; t < z.block; ++t) to[t] += moved[t][lane];
        }
    }
}

void improve_alike_any(const PatchBody& body, const PatchSweep& sweep, const Sizes& z, const Kind& kind,
                       const int64_t* patches, int64_t count, Room& room) {
    improve_alike(body, sweep, z, kind, patches, count, room);
}

HEMIVAR_WIDE void improve_alike_wide(const PatchBody& body, const PatchSweep& sweep, const Sizes& z, const Kind& kind,
                                     const int64_t* patches, int64_t count, Room& room) {
    improve_alike(body, sweep, z, kind, patches, count, room);
}

// Patches that are translates of many others, and the others.
struct Kinds {
    std::vector<int32_t> of;  // of each patch; -1 for those that are solved by themselves
    std::vector<Kind> kinds;

    Kinds(const PatchBody& body, const PatchSweep& sweep) : of(sweep.patches, -1) {
        const int64_t all = sweep.bounds[sweep.colours], pieces = (all + kPortion - 1) / kPortion;
        std::vector<int64_t> cells(body.cells, 0);  // of each kind of cells
        for (int64_t cell = 0; cell < body.cells; ++cell) ++cells[body.alike[cell]];
        std::vector<Found> found(pieces);
        share(pieces, [&](int64_t piece) {
            Improver one(body, sweep);
            std::vector<int64_t> key;
            for (int64_t at = piece * kPortion; at < std::min(all, (piece + 1) * kPortion); ++at) {
                const int64_t patch = sweep.order[at];
                if (!many(body, sweep, patch, cells)) continue;
                one.gather(patch);
                if (one.shape.priced || one.shape.facets.empty()) continue;
                one.key(key);
                of[patch] = found[piece].number(key, patch);
            }
        });
        Found whole;
        std::vector<std::vector<int32_t>> number(pieces);
        for (int64_t piece = 0; piece < pieces; ++piece) {
            const Found& own = found[piece];
            for (size_t k = 0; k < own.first.size(); ++k) {
                number[piece].push_back(whole.number(own.keys[k], own.first[k], own.counts[k]));
            }
        }
        std::vector<int32_t> place(whole.first.size(), -1);
        std::vector<int64_t> chosen;
        for (size_t k = 0; k < place.size(); ++k) {
            if (whole.counts[k] < kMany) continue;
            place[k] = static_cast<int32_t>(chosen.size());
            chosen.push_back(whole.first[k]);
        }
        for (int64_t at = 0; at < all; ++at) {
            int32_t& kind = of[sweep.order[at]];
            if (kind >= 0) kind = place[number[at / kPortion][kind]];
        }
        kinds.resize(chosen.size());
        share(static_cast<int64_t>(chosen.size()), [&](int64_t k) {
            Improver one(body, sweep);
            one.prepare(chosen[k]);
            one.invert();
            kinds[k].keep(Sizes(body, sweep), one.shape, one.system);
        });
    }

private:
    static constexpr int64_t kPortion = 4096;  // patches that are looked at together

    // Different keys, each with the first patch that has it.
    struct Found {
        std::unordered_multimap<uint64_t, int32_t> known;
        std::vector<std::vector<int64_t>> keys;
        std::vector<int64_t> first, counts;

        int32_t number(const std::vector<int64_t>& key, int64_t patch, int64_t count = 1) {
            uint64_t hash = 1;
            for (int64_t part : key) {
                hash = (hash ^ static_cast<uint64_t>(part)) * 0x9E3779B97F4A7C15u;
                hash ^= hash >> 29;
            }
            const auto range = known.equal_range(hash);
            for (auto at = range.first; at != range.second; ++at) {
                if (keys[at->second] != key) continue;
                counts[at->second] += count;
                return at->second;
            }
            const int32_t number = static_cast<int32_t>(keys.size());
            known.emplace(hash, number);
            keys.push_back(key);
            first.push_back(patch);
            counts.push_back(count);
            return number;
        }
    };

    // Whether each of its cells has many like it.
    static bool many(const PatchBody& body, const PatchSweep& sweep, int64_t patch, const std::vector<int64_t>& cells) {
        for (int64_t k = sweep.start[patch]; k < sweep.start[patch + 1]; ++k) {
            if (cells[body.alike[sweep.seen[k] / sweep.seen_of_cell]] < kMany) return false;
        }
        return true;
    }
};

}  // namespace

int64_t colour_patches(int64_t cells, int64_t seen_of_cell, const int64_t* patches, int64_t count,
                       const int64_t* ranked, int64_t* start, int64_t* seen, int64_t* order, int64_t* bounds) {
    constexpr int64_t words = kColours / 64;
    const int64_t all = cells * seen_of_cell;
    std::fill(start, start + count + 1, int64_t{0});
    for (int64_t k = 0; k < all; ++k) {
        if (patches[k] >= 0) ++start[patches[k] + 1];
    }
    for (int64_t p = 0; p < count; ++p) start[p + 1] += start[p];
    std::vector<int64_t> next(start, start + count);
    for (int64_t k = 0; k < all; ++k) {
        if (patches[k] >= 0) seen[next[patches[k]]++] = k;
    }
    std::vector<uint64_t> taken(cells * words, 0);
    std::vector<int32_t> colour(count, -1);
    std::fill(bounds, bounds + kColours + 1, int64_t{0});
    int64_t colours = 0;
    for (int64_t r = 0; r < count; ++r) {
        const int64_t p = ranked[r];
        if (start[p] == start[p + 1]) continue;
        for (int64_t w = 0; w < words && colour[p] < 0; ++w) {
            uint64_t beside = 0;
            for (int64_t k = start[p]; k < start[p + 1]; ++k) beside |= taken[seen[k] / seen_of_cell * words + w];
            if (beside == ~uint64_t{0}) continue;
            int bit = 0;
            while (beside >> bit & 1) ++bit;
            for (int64_t k = start[p]; k < start[p + 1]; ++k) {
                taken[seen[k] / seen_of_cell * words + w] |= uint64_t{1} << bit;
            }
            colour[p] = static_cast<int32_t>(w * 64 + bit);
        }
        if (colour[p] < 0) return -1;
        ++bounds[colour[p] + 1];
        colours = std::max<int64_t>(colours, colour[p] + 1);
    }
    for (int64_t c = 0; c < kColours; ++c) bounds[c + 1] += bounds[c];
    std::vector<int64_t> put(bounds, bounds + kColours);
    for (int64_t p = 0; p < count; ++p) {
        if (colour[p] >= 0) order[put[colour[p]]++] = p;
    }
    return colours;
}

// Patches of one colour are improved side by side: none of their cells may be in two of them.
void expect_apart(const PatchBody& body, const PatchSweep& sweep) {
    std::vector<int32_t> last(body.cells, -1);
    for (int64_t colour = 0; colour < sweep.colours; ++colour) {
        for (int64_t at = sweep.bounds[colour]; at < sweep.bounds[colour + 1]; ++at) {
            const int64_t patch = sweep.order[at];
            for (int64_t k = sweep.start[patch]; k < sweep.start[patch + 1]; ++k) {
                int32_t& seen = last[sweep.seen[k] / sweep.seen_of_cell];
                if (seen == colour) throw std::invalid_argument("two patches of a colour share a cell");
                seen = static_cast<int32_t>(colour);
            }
        }
    }
}

static void fetch_patch(const PatchBody& body, const PatchSweep& sweep, const Sizes& z, int64_t patch) {
    for (int64_t k = sweep.start[patch]; k < sweep.start[patch + 1]; ++k) {
        const int64_t cell = sweep.seen[k] / sweep.seen_of_cell;
        fetch(sweep.slope + cell * z.n, z.n);
        fetch(body.cell_facets + cell * z.corners, z.corners);
    }
}

void improve_patches(const PatchBody& body, const PatchSweep& sweep) {
    expect_apart(body, sweep);
    const Kinds kinds(body, sweep);
    const Sizes z(body, sweep);
    const auto alike = wide_registers() ? improve_alike_wide : improve_alike_any;
    std::vector<int64_t> order(sweep.order, sweep.order + sweep.bounds[sweep.colours]);
    for (int64_t colour = 0; colour < sweep.colours; ++colour) {
        const int64_t first = sweep.bounds[colour], last = sweep.bounds[colour + 1];
        std::stable_sort(order.begin() + first, order.begin() + last,
                         [&](int64_t one, int64_t two) { return kinds.of[one] < kinds.of[two]; });
        share((last - first + kPiece - 1) / kPiece, [&](int64_t piece) {
            Improver one(body, sweep);
            Room room;
            const int64_t end = std::min(last, first + (piece + 1) * kPiece);
            for (int64_t at = first + piece * kPiece; at < end;) {
                const int32_t kind = kinds.of[order[at]];
                if (kind < 0) {
                    one.improve(order[at++]);
                    continue;
                }
                int64_t count = 1;
                while (count < kEight && at + count < end && kinds.of[order[at + count]] == kind) ++count;
                for (int64_t next = at + count; next < std::min(end, at + count + kEight); ++next) {
                    fetch_patch(body, sweep, z, order[next]);
                }
                alike(body, sweep, z, kinds.kinds[kind], &order[at], count, room);
                at += count;
            }
        });
    }
}

}  // namespace hemivar
